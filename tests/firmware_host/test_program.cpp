// The program's contract: exit codes, messages, and the shape of summary.json.

#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/run_summary.hpp"
#include "tests/firmware_host/said.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::run;

TEST_CASE("exit codes: 0 done, 2 wrong use or bad input") {
  CHECK(run({"--help"}) == kExitDone);
  CHECK(run({"--version"}) == kExitDone);
  for (const char* command : {"simulate", "replay", "evaluate", "mesh", "settings"})
    CHECK(run({command, "--help"}) == kExitDone);
  CHECK(run({"settings"}) == kExitDone);
  CHECK(run({}) == kExitBadInput);
  CHECK(run({"fly-away"}) == kExitBadInput);
  CHECK(run({"replay"}) == kExitBadInput);
  CHECK(run({"replay", "no/such/log"}) == kExitBadInput);
  CHECK(run({"replay", "no/such/log", "--from", "-1"}) == kExitBadInput);
  CHECK(run({"settings", "--set", "smoother.horizont=3"}) == kExitBadInput);
  CHECK(run({"settings", "--settings", "no/such/file.yaml"}) == kExitBadInput);
  CHECK(run({"evaluate", "no/such/run"}) == kExitBadInput);
  CHECK(run({"evaluate", "x", "--align", "best"}) == kExitBadInput);
}

TEST_CASE("simulate overwrites simulated logs only") {
  const ScratchFolder folder("simulate_over");
  const std::string real = folder.file("real");
  std::filesystem::create_directories(real + "/mav0/imu0");
  const std::string samples = real + "/mav0/imu0/data.csv";
  std::ofstream(samples) << "of a flight";
  const std::string board = folder.file("board.yaml");
  std::ofstream(board) << "target_type: aprilgrid\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n";
  const std::vector<std::vector<std::string>> kinds = {
      {"--tracks"}, {"--depth-every", "0"}, {"--board", board}};
  for (const std::vector<std::string>& kind : kinds) {
    INFO(kind[0]);
    std::vector<std::string> words = {"simulate", "--duration", "0.3", "--out", real};
    words.insert(words.end(), kind.begin(), kind.end());
    CHECK(run(words) == kExitBadInput);
    CHECK(test::textOf(samples) == "of a flight");
    words[4] = folder.file(kind[0].substr(2));
    CHECK(run(words) == kExitDone);
    CHECK(run(words) == kExitDone);
  }
}

