#pragma once
// Result of one replay of a campaign.

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

/// A figure of a run, with its place in the summary.
struct CampaignFigure {
  std::string_view name;   ///< in CSV and JSON
  std::string_view title;  ///< in human-readable tables
  std::string_view place;  ///< JSON pointer into the summary
  int digits;              ///< after the decimal point, in human-readable tables
};

/// Figures that depend only on log, settings and program. Campaigns are compared by the first: the RMS
/// position error of the odometry after SE(3) alignment, over the whole flight.
std::span<const CampaignFigure> accuracyFigures();
/// Figures that also depend on the machine.
std::span<const CampaignFigure> costFigures();

enum class CampaignOutcome {
  kDone,
  kFailed,   ///< the run finished but the replay reports failure: no pose, or good for less than half of it
  kAborted,  ///< the run did not finish: bad input, a crash, a full disk; the next campaign tries again
};

struct CampaignRow {
  std::string log;
  int repeat = 0;                    ///< 0: with unchanged settings
  std::vector<std::string> command;  ///< the command, without the program and --out
  std::string program;               ///< version and checksum of the program
  CampaignOutcome outcome = CampaignOutcome::kAborted;
  std::string says;                             ///< why it is not kDone; otherwise empty
  std::vector<std::optional<double>> accuracy;  ///< for each of accuracyFigures(); empty: no truth
  std::vector<std::optional<double>> costs;     ///< for each of costFigures()
};

std::string describe(CampaignOutcome outcome);

/// The figures of a run's summary.
std::vector<std::optional<double>> figuresOf(const nlohmann::ordered_json& summary,
                                             std::span<const CampaignFigure> figures);

nlohmann::ordered_json toJson(const CampaignRow& row);
/// Reads a file written from toJson(); InputError if it is not one.
CampaignRow readCampaignRow(const std::string& file);
/// OUT/rows/<log>.<repeat>.json
std::string campaignRowFile(const std::string& out, const std::string& log, int repeat);

}  // namespace swiftlet
