#pragma once
// A run folder as a ROS 1 bag (format 2.0, not compressed), for Foxglove, PlotJuggler and RViz.
//
// docs/export.md lists topics, types, frames and what each stamp is. The messages lie in the bag by their
// stamps; the same run, options and build give the same bytes. Built with Debian's rosbag-storage and message
// packages; without them writeRunBag() says what to install. Memory: the folder's rows and one mesh.

#include <cstdint>
#include <map>
#include <string>

#include "firmware_host/lab/export/run_folder.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

namespace swiftlet {

struct RunBagOptions {
  RosFrames frames;
  bool meshes = true;  ///< also the surfaces
};

/// The truth beside the run: as recorded, and how its axes lie in the odometry's world.
struct BagTruth {
  Trajectory poses;  ///< empty: none
  SE3 T_world_truth;
};

/// Only the poses within the run, and the fit of the odometry to them about gravity and translation; a single
/// pose where the path is too short for that. No poses where none has the truth beside it.
BagTruth truthBeside(const RunFolder& run, const Trajectory& truth);

/// Messages by topic. InputError: stamps that a bag cannot hold (before 1 ns or after 2106), damaged meshes,
/// a file that cannot be written; nothing is left of it then.
std::map<std::string, std::uint64_t> writeRunBag(const RunFolder& run, const BagTruth& truth,
                                                 const RunBagOptions& options, const std::string& file);

/// False in builds without rosbag-storage and the message packages.
bool canWriteBags();

}  // namespace swiftlet