TEST_CASE("names and numbers that mean nothing are refused") {
  const ScratchFolder folder("bad_options");
  const std::string flight = folder.file("flight");
  const std::vector<std::string> simulate = {"simulate", "--tracks", "--duration", "0.3", "--out", flight};
  const std::vector<std::vector<std::string>> bad = {
      {"--stamp-offset", "nan"},         {"--stamp-offset", "1e30"}, {"--blackout", "nan", "1"},
      {"--camera-missing", "-1", "-5"},  {"--imu-gap", "inf", "1"},  {"--imu-gap", "1e30", "1"},
      {"--board", folder.file("b.yaml")}};
  for (const std::vector<std::string>& option : bad) {
    INFO(option[0] << " " << option[1]);
    std::vector<std::string> words = simulate;
    words.insert(words.end(), option.begin(), option.end());
    CHECK(run(words) == kExitBadInput);
    CHECK_FALSE(std::filesystem::exists(flight));
  }
  REQUIRE(run(simulate) == kExitDone);
  // More than a stamp can be moved by.
  CHECK(run({"replay", flight, "--from", "1e10", "--out", folder.file("run")}) == kExitBadInput);
  CHECK(run({"evaluate", flight, "--until", "1e30"}) == kExitBadInput);
  CHECK_THAT(test::say({"mesh", flight, "--max-gap", "1e30", "--out", folder.file("run")}).text,
             Catch::Contains("--max-gap: `1e30` is not a number above 0 to 1e9"));
  for (const char* command : {"replay", "mesh", "place", "fuse"}) {
    INFO(command);
    CHECK(run({command, flight, "--out", ""}) == kExitBadInput);
  }
  // A folder below a file.
  std::ofstream(folder.file("file")) << "x";
  const std::string log = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";
  CHECK(run({"place", log, "--out", folder.file("file/out")}) == kExitBadInput);
  for (const char* kind : {"--tracks", "--png"}) {
    const test::Said said =
        test::say({"simulate", kind, "--duration", "0.3", "--out", folder.file("file/out")});
    CHECK(said.code == kExitBadInput);
    CHECK_THAT(said.text, Catch::Contains(folder.file("file/out") + "/mav0/") &&
                              Catch::Contains(": Not a directory. Check that this path can be"));
  }
  // What hil lacks is named as a setting.
  const std::string port = "imu_link.device=" + folder.file("port");
  CHECK_THAT(test::say({"hil", log, "--set", port, "--out", folder.file("hil")}).text,
             Catch::Contains("error: settings: hil.output0: no output node for camera 0. Set the output"));
  CHECK_THAT(test::say({"hil", log, "--faults", folder.file("none.csv")}).text,
             Catch::Contains(folder.file("none.csv") + ": cannot be read: No such file or directory. Give"));
  CHECK_THAT(test::say({"hil", log, "--set", port, "--out", folder.file("file/out")}).text,
             Catch::Contains(folder.file("file/out") + ": Not a directory. Check that"));
  CHECK(run({"budget", flight, "--out", folder.file("file/out")}) == kExitBadInput);
  for (const char* option : {"--mono", "--map", "--record", "--loop-closure"}) {
    INFO(option);
    CHECK(run({"replay", flight, "--reproduce", option, "--out", folder.file("run")}) == kExitBadInput);
  }
}

TEST_CASE("a folder in the place of a file is refused, not taken for an empty file") {
  const ScratchFolder folder("folder_as_file");
  const std::string log = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";
  const std::string place = folder.file("place");
  std::filesystem::create_directories(place);
  const std::vector<std::vector<std::string>> calls = {
      {"settings", "--settings", place},
      {"hil", log, "--faults", place},
      {"vocabulary", "--read", place},
      {"replay", log, "--map", "--set", "map.confusion=" + place, "--out", folder.file("run")},
      {"replay", log, "--tracks", place, "--out", folder.file("run")},
      {"fuse", log, "--trajectory", place, "--out", folder.file("run")},
      {"simulate", "--motion", place, "--duration", "1", "--out", folder.file("flight")}};
  for (const std::vector<std::string>& call : calls) {
    const test::Said said = test::say(call);
    INFO(call[0] << ": " << said.text);
    CHECK(said.code == kExitBadInput);
    CHECK_THAT(said.text, Catch::Contains(place + ": cannot be read: Is a directory"));
  }
  CHECK_FALSE(std::filesystem::exists(folder.file("run")));
}

TEST_CASE("a summary that names no log by a text is one without a log") {
  const ScratchFolder folder("summary_log");
  std::ofstream(folder.file("odometry.tum")) << "1 0 0 0 0 0 0 1\n";
  std::ofstream(folder.file("summary.json")) << R"({"run": {"log": 5}})";
  const test::Said said = test::say({"evaluate", folder.path()});
  CHECK(said.code == kExitBadInput);
  CHECK_THAT(said.text, Catch::Contains("there is no truth to compare with"));
}

TEST_CASE("the file beside --out is another one") {
  const ScratchFolder folder("beside");
  const std::string board = folder.file("board.yaml");
  CHECK(run({"calibrate", "target", "--out", board}) == kExitBadInput);
  CHECK_FALSE(std::filesystem::exists(board));
  CHECK(run({"calibrate", "target", "--out", folder.file("board.pdf")}) == kExitDone);
  CHECK(test::textOf(board).starts_with("target_type"));
  CHECK(run({"calibrate", "imu-noise", folder.path(), "--out", folder.file("x.html")}) == kExitBadInput);
}

