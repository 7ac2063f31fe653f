#pragma once
// in_map.tum: the pose of each image in the frame of a kept map, as long as the flight is located there.
//
// An image's pose is the odometry's at its time, moved by what loop closure knew at the newest keyframe up to
// it, so that a line never knows of later images. Images and reports come through different queues, so either
// may come first: images wait for the report on a later keyframe, reports for the images before them. Which
// keyframe has a report is recorded with the flight, so that a repetition writes the same lines.

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
  /// No more reports come.
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
  /// The images whose newest report is known; all that wait if no more reports come.
  void write(bool ended);

  LineFile file_;
  std::deque<Waiting> waiting_;
  std::deque<Report> reports_;  ///< of images that have not come
  MapCorrection known_;
};

}  // namespace swiftlet
