// What `swiftlet evaluate` leaves out: bad rows, which it names, and what lies outside --from and --until.

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"
#include "tests/firmware_host/said.hpp"

namespace swiftlet {
namespace {

using Catch::Matchers::Contains;

Stamp stampOf(int i) { return {1'000'000'000 + i * 10'000'000LL}; }

SE3 poseOf(int i) {
  return SE3(Eigen::Quaterniond::Identity(), {std::sin(0.1 * i), std::cos(0.2 * i), 0.01 * i});
}

std::string row(int i) { return formatTum(stampOf(i), poseOf(i)) + "\n"; }

/// 100 rows, of which `bad` takes the place of row 50.
void writePoses(const std::string& file, const std::string& bad) {
  std::ofstream out(file);
  for (int i = 0; i < 100; ++i) out << (i == 50 ? bad : row(i));
}

TEST_CASE("evaluate names the rows that it leaves out, of the estimate and of the truth") {
  const ScratchFolder folder("evaluate_rows");
  const std::string whole = folder.file("whole.tum");
  const std::string bad = folder.file("bad.tum");
  writePoses(whole, row(50));
  const auto [text, why] = GENERATE(table<std::string, std::string>({
      {"1.5 nan 0 0 0 0 0 1\n", "bad.tum:51: tx: `nan`"},
      {"1.5 1 2\n", "bad.tum:51: row: 3 fields where 8 are expected"},
      {row(49), "1 rows repeat a stamp, only the first of each is used; the first stamp is 1490000000 ns"},
  }));
  INFO(text);
  writePoses(bad, text);
  for (const bool of_truth : {false, true}) {
    const test::Said said =
        test::say({"evaluate", of_truth ? whole : bad, "--truth", of_truth ? bad : whole, "--json"});
    CHECK(said.code == kExitDone);
    CHECK_THAT(said.text, Contains("warning: ") && Contains(why));
    CHECK_THAT(said.text, Contains("bad.tum: 1 rows are left out of the comparison"));
  }
  writePoses(bad, row(10));  // earlier than the rows before it: put in order, and the second of its stamp
  CHECK_THAT(test::say({"evaluate", bad, "--truth", whole}).text,
             Contains("1 rows out of order, sorted by stamp; the first has 1100000000 ns") &&
                 Contains("1 rows are left out"));
  CHECK_THAT(test::say({"evaluate", whole, "--truth", whole}).text, !Contains("warning"));
}

TEST_CASE("NEES and revisits are those of the section alone") {
  const ScratchFolder folder("evaluate_section");
  const std::string truth = folder.file("truth.tum");
  const std::string run = folder.file("run");
  std::filesystem::create_directory(run);
  for (const std::string& file : {truth, run + "/odometry.tum", run + "/map.tum"}) writePoses(file, row(50));
  std::ofstream states(run + "/states.csv");
  states << statesHeader() << '\n';
  for (int i = 0; i < 100; i += 10) {
    KeyframeState keyframe;
    keyframe.state.stamp = stampOf(i);
    keyframe.state.T_world_body = poseOf(i);
    keyframe.state.covariance.setIdentity();
    states << statesRow(keyframe) << '\n';
  }
  states.close();
  const auto [option, value, keyframes, places] = GENERATE(table<std::string, std::string, int, int>(
      {{"--from", "0", 10, 2}, {"--from", "0.5", 5, 1}, {"--until", "0.2", 3, 1}}));
  INFO(option << " " << value);
  const test::Said said = test::say({"evaluate", run, "--truth", truth, "--json", option, value});
  REQUIRE(said.code == kExitDone);
  const auto json = nlohmann::json::parse(said.text);
  CHECK(json["consistency"]["states"] == keyframes - 1);  // the first one fixes the gauge
  CHECK(json["revisits"]["samples"] == places);
}

TEST_CASE("a log's truth that lacks rows is reported by replay and by evaluate") {
  const ScratchFolder folder("truth_rows");
  const std::string flight = folder.file("flight");
  const std::string out = folder.file("run");
  REQUIRE(test::run({"simulate", "--tracks", "--duration", "3", "--seed", "7", "--out", flight}) ==
          kExitDone);
  std::ofstream(flight + "/mav0/state_groundtruth_estimate0/data.csv", std::ios::app) << "1,2,3\n";
  const test::Said replay = test::say({"replay", flight, "--out", out});
  CHECK(replay.code == kExitDone);
  CHECK_THAT(replay.text, Contains("row: 3 fields where 8 are expected, row skipped"));
  CHECK_THAT(test::textOf(out + "/summary.json"), Contains("row: 3 fields where 8 are expected"));
  CHECK_THAT(test::say({"evaluate", out}).text, Contains("row: 3 fields where 8 are expected"));
}

}  // namespace
}  // namespace swiftlet
