#pragma once
// Feature tracks in a file instead of images, written by `simulate --tracks` and read by replay to run only
// the back-end. One line per sighting:
//
//   #timestamp [ns],id,camera,u [px],v [px],keyframe
//   1403636579763555584,17,0,310.25,201.5,1
//   1403636579763555584,17,1,288.125,201.75,1
//   1403636579813555584,,,,,0
//
// The first line names the columns, in this order; `keyframe` may be omitted. Lines with the same stamp are
// one frame; they are consecutive, in any order. Stamps rise. A line with empty id, camera and pixel is a
// frame (or part of one) without tracks. Lines with the same id are one landmark: the sightings of both
// cameras at one stamp become one TrackedFeature. Pixels are in the raw (distorted) image, (0,0) is the
// centre of the top-left pixel. `keyframe` is 0 or 1, the same for the whole frame.
//
// The file is written by a program, so nothing is repaired or skipped: anything malformed is an InputError
// with file, line, field and remedy.

#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// Reads frame by frame; memory of one frame.
class TrackReader {
 public:
  /// InputError if the file cannot be read, has another header or no data.
  explicit TrackReader(const std::string& path);
  /// Reads text in memory, which must outlive the reader; `name` names the file in messages.
  TrackReader(const std::string& name, std::string_view text);
  TrackReader(const TrackReader&) = delete;
  TrackReader& operator=(const TrackReader&) = delete;

  /// The next frame; false at the end. `keyframe` is false if the file has no such column. A camera counts as
  /// present if it has a sighting.
  bool next(TrackedFrame& frame);

  /// Whether the file marks keyframes.
  [[nodiscard]] bool hasKeyframes() const { return columns_ > kKeyframe; }
  /// Highest camera number so far, plus one.
  [[nodiscard]] std::size_t cameras() const { return cameras_; }
  /// Number of landmarks dropped so far because a frame had more than kMaxFeatures; the first ones are kept.
  [[nodiscard]] std::uint64_t surplus() const { return surplus_; }
  /// Messages for the user about dropped landmarks.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_.lines(); }

 private:
  enum Column : std::size_t { kStamp, kId, kCamera, kU, kV, kKeyframe, kColumnCount };
  struct Row {
    Stamp stamp;
    bool sighting = false;  ///< false: a frame without tracks
    TrackId id = 0;
    std::size_t camera = 0;
    Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
    bool keyframe = false;
  };

  void begin();
  void checkHeader();
  bool readRow();
  void parseRow();
  std::int64_t integer(Column column, std::int64_t most);
  void addSighting(TrackedFrame& frame);
  [[noreturn]] void refuse(Column column, const std::string& message, const char* remedy) const;
  void refuseRejected() const;

  LogCounters counters_;
  LogWarnings warnings_;
  CsvReader csv_;
  std::size_t columns_ = 0;
  Row row_;  ///< read ahead
  bool more_ = false;
  bool any_ = false;
  std::map<TrackId, std::size_t> slots_;  ///< in the frame being read; kMaxFeatures: dropped
  std::size_t cameras_ = 0;
  std::uint64_t next_index_ = 0;
  std::uint64_t surplus_ = 0;
  std::uint64_t crowded_ = 0;  ///< frames with dropped landmarks
};

/// Summary of a whole file. Reading it before a run rejects a bad file before any output is created.
struct TrackFileFacts {
  std::uint64_t frames = 0;
  std::size_t cameras = 0;
  Stamp first;
  Stamp last;
};
TrackFileFacts surveyTrackFile(const std::string& path);

/// Writes the same format, with the keyframe column. InputError if that fails.
class TrackWriter {
 public:
  explicit TrackWriter(const std::string& path);
  ~TrackWriter();
  TrackWriter(const TrackWriter&) = delete;
  TrackWriter& operator=(const TrackWriter&) = delete;

  /// Stamps must rise. Pixels are restored to the same floats.
  void write(const TrackedFrame& frame);
  void close();

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace swiftlet
