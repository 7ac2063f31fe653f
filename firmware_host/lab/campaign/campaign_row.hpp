#pragma once
// What one replay of a campaign gave.

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

/// A figure of a run, by its place in the run's summary.
struct CampaignFigure {
  std::string_view name;   ///< in CSV and JSON
  std::string_view title;  ///< in tables for people
  std::string_view place;  ///< JSON pointer into the summary
  int digits;              ///< after the point, in tables for people
};

/// Functions of log, settings and program: the same in every run. The first is what campaigns are compared
/// by: the RMS position error of the odometry after SE(3) alignment, over all of the flight.
std::span<const CampaignFigure> accuracyFigures();
/// What the machine had to do with, too.
std::span<const CampaignFigure> costFigures();

enum class CampaignOutcome {
  kDone,
  kFailed,  ///< the run went to its end, and the replay says that it failed: no pose, or not good for half of
            ///< it
  kAborted,  ///< it did not go to its end: bad input, a crash, a full disk; the next campaign tries again
};

struct CampaignRow {
  std::string log;
  int repeat = 0;                    ///< 0: with the settings as they are
  std::vector<std::string> command;  ///< what was run, without the program and --out
  std::string program;               ///< its version and checksum
  CampaignOutcome outcome = CampaignOutcome::kAborted;
  std::string says;                             ///< why it is not kDone; empty otherwise
  std::vector<std::optional<double>> accuracy;  ///< of each of accuracyFigures(); none: no truth
  std::vector<std::optional<double>> costs;     ///< of each of costFigures()
};

std::string describe(CampaignOutcome outcome);

/// The figures of a run's summary.
std::vector<std::optional<double>> figuresOf(const nlohmann::ordered_json& summary,
                                             std::span<const CampaignFigure> figures);

nlohmann::ordered_json toJson(const CampaignRow& row);
/// Of a file written from toJson(); InputError when it is not one.
CampaignRow readCampaignRow(const std::string& file);
/// OUT/rows/<log>.<repeat>.json
std::string campaignRowFile(const std::string& out, const std::string& log, int repeat);

}  // namespace swiftlet
