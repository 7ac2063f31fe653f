#pragma once
// Feature tracks in a file, in place of images: what `simulate --tracks` writes and replay reads, to run
// the back-end alone. One line per sighting:
//
//   #timestamp [ns],id,camera,u [px],v [px],keyframe
//   1403636579763555584,17,0,310.25,201.5,1
//   1403636579763555584,17,1,288.125,201.75,1
//   1403636579813555584,,,,,0
//
// The first line names the columns, in this order; `keyframe` may be left out. Lines of one stamp are one
// frame and stand together, in any order; stamps rise. A line whose id, camera and pixel are empty is a
// frame (part) without tracks. Lines of one id are one landmark: both cameras' sightings at one stamp
// become one TrackedFeature. Pixels are those of the raw (distorted) image, (0,0) the centre of the
// top-left pixel. `keyframe` is 0 or 1, the same for the whole frame.
//
// The file is made by a program, so nothing in it is repaired or skipped: whatever is malformed is an
// InputError with file, line, field and remedy.

#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// Reads frame by frame, in memory that one frame needs.
class TrackReader {
 public:
  /// InputError when the file cannot be read, has another header or holds no line.
  explicit TrackReader(const std::string& path);
  /// Reads text in memory, which must outlive the reader; `name` names the file in messages.
  TrackReader(const std::string& name, std::string_view text);
  TrackReader(const TrackReader&) = delete;
  TrackReader& operator=(const TrackReader&) = delete;

  /// The next frame; false at the end. Sets everything but `keyframe` where the file does not tell. A camera
  /// counts as present when it saw something.
  bool next(TrackedFrame& frame);

  /// The file marks which frames are keyframes.
  [[nodiscard]] bool hasKeyframes() const { return columns_ > kKeyframe; }
  /// One more than the highest camera number so far.
  [[nodiscard]] std::size_t cameras() const { return cameras_; }
  /// Landmarks beyond kMaxFeatures in a frame so far: left out, the first ones stay.
  [[nodiscard]] std::uint64_t surplus() const { return surplus_; }
  /// Lines for the user about the surplus.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_.lines(); }

 private:
  enum Column : std::size_t { kStamp, kId, kCamera, kU, kV, kKeyframe, kColumnCount };
  struct Row {
    Stamp stamp;
    bool sighting = false;  ///< false: the frame alone
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
  std::map<TrackId, std::size_t> slots_;  ///< of the frame being read; kMaxFeatures: left out
  std::size_t cameras_ = 0;
  std::uint64_t next_index_ = 0;
  std::uint64_t surplus_ = 0;
  std::uint64_t crowded_ = 0;  ///< frames with surplus
};

/// Summary of a whole file. Reading it before a run rejects a bad file before any output is created.
struct TrackFileFacts {
  std::uint64_t frames = 0;
  std::size_t cameras = 0;
  Stamp first;
  Stamp last;
};
TrackFileFacts surveyTrackFile(const std::string& path);

/// Writes the same format, keyframe column included. InputError when that fails.
class TrackWriter {
 public:
  explicit TrackWriter(const std::string& path);
  ~TrackWriter();
  TrackWriter(const TrackWriter&) = delete;
  TrackWriter& operator=(const TrackWriter&) = delete;

  /// Stamps must rise. Pixels read back to the same floats.
  void write(const TrackedFrame& frame);
  void close();

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace swiftlet
