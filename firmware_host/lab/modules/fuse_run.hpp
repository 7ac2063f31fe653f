#pragma once
// The map alone on a log, with given poses: what `swiftlet fuse` and the tests on it call.
//
// Depth comes from the log's depth images (`depth0`), each at its own stamp, or from the two cameras,
// wherever labels exist or `interval` has passed. Moments without a pose are skipped and counted; where the
// trajectory jumps a new epoch begins, and the volume with it.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/modules/posed_log.hpp"

namespace swiftlet {

enum class DepthSource : std::uint8_t {
  kAny,     ///< the log's depth images where it has them, else stereo
  kSensor,  ///< the log's depth images
  kStereo,
};

struct FuseRequest : PosedLogRequest {
  std::string out;        ///< folder to write
  std::string keep;       ///< file that the map is kept in; empty: none
  std::string continued;  ///< kept map to begin with, in whose frame the poses are; empty: a new map
  DepthSource depth = DepthSource::kAny;
  double interval = 0.2;  ///< s between stereo pairs that are matched, where no labels ask for one
};

struct FuseRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
  bool has_surface = false;
  std::string problem;  ///< what the map lacks (unreadProblem()); empty: nothing
};

/// Writes map.ply, map.glb, the kept map, trajectory.tum (the poses used) and summary.json. InputError for
/// bad input; nothing is written before the first depth image that has a pose.
FuseRunResult runFuse(const FuseRequest& request, const Settings& settings);

}  // namespace swiftlet
