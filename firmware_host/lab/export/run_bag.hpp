#pragma once
// A run folder as messages in a bag, for Foxglove, PlotJuggler and RViz.
//
// docs/export.md lists topics, types, frames and the meaning of each stamp. Messages are ordered by their
// stamps; equal run, options and build give equal bytes. Memory: the folder's rows and one mesh.

#include "drivers/bag/message_bag.hpp"
#include "firmware_host/lab/export/log_bag.hpp"
#include "firmware_host/lab/export/run_folder.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

namespace swiftlet {

struct RunBagOptions {
  RosFrames frames;
  bool meshes = true;  ///< also write the surfaces
};

/// The truth as recorded, and the transform of its axes to the odometry's world.
struct BagTruth {
  Trajectory poses;  ///< empty: none
  SE3 T_world_truth;
};

/// The truth's poses during the run, and the alignment of the odometry to them by yaw and translation, or by
/// a single pose if the path is too short. No poses if no pose of the run has truth.
BagTruth truthBeside(const RunFolder& run, const Trajectory& truth);

/// `log`: its messages are merged with those of the run; null: none. InputError: stamps that a bag cannot
/// hold, damaged meshes, a file that cannot be written.
void writeRunBag(const RunFolder& run, const BagTruth& truth, const RunBagOptions& options, MessageBag& bag,
                 LogBag* log = nullptr);

}  // namespace swiftlet