TEST_CASE("a check of a log that a signal ends is not passed") {
  const ScratchFolder folder("stopped_check");
  const std::string settings = folder.file("settings.yaml");
  REQUIRE(::mkfifo(settings.c_str(), 0600) == 0);
  const std::string log = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";
  const std::vector<std::vector<std::string>> checks = {{"doctor", log, "--settings", settings},
                                                        {"calibrate", "check", log, "--settings", settings}};
  for (const std::vector<std::string>& words : checks) {
    INFO(words[0]);
    // The settings are read after the handler of signals is there, and before the log.
    std::thread signal([&] {
      const std::ofstream pipe(settings);
      ::kill(::getpid(), SIGINT);
    });
    CHECK(run(words) == kExitFailed);
    signal.join();
  }
}

TEST_CASE("a replay is complete without a truth that can be read") {
  const ScratchFolder folder("bad_truth");
  const std::string flight = folder.file("flight");
  const std::string out = folder.file("run");
  REQUIRE(run({"simulate", "--tracks", "--duration", "3", "--seed", "7", "--out", flight}) == kExitDone);
  std::ofstream(flight + "/mav0/state_groundtruth_estimate0/data.csv") << "1,a\n2,b\n3,c\n4,d\n";
  CHECK(run({"replay", flight, "--out", out}) == kExitDone);
  const auto summary = test::summaryIn(out);
  CHECK_FALSE(summary.contains("accuracy"));
  CHECK(summary["warnings"].dump().find("state_groundtruth_estimate0/data.csv") != std::string::npos);
}

TEST_CASE("a replay that is refused leaves an earlier run whole, and no new folder") {
  const ScratchFolder folder("refused_replay");
  const std::string log = folder.file("log");
  REQUIRE(run({"simulate", "--tracks", "--duration", "0.3", "--out", log}) == kExitDone);
  const std::string earlier = folder.file("earlier");
  const std::string fresh = folder.file("fresh");
  const std::string taken = folder.file("taken");
  std::filesystem::create_directory(earlier);
  std::filesystem::create_directory(taken);
  std::ofstream(earlier + "/swiftlet_run.txt") << "replay\n";
  std::ofstream(earlier + "/odometry.tum") << "poses";
  const std::vector<std::vector<std::string>> refused = {
      {"--in-map", taken},
      {"--keep-map", taken},
      {"--loop-closure", "--set", "loop.vocabulary=" + folder.file("none")}};
  for (const std::vector<std::string>& options : refused) {
    INFO(options.back());
    for (const std::string& out : {earlier, fresh}) {
      std::vector<std::string> arguments = {"replay", log, "--out", out};
      arguments.insert(arguments.end(), options.begin(), options.end());
      CHECK(run(arguments) == kExitBadInput);
    }
    CHECK(test::textOf(earlier + "/odometry.tum") == "poses");
    CHECK_FALSE(std::filesystem::exists(fresh));
  }
}

