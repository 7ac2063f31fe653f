#pragma once
// Reads a video file with FFmpeg's libraries: grey images with their times, and GoPro's metadata track.
//
// Grey is the luma plane as coded: its range is not stretched and the image not rotated, as with live
// cameras. Errors: InputError naming the file. Images that cannot be decoded are counted and skipped. Host
// side: allocates; memory for the codec's own images. One thread.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct VideoFrame {
  Duration time;    ///< since the file's time zero
  ImageView image;  ///< valid until the next call
};

/// A payload of the track `gpmd`: what a GoPro measured during the payload's length.
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
  [[nodiscard]] double rate() const;  ///< mean images per second; 0: unknown

  [[nodiscard]] std::uint64_t pictures() const;  ///< 0: unknown

  /// The whole metadata track; empty if the file has none. Call before the first nextFrame().
  [[nodiscard]] std::vector<MetadataPacket> metadata();
  /// Images in the order of time; false at the end.
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
