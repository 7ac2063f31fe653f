#pragma once
// Place recognition alone, on images with given poses: what `swiftlet place` and the tests on it call.
//
// Two kinds of input. A log (openLog) gives calibration, stamps and, with two cameras, depths: candidates are
// verified by geometry. A plain folder of pictures gives neither: candidates only. Its pictures have the
// poses of the trajectory that stand at the stamps in their names (nanoseconds, or seconds with a point), or,
// where the names are no stamps, one pose each in the order of the names.
//
// An image becomes a keyframe where it has moved or turned enough by the given poses; a plain folder is taken
// whole. Each is described, asked about, verified and stored, in the order of time. Where the poses jump a
// new epoch begins: its world is another, so that pairs across are not judged. Host side.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/modules/posed_log.hpp"

namespace swiftlet {

/// `log` may be a plain folder of images.
struct PlaceRequest : PosedLogRequest {
  std::string out;               ///< folder to write
  std::string vocabulary;        ///< file; empty: the settings', else the shipped one
  int candidates = 10;           ///< of an image, at most
  double exclude = 10;           ///< s: images nearer in time are no revisit
  double min_distance = 0.25;    ///< m: a log's image is a keyframe when it has moved by this,
  double min_turn_deg = 11.5;    ///< turned by this
  double min_seconds = 2;        ///< or when this much time has passed since the last one
  std::size_t keyframes = 2000;  ///< that are remembered at most
};

struct PlaceRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
};

/// Writes places.csv (one row for each candidate: what retrieval, geometry and the poses say of it) and
/// summary.json. InputError for bad input; nothing is written before the first image that has a pose.
PlaceRunResult runPlace(const PlaceRequest& request, const Settings& settings);

}  // namespace swiftlet