TEST_CASE("evaluate compares two files; without common stamps it fails") {
  const ScratchFolder folder("evaluate");
  const std::string truth = folder.file("truth.tum");
  const std::string estimate = folder.file("estimate.tum");
  const std::string elsewhere = folder.file("elsewhere.tum");
  {
    LineFile a(truth);
    LineFile b(estimate);
    LineFile c(elsewhere);
    for (int i = 0; i < 100; ++i) {
      const double t = 0.01 * i;
      const SE3 pose(Eigen::Quaterniond::Identity(), {std::sin(t), std::cos(2 * t), t});
      a.write(formatTum({1'000'000'000 + i * 10'000'000LL}, pose));
      b.write(formatTum({1'000'000'000 + i * 10'000'000LL}, pose));
      c.write(formatTum({9'000'000'000 + i * 10'000'000LL}, pose));
    }
  }
  CHECK(run({"evaluate", estimate, "--truth", truth}) == kExitDone);
  CHECK(run({"evaluate", estimate, "--truth", truth, "--align", "yaw", "--from", "0.5", "--json"}) ==
        kExitDone);
  CHECK(run({"evaluate", elsewhere, "--truth", truth}) == kExitFailed);
  CHECK(run({"evaluate", estimate}) == kExitBadInput);  // nothing to compare with
  CHECK(run({"evaluate", folder.path()}) == kExitBadInput);
}

TEST_CASE("a report goes into the folder of its run") {
  const ScratchFolder folder("report_place");
  {
    LineFile odometry(folder.file("odometry.tum"));
    for (int i = 0; i < 100; ++i) {
      odometry.write(formatTum({1'000'000'000 + i * 10'000'000LL},
                               SE3(Eigen::Quaterniond::Identity(), {0.01 * i, 0, 0})));
    }
  }
  CHECK(run({"report", folder.path(), "--plain"}) == kExitDone);
  CHECK(std::filesystem::exists(folder.file("report.html")));
  // Never over a file of the run; a page may be made anew.
  const std::string odometry = folder.file("odometry.tum");
  const auto bytes = std::filesystem::file_size(odometry);
  CHECK(run({"report", folder.path(), "--plain", "--out", odometry}) == kExitBadInput);
  CHECK(std::filesystem::file_size(odometry) == bytes);
  CHECK(run({"report", folder.path(), "--plain"}) == kExitDone);
}

TEST_CASE("summary.json has what DESIGN's run folder promises") {
  RunStatistics statistics;
  statistics.first_image = Stamp{1'000'000'000};
  statistics.last_image = Stamp{21'000'000'000};
  statistics.first_pose = Stamp{1'500'000'000};
  statistics.frames = 400;
  statistics.poses = 390;
  statistics.frames_since_first_pose = 390;
  statistics.health = {{{1'000'000'000}, Health::kInitializing, 0}, {{2'000'000'000}, Health::kGood, 0}};
  statistics.events[EventKind::kImuGap] = {2, 1.5};
  for (int i = 0; i < 100; ++i) {
    addTime(statistics.times, StageId::kTrack, {2e-3, 2e-3}, false);
    if (i % 4 == 0) addTime(statistics.times, StageId::kTrack, {8e-3, 8e-3}, true);
  }
  RunFacts facts;
  facts.log = "log";
  facts.wall = 4;
  facts.cpu = 3;
  facts.peak_resident = 50 << 20;
  facts.memory = {{"program_at_start", 10 << 20}};
  facts.input["log"] = toJson(LogCounters{});
  const auto summary = summaryOf(facts, Settings{}, statistics);

  for (const char* key :
       {"version", "run", "settings", "health", "counters", "warnings", "timing", "cpu", "memory"}) {
    INFO(key);
    CHECK(summary.contains(key));
  }
  CHECK(summary["run"]["time_to_first_pose_s"] == 0.5);
  CHECK(summary["run"]["tracking_coverage"] == 390.0 / 400.0);
  CHECK(summary["settings"]["smoother.horizon"] == "full");
  CHECK(summary["health"][1]["health"] == "good");
  CHECK(summary["health"][1]["t_s"] == 1.0);
  CHECK(summary["counters"]["events"]["imu_gap"]["count"] == 2);
  CHECK(summary["cpu"]["flight_s"] == 20.0);
  CHECK(summary["cpu"]["real_time_factor"] == 5.0);
  const auto& track = summary["timing"]["track"];
  CHECK(track["frames"]["count"] == 100);
  CHECK(track["keyframes"]["count"] == 25);
  CHECK(track["frames"]["cpu"]["mean_ms"].get<double>() == Approx(2));
  CHECK(track["keyframes"]["wall"]["p99_ms"].get<double>() == Approx(8).epsilon(0.025));
  CHECK(track["keyframes"]["cpu"]["total_s"].get<double>() == Approx(0.2));
  CHECK_FALSE(summary["timing"].contains("smooth"));  // never ran
  CHECK_NOTHROW(summaryText(summary));
}

}  // namespace
}  // namespace swiftlet
