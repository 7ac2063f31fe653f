#include "firmware_host/lab/campaign/campaign_row.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kAccuracy = {
    CampaignFigure{"ate_m", "ATE [m]", "/accuracy/odometry/all/se3/ate_m/rmse", 4},
    CampaignFigure{"ate_from_3s_m", "from 3 s [m]", "/accuracy/odometry/from_3s/se3/ate_m/rmse", 4},
    CampaignFigure{"attitude_deg", "attitude [deg]", "/accuracy/odometry/all/se3/attitude_deg/rmse", 3},
    CampaignFigure{"rpe_1s_m", "RPE [m]", "/accuracy/odometry/all/se3/rpe_time/translation_m/rmse", 4},
    CampaignFigure{"map_ate_m", "map ATE [m]", "/accuracy/map/all/se3/ate_m/rmse", 4},
    CampaignFigure{"nees", "NEES", "/accuracy/consistency/nees_pose_6dof", 1},
    CampaignFigure{"first_pose_s", "first pose [s]", "/run/time_to_first_pose_s", 2},
    CampaignFigure{"share_good", "good", "/verdict/share_good", 3},
};
constexpr std::array kCosts = {
    CampaignFigure{"cpu_per_flight_second", "CPU per second of flight [s]", "/cpu/cpu_per_flight_second", 3},
    CampaignFigure{"wall_s", "time [s]", "/cpu/wall_s", 1},
    CampaignFigure{"peak_resident_bytes", "peak memory [bytes]", "/memory/peak_resident_bytes", 0},
};
constexpr std::array kOutcomes = {"done", "failed", "aborted"};

Json figuresJson(const std::vector<std::optional<double>>& values, std::span<const CampaignFigure> figures) {
  Json json = Json::object();
  for (std::size_t i = 0; i < figures.size(); ++i) {
    json[std::string(figures[i].name)] = i < values.size() && values[i] ? Json(*values[i]) : Json(nullptr);
  }
  return json;
}

std::vector<std::optional<double>> readFigures(const Json& json, std::span<const CampaignFigure> figures) {
  std::vector<std::optional<double>> values;
  for (const CampaignFigure& figure : figures) {
    const auto found = json.find(std::string(figure.name));
    const bool known = found != json.end() && found->is_number();
    values.push_back(known ? std::optional(found->get<double>()) : std::nullopt);
  }
  return values;
}

}  // namespace

std::span<const CampaignFigure> accuracyFigures() { return kAccuracy; }
std::span<const CampaignFigure> costFigures() { return kCosts; }

std::string describe(CampaignOutcome outcome) { return kOutcomes[static_cast<std::size_t>(outcome)]; }

std::vector<std::optional<double>> figuresOf(const Json& summary, std::span<const CampaignFigure> figures) {
  std::vector<std::optional<double>> values;
  for (const CampaignFigure& figure : figures) {
    const Json::json_pointer place{std::string(figure.place)};
    const bool known = summary.contains(place) && summary[place].is_number();
    values.push_back(known ? std::optional(summary[place].get<double>()) : std::nullopt);
  }
  return values;
}

Json toJson(const CampaignRow& row) {
  return {{"log", row.log},
          {"repeat", row.repeat},
          {"outcome", describe(row.outcome)},
          {"says", row.says},
          {"accuracy", figuresJson(row.accuracy, kAccuracy)},
          {"costs", figuresJson(row.costs, kCosts)},
          {"command", row.command},
          {"program", row.program}};
}

CampaignRow readCampaignRow(const std::string& file) {
  constexpr const char* kRemedy = "Delete it: the replay is then run again";
  std::ifstream stream(file);
  const Json json = Json::parse(stream, nullptr, false);
  try {
    CampaignRow row;
    row.log = json.at("log").get<std::string>();
    row.repeat = json.at("repeat").get<int>();
    const auto outcome = std::find(kOutcomes.begin(), kOutcomes.end(), json.at("outcome").get<std::string>());
    if (outcome == kOutcomes.end()) throw InputError(file, 0, "outcome", "is not known", kRemedy);
    row.outcome = static_cast<CampaignOutcome>(outcome - kOutcomes.begin());
    row.says = json.at("says").get<std::string>();
    row.accuracy = readFigures(json.at("accuracy"), kAccuracy);
    row.costs = readFigures(json.at("costs"), kCosts);
    row.command = json.at("command").get<std::vector<std::string>>();
    row.program = json.at("program").get<std::string>();
    return row;
  } catch (const Json::exception&) {
    throw InputError(file, 0, "", "is not a row of a campaign", kRemedy);
  }
}

std::string campaignRowFile(const std::string& out, const std::string& log, int repeat) {
  return std::filesystem::path(out) / "rows" / fmt::format("{}.{}.json", log, repeat);
}

}  // namespace swiftlet
