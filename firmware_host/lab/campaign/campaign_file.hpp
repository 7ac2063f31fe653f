#pragma once
// The list of logs of a campaign: a YAML file.
//
//   repeats: 8                      # runs of each log; default 1
//   options: [--loop-closure]       # of `swiftlet replay`, for every log
//   logs:
//     - data/euroc_mh01_20s         # paths and options are relative to this file; * and ? as in a shell
//     - path: data/flights/*.bag
//       options: [--mono]
//       truth: mocap/poses.tum      # where the log holds none
//     - name: rooms                 # simulated flights, rendered when they are needed
//       simulate: [--duration, 20]  # options of `swiftlet simulate`
//       seeds: [1, 50]              # the first and the last; default: 1 alone
//
// InputError names file, line and field.

#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

/// One log, and how it is replayed.
struct CampaignLog {
  std::string name;                   ///< of its files: letters, digits, dot, hyphen, underscore; unique
  std::string path;                   ///< empty: simulated
  std::string truth;                  ///< empty: the log's own
  std::vector<std::string> simulate;  ///< options of `swiftlet simulate`, the seed included
  std::vector<std::string> options;   ///< of `swiftlet replay`
};

struct Campaign {
  std::string folder;  ///< of the file, absolute: where the programs are run
  int repeats = 1;
  std::vector<CampaignLog> logs;  ///< in the order of the file; a pattern's sorted by name
};

/// Also looks for the files that patterns name.
Campaign readCampaign(const std::string& file);
Campaign parseCampaign(const std::string& file, std::string_view text);

}  // namespace swiftlet
