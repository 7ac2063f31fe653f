#pragma once
// Merges two kept maps, and describes a kept map: called by `swiftlet map merge` and `swiftlet map info`.

#include <nlohmann/json.hpp>
#include <string>

namespace swiftlet {

struct MapMergeRequest {
  std::string first;   ///< folder of a kept map; the merged map has its frame
  std::string second;  ///< folder of another
  std::string out;     ///< new folder
};

/// Adds the second map's nodes after the first's as if they had been flown in it (LoopStage::flyAgain).
/// Returns the summary. InputError, and nothing is written, if a folder is not a valid map, `out` exists, or
/// no loops tie the two.
nlohmann::ordered_json runMapMerge(const MapMergeRequest& request);

/// Describes the graph, and the volume if there is one.
nlohmann::ordered_json mapInfo(const std::string& folder);

}  // namespace swiftlet
