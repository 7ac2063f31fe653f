#pragma once
// The map alone on a log, with given poses: what `swiftlet fuse` and the tests on it call.
//
// Depth comes from the log's depth images (`depth0`), each at its own stamp, or from the two cameras,
// wherever labels exist or `interval` has passed. Moments without a pose are skipped and counted; where the
// trajectory jumps a new epoch begins, and the volume with it.

#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

enum class DepthSource : std::uint8_t {
  kAny,     ///< the log's depth images where it has them, else stereo
  kSensor,  ///< the log's depth images
  kStereo,
};

struct FuseRequest {
  std::string log;
  std::string trajectory;       ///< TUM, EuRoC csv; empty: the log's own truth
  std::string out;              ///< folder to write
  std::string keep;             ///< file that the map is kept in; empty: none
  std::string continued;        ///< kept map to begin with, in whose frame the poses are; empty: a new map
  std::string calibration;      ///< instead of the log's own; empty: the log's
  std::string imu_calibration;  ///< Kalibr's IMU file where it is not beside the camchain
  DepthSource depth = DepthSource::kAny;
  double interval = 0.2;        ///< s between stereo pairs that are matched, where no labels ask for one
  double max_gap = 0.1;         ///< s between poses, to interpolate
  double from = 0;              ///< s after the first image
  std::optional<double> until;  ///< s after the first image
  const std::atomic<bool>* stop = nullptr;
  bool show_progress = false;
};

struct FuseRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
  bool has_surface = false;
};

/// Writes map.ply, map.glb, the kept map, trajectory.tum (the poses used) and summary.json. InputError for
/// bad input; nothing is written before the first depth image that has a pose.
FuseRunResult runFuse(const FuseRequest& request, const Settings& settings);

}  // namespace swiftlet
