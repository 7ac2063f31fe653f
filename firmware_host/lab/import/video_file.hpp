#pragma once
// A video file through FFmpeg's libraries: grey images with their times, and GoPro's metadata track.
//
// Grey is the luma plane as coded: neither its range is stretched nor the picture turned, as with live
// cameras. Errors: InputError that names the file. Pictures that cannot be decoded are counted and left out.
// Host side: allocates; memory of the codec's own pictures. One thread.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct VideoFrame {
  Duration time;    ///< since the file's time zero
  ImageView image;  ///< until the next call
};

/// A payload of the track `gpmd`, which holds what a GoPro measured during its length.
struct MetadataPacket {
  Duration begin;  ///< since the file's time zero
  Duration length;
  std::vector<std::uint8_t> bytes;
};

class VideoFile {
 public:
  explicit VideoFile(const std::string& path);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  [[nodiscard]] double rate() const;  ///< images a second, mean; 0: the file does not say

  [[nodiscard]] std::uint64_t pictures() const;  ///< 0: the file does not say

  /// All of it; empty: the file has no such track. Before the first nextFrame().
  [[nodiscard]] std::vector<MetadataPacket> metadata();
  /// In the order of time; false at the end.
  bool nextFrame(VideoFrame& frame);
  [[nodiscard]] std::uint64_t damaged() const { return damaged_; }

 private:
  struct Codec;
  bool receive();

  std::string path_;
  std::unique_ptr<Codec> codec_;
  std::vector<std::uint8_t> grey_;
  std::uint64_t damaged_ = 0;
};

/// False in builds without FFmpeg's libraries.
bool canReadVideos();

}  // namespace swiftlet
