// What loops buy on flights that revisit (toolchain/revisit_flights.sh), as rows of
// docs/experiments/accuracy_loops.md.
//
//   loop_table FLIGHT...               causal odometry, full smoothing, full smoothing with loops
//   loop_table --thresholds FLIGHT...  the pose graph alone over thresholds of similarity, with the selection
//   and
//                                      without it
//   --out FOLDER keeps the run folders

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

// The paper's thresholds (Rosinol et al., ICRA 2020, table III).
constexpr std::array<double, 5> kThresholds{10, 1, 0.1, 0.01, 0.001};

struct Errors {
  double odometry = 0;  ///< m, ATE at the keyframes
  double map = 0;
};

Json replay(const std::string& flight, const std::string& out, bool loops, const Settings& settings) {
  ReplayRequest request;
  request.accuracy = runAccuracyJson;
  request.log = flight;
  request.out = out;
  request.loop_closure = loops;
  Settings used = settings;
  used.mesh.enabled = false;
  fmt::print(stderr, "{} ...\n", out);
  return runReplay(request, used).summary;
}

Errors errorsOf(const Json& summary) {
  const Json& all = summary.at("accuracy").at("map_beside_odometry").at("all");
  return {all.at("odometry_ate_rmse_m").get<double>(), all.at("map_ate_rmse_m").get<double>()};
}

std::uint64_t count(const Json& json, const char* name) {
  return json.contains(name) ? json[name].get<std::uint64_t>() : 0;
}

void printGain(const std::string& flight, const std::filesystem::path& out) {
  const std::string name = std::filesystem::path(flight).filename();
  const Json without = replay(flight, out / (name + "_full"), false, Settings{});
  const Json with = replay(flight, out / (name + "_loops"), true, Settings{});
  const Errors full = errorsOf(without);
  const Errors loops = errorsOf(with);
  const Json& accuracy = with["accuracy"];
  const Json found = accuracy.contains("loops") ? accuracy["loops"] : Json::object();
  const Json revisits = accuracy.contains("revisits") ? accuracy["revisits"] : Json::object();
  fmt::print("| {} | {:.4f} | {:.4f} | {:.4f} | {:.2f} | {} of {} | {} of {} | {} of {} | {:.0f} |\n", name,
             full.odometry, full.map, loops.map, loops.map / loops.odometry, count(found, "selected_right"),
             count(found, "selected"), count(found, "verified_right"), count(found, "verified"),
             count(revisits, "revisiting"), count(revisits, "samples"),
             with["timing"]["loop"]["all"]["cpu"]["p99_ms"].get<double>());
  std::fflush(stdout);
}

void printThresholds(const std::string& flight, const std::filesystem::path& out) {
  const std::string name = std::filesystem::path(flight).filename();
  for (const bool consistency : {true, false}) {
    std::string row = fmt::format("| {}, {} selection |", name, consistency ? "with" : "without");
    for (const double threshold : kThresholds) {
      Settings settings;
      // map.tum is then the pose graph's own: no smoothing hides what selection is worth.
      settings.full_smoothing = false;
      settings.loop_stage.min_similarity = threshold;
      settings.loop_stage.consistency = consistency;
      const std::string run = fmt::format("{}_{}_{:g}", name, consistency ? "with" : "without", threshold);
      const Json summary = replay(flight, out / run, true, settings);
      row += fmt::format(" {:.4f} ({}) |", errorsOf(summary).map,
                         count(summary["counters"]["loop"], "selected"));
    }
    fmt::print("{}\n", row);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  CLI::App app("What loops buy on flights that revisit");
  std::vector<std::string> flights;
  std::string out;
  bool thresholds = false;
  app.add_option("FLIGHT", flights, "Folders that toolchain/revisit_flights.sh wrote")->required();
  app.add_option("--out", out, "Keep the run folders here");
  app.add_flag("--thresholds", thresholds, "Thresholds of similarity, with selection and without");
  CLI11_PARSE(app, argc, argv);
  const std::filesystem::path folder =
      out.empty() ? std::filesystem::temp_directory_path() / fmt::format("swiftlet_loops_{}", getpid())
                  : std::filesystem::path(out);
  try {
    for (const std::string& flight : flights) {
      thresholds ? swiftlet::printThresholds(flight, folder) : swiftlet::printGain(flight, folder);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
  std::error_code ignored;
  if (out.empty()) std::filesystem::remove_all(folder, ignored);
  return 0;
}
