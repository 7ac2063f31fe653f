#pragma once
// in_map.tum: the pose of each image in the frame of a kept map, while the flight is located in it.
//
// The pose is the odometry's at the image's time, corrected by what loop closure knew at the newest keyframe
// up to the image, so that a line never depends on later images. Images and reports come through different
// queues, so either may come first: images wait for the report on a later keyframe, reports for the images
// before them. The keyframes with a report are recorded with the flight, so that a repetition writes the same
// lines.

#include <deque>
#include <string>

#include "estimator/messages/odometry_output.hpp"
#include "firmware_host/files/line_file.hpp"
#include "mapping/loop/loop_report.hpp"

namespace swiftlet {

class InMapFile {
 public:
  explicit InMapFile(const std::string& path) : file_(path) {}

  void addFrame(std::uint64_t frame, Stamp stamp, const NavState& state);
  void addReport(const LoopReport& report);
  /// Call when no more reports will come.
  void finish();

 private:
  struct Waiting {
    std::uint64_t frame = 0;
    Stamp stamp;
    std::uint32_t epoch = 0;
    SE3 T_world_body;
  };
  struct Report {
    std::uint64_t frame = 0;
    MapCorrection correction;
  };
  void takeReport();
  /// Writes the images whose newest report is known; if `ended`, all.
  void write(bool ended);

  LineFile file_;
  std::deque<Waiting> waiting_;
  std::deque<Report> reports_;  ///< of images that have not come
  MapCorrection known_;
};

}  // namespace swiftlet
