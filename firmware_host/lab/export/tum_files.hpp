#pragma once
// The trajectories of a run folder as TUM files for evo: one file each, eight columns.

#include <string>
#include <vector>

#include "firmware_host/lab/export/run_folder.hpp"

namespace swiftlet {

/// Writes into `folder`, which is created: the run's own TUM files byte for byte (odometry.tum or
/// trajectory.tum, map.tum, imu_rate.tum), keyframes.tum from states.csv, truth.tum from `truth` (none if it
/// is empty). Existing files of these names that the run does not provide are removed after all are written.
/// Returns the names written. InputError if a file cannot be written, and for a folder that is a run.
std::vector<std::string> writeTumFiles(const RunFolder& run, const Trajectory& truth,
                                       const std::string& folder);

}  // namespace swiftlet
