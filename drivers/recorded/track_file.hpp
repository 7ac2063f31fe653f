#pragma once
// Feature tracks in a file, to run the back-end alone. One line per sighting:
//
//   #timestamp [ns],track,u0 [px],v0 [px],u1 [px],v1 [px]
//   1403636579763555584,17,310.25,201.5,288.125,201.75
//   1403636579763555584,18,52.5,99.0,,
//
// Pixels are those of the raw (distorted) image, (0,0) the centre of the top-left pixel; the fields of a
// camera that did not see the landmark are empty. Lines of one stamp stand together, stamps rise. A
// frame without any track is a line with only its stamp. Tracks of one id are one landmark.

#include <cstdint>
#include <cstdio>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

struct TrackRecord {
  Stamp stamp;
  std::vector<TrackedFeature> features;  ///< each seen by at least one camera
};

/// Reads frame by frame in constant memory. Bad rows are skipped and counted; a stamp that goes back,
/// or an id twice in a frame, is a bad row.
class TrackReader {
 public:
  TrackReader(const std::string& path, LogCounters& counters, LogWarnings& warnings);
  TrackReader(const std::string& name, std::string_view text, LogCounters& counters, LogWarnings& warnings);

  /// The next frame; false at the end (InputError when the file is no track file).
  bool next(TrackRecord& record);

 private:
  enum class Row { kEnd, kFrame, kFeature };
  Row readRow();

  CsvReader csv_;
  bool pending_ = false;  ///< a row read ahead
  bool ended_ = false;
  bool any_ = false;
  Row pending_kind_ = Row::kEnd;
  Stamp pending_stamp_;
  Stamp newest_;
  TrackedFeature pending_feature_;
  std::set<TrackId> ids_;  ///< of the frame being read
};

class TrackWriter {
 public:
  explicit TrackWriter(const std::string& path);
  ~TrackWriter();
  TrackWriter(const TrackWriter&) = delete;
  TrackWriter& operator=(const TrackWriter&) = delete;

  void write(const TrackRecord& record);
  void close();

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace swiftlet
