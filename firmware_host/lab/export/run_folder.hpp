#pragma once
// A run folder as other programs' formats want it: everything read and checked before anything is written.
//
// Reads what replay, fly, hil, mesh and fuse write (docs/user_guide.md, "The run folder"). The files are a
// program's own, so nothing is repaired: a bad row, a repeated or reversed stamp, a file that the folder's
// kind must have and does not, is an InputError with file, line, field and remedy. Meshes are named here and
// read when they are asked for. Memory: the rows.

#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "firmware_host/lab/evaluation/mesh_frames.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"

namespace swiftlet {

struct RunFolder {
  std::string path;
  Trajectory odometry;  ///< T_world_body, one for each image; the given poses where a run has no odometry
  std::string odometry_file;             ///< "odometry.tum" or "trajectory.tum"
  bool given_poses = false;              ///< of mesh and fuse: poses in the axes of whoever gave them
  Trajectory imu_rate;                   ///< empty: none
  Trajectory map;                        ///< T_map_body; empty: none
  std::vector<KeyframeState> keyframes;  ///< readKeyframes(); in time order
  std::vector<EventLine> events;         ///< in the file's order
  std::vector<MeshFrame> meshes;         ///< of meshes/frames.csv
  std::string local_mesh;                ///< path; empty: none
  std::string map_mesh;                  ///< path; empty: none
  std::string log;                       ///< that the run was made from; empty: not known
  bool from_tracks = false;              ///< the log need not hold images
  Duration shift;                        ///< from its poses' clock to the truth's
};

RunFolder readRunFolder(const std::string& path);

/// `T_map_world` at the odometry's stamps, from map.tum: between two keyframes the body's place and the
/// rotation are interpolated, outside the nearest holds. The identity everywhere without a map, or when no
/// keyframe lies within 0.1 s of the odometry.
std::vector<SE3> mapCorrections(const RunFolder& run);

}  // namespace swiftlet
