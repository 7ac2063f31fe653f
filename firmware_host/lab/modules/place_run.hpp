#pragma once
// Runs only place recognition on images with given poses: called by `swiftlet place` and its tests.
//
// Two kinds of input. A log (openLog) gives calibration, stamps and, with two cameras, depths: candidates are
// verified geometrically. A plain folder of images gives neither: candidates only. Its images have the
// trajectory's poses at the stamps in their names (nanoseconds, or seconds with a decimal point), or, if the
// names are not stamps, one pose each in the order of the names.
//
// An image becomes a keyframe if it has moved or rotated enough by the given poses; all images of a plain
// folder are taken. Each is described, queried, verified and stored, in the order of time. Where the poses
// jump, a new epoch begins: it has another world, so pairs across are not judged. Host side.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/modules/posed_log.hpp"

namespace swiftlet {

/// `log` may be a plain folder of images.
struct PlaceRequest : PosedLogRequest {
  std::string out;               ///< folder to write
  std::string vocabulary;        ///< file; empty: the settings' one, else the shipped one
  int candidates = 10;           ///< most per image
  double exclude = 10;           ///< s: images closer in time are no revisit
  double min_distance = 0.25;    ///< m: an image of a log becomes a keyframe if it has moved by this,
  double min_turn_deg = 11.5;    ///< rotated by this,
  double min_seconds = 2;        ///< or when this much time has passed since the last one
  std::size_t keyframes = 2000;  ///< most keyframes remembered
};

struct PlaceRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
};

/// Writes places.csv (one row per candidate with the results of retrieval, geometry and poses) and
/// summary.json. InputError for bad input; nothing is written before the first image that has a pose.
PlaceRunResult runPlace(const PlaceRequest& request, const Settings& settings);

}  // namespace swiftlet
