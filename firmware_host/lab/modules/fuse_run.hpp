#pragma once
// Runs only the map on a log with given poses: called by `swiftlet fuse` and its tests.
//
// Depth comes from the log's depth images (`depth0`), each at its own stamp, or from the two cameras,
// whenever there are labels or `interval` has passed. Times without a pose are skipped and counted. Where the
// trajectory jumps, a new epoch with a new volume begins.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/modules/posed_log.hpp"

namespace swiftlet {

enum class DepthSource : std::uint8_t {
  kAny,     ///< the log's depth images if it has any, otherwise stereo
  kSensor,  ///< the log's depth images
  kStereo,
};

struct FuseRequest : PosedLogRequest {
  std::string out;        ///< folder to write
  std::string keep;       ///< file for the kept map; empty: none
  std::string continued;  ///< kept map to continue, in whose frame the poses are; empty: a new map
  DepthSource depth = DepthSource::kAny;
  double interval = 0.2;  ///< s between stereo pairs to be matched, if no labels require one
};

struct FuseRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
  bool has_surface = false;
  std::string problem;  ///< what is missing in the map (unreadProblem()); empty: nothing
};

/// Writes map.ply, map.glb, the kept map, trajectory.tum (the poses used) and summary.json. InputError for
/// bad input; nothing is written before the first depth image that has a pose.
FuseRunResult runFuse(const FuseRequest& request, const Settings& settings);

}  // namespace swiftlet
