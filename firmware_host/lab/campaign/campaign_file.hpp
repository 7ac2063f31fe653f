#pragma once
// The list of logs of a campaign: a YAML file.
//
//   repeats: 8                      # runs of each log; default 1
//   options: [--loop-closure]       # of `swiftlet replay`, for every log
//   logs:
//     - data/euroc_mh01_20s         # paths and options are relative to this file; * and ? as in a shell
//     - path: data/flights/*.bag
//       options: [--mono]
//       truth: mocap/poses.tum      # if the log has none
//     - name: rooms                 # simulated flights, rendered when needed
//       simulate: [--duration, 20]  # options of `swiftlet simulate`
//       seeds: [1, 50]              # first and last seed; default: only 1
//
// InputError names file, line and field.

#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

/// One log, and how it is replayed.
struct CampaignLog {
  std::string name;                   ///< for file names: letters, digits, dot, hyphen, underscore; unique
  std::string path;                   ///< empty: simulated
  std::string truth;                  ///< empty: the log's own
  std::vector<std::string> simulate;  ///< options of `swiftlet simulate`, the seed included
  std::vector<std::string> options;   ///< options of `swiftlet replay`
};

struct Campaign {
  std::string folder;  ///< absolute folder of the file, in which the programs are run
  int repeats = 1;
  std::vector<CampaignLog> logs;  ///< in the order of the file; matches of a pattern sorted by name
};

/// Also finds the files that match patterns.
Campaign readCampaign(const std::string& file);
Campaign parseCampaign(const std::string& file, std::string_view text);

}  // namespace swiftlet
