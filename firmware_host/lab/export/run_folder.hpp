#pragma once
// A run folder for export to other formats: everything is read and checked before anything is written.
//
// Reads what replay, fly, hil, mesh and fuse write (docs/user_guide.md, "The run folder"). The files are
// written by a program, so nothing is repaired: a bad row, a repeated or reversed stamp, or a missing
// required file is an InputError with file, line, field and remedy. Meshes are only named here and read on
// request. Memory: the rows.

#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "firmware_host/lab/evaluation/mesh_frames.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"

namespace swiftlet {

struct RunFolder {
  std::string path;
  Trajectory odometry;        ///< T_world_body, one per image; the given poses if a run has no odometry
  std::string odometry_file;  ///< "odometry.tum" or "trajectory.tum"
  bool given_poses = false;   ///< from mesh and fuse: poses in the axes of their source
  Trajectory imu_rate;        ///< empty: none
  Trajectory map;             ///< T_map_body; empty: none
  std::vector<KeyframeState> keyframes;  ///< readKeyframes(); in time order
  std::vector<EventLine> events;         ///< in the file's order
  std::vector<MeshFrame> meshes;         ///< of meshes/frames.csv
  std::string local_mesh;                ///< path; empty: none
  std::string map_mesh;                  ///< path; empty: none
  std::string log;                       ///< log of the run; empty: unknown
  bool from_tracks = false;              ///< the log may be without images
  Duration shift;                        ///< from the poses' clock to the truth's
};

RunFolder readRunFolder(const std::string& path);

/// `T_map_world` at the odometry's stamps, from map.tum: between two keyframes the body's position and the
/// rotation are interpolated; outside, the nearest value is used. The identity everywhere without a map, or
/// if no keyframe is within 0.1 s of the odometry.
std::vector<SE3> mapCorrections(const RunFolder& run);

}  // namespace swiftlet
