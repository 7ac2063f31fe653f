#pragma once
// A run folder as messages in a bag, for Foxglove, PlotJuggler and RViz.
//
// docs/export.md lists topics, types, frames and what each stamp is. The messages lie in the bag by their
// stamps; the same run, options and build give the same bytes. Memory: the folder's rows and one mesh.

#include "drivers/bag/message_bag.hpp"
#include "firmware_host/lab/export/log_bag.hpp"
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

/// `log`: its messages stand between those of the run; null: none. InputError: stamps that a bag cannot hold,
/// damaged meshes, a file that cannot be written.
void writeRunBag(const RunFolder& run, const BagTruth& truth, const RunBagOptions& options, MessageBag& bag,
                 LogBag* log = nullptr);

}  // namespace swiftlet
