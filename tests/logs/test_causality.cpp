// Causality and determinism on real logs: a run cut after image k gives the first lines of the whole
// run's odometry.tum byte for byte, and a second run gives the same bytes in every file.
//
// SWIFTLET_CAUSALITY_LOG names a log of SWIFTLET_DATA to use instead of the repository's own seconds;
// SWIFTLET_CAUSALITY_CUTS the number of cuts.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/recorded/parse_number.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::textOf;

constexpr int kDefaultCuts = 6;

std::optional<std::string> chosenLog() {
  const char* name = std::getenv("SWIFTLET_CAUSALITY_LOG");
  return name != nullptr ? findLog(name) : shortLog();
}

int chosenCuts() {
  const char* text = std::getenv("SWIFTLET_CAUSALITY_CUTS");
  return text != nullptr ? std::atoi(text) : kDefaultCuts;
}

std::vector<std::string> linesOf(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

Stamp stampOf(const std::string& line) {
  Stamp stamp;
  REQUIRE(parseSeconds(line.substr(0, line.find(' ')), stamp));
  return stamp;
}

/// Keeps what two runs of one log must share.
std::string withoutTimes(nlohmann::ordered_json summary) {
  for (const char* key : {"timing", "cpu", "memory"}) summary.erase(key);
  return summary.dump();
}

void checkCuts(bool mono) {
  const auto log = chosenLog();
  if (!log) return;
  const ScratchFolder folder(mono ? "causality_mono" : "causality_stereo");
  ReplayRequest request;
  request.log = *log;
  request.mono = mono;
  request.imu_rate = true;
  request.out = folder.file("whole");
  const ReplayResult whole = runReplay(request, Settings{});
  REQUIRE(whole.has_pose);
  const auto lines = linesOf(folder.file("whole/odometry.tum"));
  REQUIRE(lines.size() > 20);

  request.out = folder.file("again");
  const ReplayResult again = runReplay(request, Settings{});
  for (const char* name : {"odometry.tum", "imu_rate.tum", "states.csv", "events.log", "settings.yaml"}) {
    INFO(name);
    CHECK(textOf(folder.file(std::string("whole/") + name)) ==
          textOf(folder.file(std::string("again/") + name)));
  }
  auto first = whole.summary;
  auto second = again.summary;
  CHECK(withoutTimes(first) == withoutTimes(second));

  Random random(mono ? 2 : 1);
  request.imu_rate = false;
  request.out = folder.file("cut");
  Settings fixed_lag;
  fixed_lag.full_smoothing = false;  // what comes after the run is not compared
  for (int i = 0; i < chosenCuts(); ++i) {
    const std::size_t k = random.below(static_cast<std::uint32_t>(lines.size()));
    request.last_stamp = stampOf(lines[k]);
    runReplay(request, fixed_lag);
    const auto cut = linesOf(folder.file("cut/odometry.tum"));
    INFO("cut after line " << k);
    REQUIRE(cut.size() == k + 1);
    for (std::size_t line = 0; line <= k; ++line) {
      if (cut[line] != lines[line]) FAIL("line " << line << ":\n" << cut[line] << "\n" << lines[line]);
    }
  }
}

TEST_CASE("stereo: cut runs are the beginning of the whole run; two runs are the same") { checkCuts(false); }

TEST_CASE("mono: cut runs are the beginning of the whole run; two runs are the same") { checkCuts(true); }

}  // namespace
}  // namespace swiftlet
