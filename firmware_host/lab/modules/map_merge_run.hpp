#pragma once
// Two kept maps made one, and what a kept map holds: what `swiftlet map merge` and `swiftlet map info` call.

#include <nlohmann/json.hpp>
#include <string>

namespace swiftlet {

struct MapMergeRequest {
  std::string first;   ///< folder of a kept map; the merged map has its frame
  std::string second;  ///< folder of another
  std::string out;     ///< new folder
};

/// The second map's nodes follow the first's as if they had been flown in it (LoopStage::flyAgain). Returns
/// the summary. InputError, and nothing is written, where a folder is no sound map, `out` is there already,
/// or loops do not tie the two.
nlohmann::ordered_json runMapMerge(const MapMergeRequest& request);

/// Of the graph, and of the volume where there is one.
nlohmann::ordered_json mapInfo(const std::string& folder);

}  // namespace swiftlet
