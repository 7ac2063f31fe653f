// The list of a campaign's logs, its rows, its table and the comparison of two; programs run beside this one.

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/campaign/campaign_report.hpp"
#include "firmware_host/lab/campaign/campaign_run.hpp"
#include "firmware_host/lab/campaign/child_process.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using test::textOf;

using Catch::Matchers::Contains;

class Logs {
 public:
  Logs() : scratch_("campaign") {
    for (const char* log : {"a", "flights/x", "flights/y"}) fs::create_directories(folder() / log);
    writeWholeFile(folder() / "flights" / "z.bag", "");
  }
  [[nodiscard]] fs::path folder() const { return scratch_.path(); }
  [[nodiscard]] Campaign parse(const std::string& text) const {
    return parseCampaign(folder() / "logs.yaml", text);
  }
  [[nodiscard]] std::string error(const std::string& text) const {
    return test::messageOf([&] { (void)parse(text); });
  }

 private:
  ScratchFolder scratch_;
};

CampaignRow row(const std::string& log, int repeat, std::optional<double> ate) {
  CampaignRow row;
  row.log = log;
  row.repeat = repeat;
  row.outcome = ate ? CampaignOutcome::kDone : CampaignOutcome::kFailed;
  row.says = ate ? "" : "no pose";
  row.accuracy.assign(accuracyFigures().size(), std::nullopt);
  row.accuracy.front() = ate;
  row.costs.assign(costFigures().size(), 1.5);
  row.command = {"replay", log};
  row.program = "swiftlet";
  return row;
}

Campaign campaignOf(const std::vector<std::string>& logs, int repeats) {
  Campaign campaign;
  campaign.repeats = repeats;
  for (const std::string& log : logs) campaign.logs.push_back({log, log, "", {}, {}});
  return campaign;
}

/// One repeat of each log: `errors` in the order a, b, c, ...
CampaignTable tableOf(const std::vector<std::optional<double>>& errors) {
  std::vector<std::string> logs;
  std::vector<CampaignRow> rows;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    logs.emplace_back(1, static_cast<char>('a' + i));
    rows.push_back(row(logs.back(), 0, errors[i]));
  }
  return campaignTable(campaignOf(logs, 1), rows);
}

TEST_CASE("a campaign's file: paths, patterns, simulated flights, options of all and of one") {
  const Logs logs;
  const Campaign campaign = logs.parse(
      "repeats: 3\noptions: [--mono]\nlogs:\n  - a/\n  - path: flights/*\n    options: [--until, 60]\n"
      "    truth: mocap.tum\n  - {name: room, simulate: [--duration, 20], seeds: [7, 8]}\n");
  CHECK(campaign.repeats == 3);
  CHECK(campaign.folder == logs.folder());
  REQUIRE(campaign.logs.size() == 6);
  CHECK(campaign.logs[0].name == "a");
  CHECK(campaign.logs[0].options == std::vector<std::string>{"--mono"});
  CHECK(campaign.logs[1].name == "x");
  CHECK(campaign.logs[3].name == "z");
  CHECK(campaign.logs[3].path == logs.folder() / "flights" / "z.bag");
  CHECK(campaign.logs[3].options == std::vector<std::string>{"--mono", "--until", "60"});
  CHECK(campaign.logs[3].truth == logs.folder() / "mocap.tum");
  CHECK(campaign.logs[5].name == "room_8");
  CHECK(campaign.logs[5].path.empty());
  CHECK(campaign.logs[5].simulate == std::vector<std::string>{"--duration", "20", "--seed", "8"});
}

TEST_CASE("a mistake in a campaign's file is named with its line and field") {
  const Logs logs;
  const std::string file = (logs.folder() / "logs.yaml").string();
  const auto [text, said] = GENERATE(table<std::string, std::string>({
      {"repeats: 0\nlogs: [a]\n", ":1: repeats: 0 is not a whole number from 1 to"},
      {"repeats: 191\nlogs: [a]\n", ":1: repeats: 191 is not a whole number from 1 to 190"},
      {"logs: [a]\nrepeat: 2\n", ":2: repeat: is not known. Known here: repeats, options, logs"},
      {"repeats: 2\n", ":1: logs: missing"},
      {"logs: a\n", ":1: logs: is not a list"},
      {"logs: []\n", ":1: logs: is empty"},
      {"logs:\n  - a\n  - nowhere\n", ":3: logs[1]: `nowhere` does not exist"},
      {"logs:\n  - flights/q*\n", ":2: logs[0]: `flights/q*` matches nothing"},
      {"logs:\n  - a\n  - {path: a}\n", ":3: logs[1]: a second log named a: line 2 has one"},
      {"logs:\n  - {path: flights/*, name: n}\n", ":2: logs[0].name: one name for 3 logs"},
      {"logs:\n  - {path: a, name: b/c}\n", ":2: logs[0].name: `b/c` cannot name files"},
      {"logs:\n  - {path: a, seeds: [1, 2]}\n", ":2: logs[0].seeds: is not known"},
      {"logs:\n  - {simulate: []}\n", ":2: logs[0].name: missing. Name the simulated flights"},
      {"logs:\n  - {name: n, simulate: [], seeds: [5, 2]}\n",
       ":2: logs[0].seeds[1]: 2 is not a whole number"},
      {"logs:\n  - {name: n, simulate: [], seeds: 5}\n", ":2: logs[0].seeds: expected a list"},
      {"options: --mono\nlogs: [a]\n", ":1: options: is not a list"},
  }));
  CAPTURE(text);
  CHECK_THAT(logs.error(text), Catch::Matchers::StartsWith(file + said));
}

TEST_CASE("a row survives its file, and a damaged one is named") {
  const Logs logs;
  fs::create_directories(logs.folder() / "rows");
  const std::string file = campaignRowFile(logs.folder(), "a", 2);
  CampaignRow before = row("a", 2, 0.0123456789012345);
  before.accuracy[3] = 1e-17;
  writeWholeFile(file, toJson(before).dump());
  const CampaignRow after = readCampaignRow(file);
  CHECK(toJson(after) == toJson(before));
  CHECK(after.accuracy == before.accuracy);
  for (const char* text : {"", "{}", "[1]", R"({"log": "a", "repeat": "x"})"}) {
    writeWholeFile(file, text);
    CHECK_THROWS_WITH(readCampaignRow(file), Contains(file) && Contains("is not a row of a campaign"));
  }
}

TEST_CASE("a log's line has the spread over its repeats, what failed and what is missing") {
  const std::vector<CampaignRow> rows = {row("a", 0, 0.010), row("a", 1, 0.014), row("a", 2, std::nullopt),
                                         row("b", 0, 0.002)};
  const CampaignTable table = campaignTable(campaignOf({"b", "a"}, 4), rows);
  REQUIRE(table.lines.size() == 2);
  CHECK(table.lines[0].log == "b");
  CHECK(table.lines[0].missing() == 3);
  const CampaignLine& a = table.lines[1];
  CHECK(a.done == 2);
  CHECK(a.failed == 1);
  CHECK(a.missing() == 1);
  CHECK(a.says == std::vector<std::string>{"no pose"});
  CHECK(a.accuracy.front().count == 2);
  CHECK(a.accuracy.front().mean == Approx(0.012));
  CHECK(a.accuracy.front().min == 0.010);
  CHECK(a.accuracy.front().max == 0.014);
  CHECK(table.accuracy.front().mean == Approx(0.007));
  CHECK_FALSE(table.isWhole());
}

TEST_CASE("figures are those of done runs: a campaign that fails on every log is worse") {
  const CampaignTable before = tableOf({0.010, 0.020, 0.030});
  std::vector<CampaignRow> failed;
  for (const char* log : {"a", "b", "c"}) {
    failed.push_back(row(log, 0, 0.001));
    failed.back().outcome = CampaignOutcome::kFailed;
  }
  const CampaignTable now = campaignTable(campaignOf({"a", "b", "c"}, 1), failed);
  CHECK(now.accuracy.front().count == 0);
  const CampaignComparison comparison = compareCampaigns(before, now);
  CHECK(comparison.lost == std::vector<std::string>{"a", "b", "c"});
  CHECK(comparison.verdict() == "worse");
  const Logs logs;
  writeCampaign({now, failed, comparison}, logs.folder());
  CHECK_THAT(textOf(logs.folder() / "table.md"),
             Contains("Beside the earlier campaign: worse; no log has an ATE in both\n"));
  const auto json = nlohmann::json::parse(textOf(logs.folder() / "table.json"))["comparison"];
  CHECK(json["mean_ratio"].is_null());
  CHECK(json["interval_95"].is_null());
}

TEST_CASE("two campaigns: better, worse, or no difference shown") {
  const CampaignTable before = tableOf({0.010, 0.020, 0.030, 0.040, 0.050});
  const CampaignComparison same = compareCampaigns(before, before);
  CHECK(same.mean_ratio == 1);
  CHECK(same.verdict() == "no difference shown");
  const CampaignComparison better = compareCampaigns(before, tableOf({0.009, 0.017, 0.028, 0.035, 0.041}));
  CHECK(better.mean_ratio == Approx(std::pow(0.9 * 0.85 * (28.0 / 30) * 0.875 * 0.82, 0.2)));
  CHECK(better.smaller == 5);
  CHECK(better.low < better.mean_ratio);
  CHECK(better.high > better.mean_ratio);
  CHECK(better.verdict() == "better");
  CHECK(compareCampaigns(tableOf({0.009, 0.017, 0.028, 0.035, 0.041}), before).verdict() == "worse");
  CHECK(compareCampaigns(before, tableOf({0.005, 0.030, 0.031, 0.036, 0.055})).verdict() ==
        "no difference shown");
  // Two logs show nothing, however much they differ.
  CHECK(compareCampaigns(tableOf({0.010, 0.020}), tableOf({0.001, 0.002})).verdict() ==
        "no difference shown");
}

TEST_CASE("a log that has no figure any more makes a campaign worse") {
  const CampaignTable before = tableOf({0.010, 0.020, 0.030, 0.040});
  const CampaignTable now = tableOf({0.005, 0.010, 0.015, std::nullopt});
  const CampaignComparison comparison = compareCampaigns(before, now);
  CHECK(comparison.lost == std::vector<std::string>{"d"});
  CHECK(comparison.mean_ratio == Approx(0.5));
  CHECK(comparison.verdict() == "worse");
  // Logs that were won do not outweigh one that was lost.
  CHECK(compareCampaigns(tableOf({0.010, 0.020, 0.030, 0.040, std::nullopt}),
                         tableOf({0.010, 0.020, std::nullopt, std::nullopt, 0.010}))
            .verdict() == "worse");
  // Those that were won alone do not show that the version is better: the interval decides.
  const CampaignComparison won = compareCampaigns(now, before);
  CHECK(won.won == std::vector<std::string>{"d"});
  CHECK(won.verdict() == "worse");
  CHECK(compareCampaigns(now, tableOf({0.005, 0.010, 0.015, 0.040})).verdict() == "no difference shown");
}

TEST_CASE("a difference within the spread of the repeats is said to be") {
  const Campaign campaign = campaignOf({"a", "b"}, 3);
  std::vector<CampaignRow> before, now;
  for (int repeat = 0; repeat < 3; ++repeat) {
    before.push_back(row("a", repeat, 0.010 + 0.002 * repeat));
    now.push_back(row("a", repeat, 0.011 + 0.002 * repeat));
    before.push_back(row("b", repeat, 0.010 + 0.0001 * repeat));
    now.push_back(row("b", repeat, 0.011 + 0.0001 * repeat));
  }
  const CampaignComparison comparison =
      compareCampaigns(campaignTable(campaign, before), campaignTable(campaign, now));
  REQUIRE(comparison.logs.size() == 2);
  CHECK(comparison.logs[0].beyond_spread == false);
  CHECK(comparison.logs[1].beyond_spread == true);
}

TEST_CASE("the table's files: a cell for each figure, text that stays one cell") {
  const Logs logs;
  CampaignReport report;
  report.rows = {row("a", 0, 0.01), row("b", 0, std::nullopt)};
  report.rows[1].says = "a, \"b\" | c";
  report.table = campaignTable(campaignOf({"a", "b"}, 1), report.rows);
  report.comparison = compareCampaigns(tableOf({0.02, 0.02}), report.table);
  writeCampaign(report, logs.folder());
  const std::string runs = textOf(logs.folder() / "runs.csv");
  CHECK_THAT(runs, Contains("\na,0,done,,0.01,,,,,,,\n") && Contains("b,0,failed,\"a, \"\"b\"\" | c\",,"));
  const std::string lines = textOf(logs.folder() / "table.csv");
  const auto commas = [](const std::string& line) { return std::count(line.begin(), line.end(), ','); };
  const std::string head = lines.substr(0, lines.find('\n'));
  CHECK(commas(head) == 4 + 4 * static_cast<long>(accuracyFigures().size()));
  CHECK(commas(lines) == 3 * commas(head));
  CHECK_THAT(textOf(logs.folder() / "table.md"), Contains("| b | a, \"b\" \\| c |"));
  const auto json = nlohmann::json::parse(textOf(logs.folder() / "table.json"));
  CHECK(json["logs"][0]["accuracy"]["ate_m"]["mean"] == 0.01);
  CHECK(json["comparison"]["lost"][0] == "b");
  CHECK_THAT(textOf(logs.folder() / "table.html"), Contains("<svg") && Contains("a, &quot;b&quot; | c"));
}

TEST_CASE("rows of other options or of another program are refused") {
  const Logs logs;
  fs::create_directories(logs.folder() / "rows");
  Campaign campaign = campaignOf({"a"}, 1);
  const CampaignRequest request{logs.folder(), "", "swiftlet", 1};
  writeWholeFile(campaignRowFile(logs.folder(), "a", 0), toJson(row("a", 0, 0.1)).dump());
  CHECK(campaignRows(campaign, request).size() == 1);
  campaign.logs[0].options = {"--mono"};
  CHECK_THROWS_WITH(campaignRows(campaign, request), Contains("was run with other options"));
  campaign.logs[0].options = {};
  CHECK_THROWS_WITH(campaignRows(campaign, {logs.folder(), "", "swiftlet 2", 1}),
                    Contains("was run by swiftlet, not by swiftlet 2"));
}

/// In place of swiftlet: the log's name says how a run of it ends. Runs are listed in `calls`.
std::string standIn(const fs::path& folder) {
  const fs::path program = folder / "swiftlet";
  writeWholeFile(program, R"(#!/bin/sh
if [ "$1" = --version ]; then echo 'swiftlet 1'; exit 0; fi
echo "$*" | sed "s,$(pwd)/,,g" >>calls
case $2 in *crash*) kill -SEGV $$ ;; *absent*) echo 'error: no such log'; exit 2 ;; esac
mkdir -p "$4"
features=120
case $2 in *most*) features=397 ;; esac
printf 'frontend:\n  max_features: %d\n' $features >"$4/settings.yaml"
: >"$4/odometry.tum"
finished=true
case $2 in *stopped*) finished=false ;; esac
echo "{\"run\": {\"finished\": $finished, \"first_image_ns\": 0, \"first_pose_ns\": null},
  \"verdict\": {\"share_good\": 0.5},
  \"accuracy\": {\"odometry\": {\"all\": {\"se3\": {\"ate_m\": {\"rmse\": 0.25}}}}}}" >"$4/summary.json"
case $2 in *good*) exit 0 ;; esac
echo 'error: health was good too seldom'
exit 1
)");
  fs::permissions(program, fs::perms::owner_all);
  return program;
}

std::size_t callsOf(const fs::path& folder, const std::string& log) {
  const std::string calls = textOf(folder / "calls");
  std::size_t count = 0;
  for (std::size_t at = 0; (at = calls.find("replay " + log + " ", at)) != std::string::npos; ++at) ++count;
  return count;
}

TEST_CASE("a campaign repeats what was aborted, and nothing else") {
  const Logs logs;
  const fs::path folder = logs.folder();
  const std::vector<std::string> names = {"good", "poor", "stopped", "crash", "absent"};
  Campaign campaign = campaignOf(names, 3);
  campaign.folder = folder;
  CampaignRequest request{folder / "out", standIn(folder), "", 2};
  request.version = programVersion(request.program);
  CHECK_THAT(request.version, Catch::Matchers::StartsWith("swiftlet 1 crc32 "));
  const std::atomic<bool> never{false};
  std::vector<std::string> ended;
  const auto note = [&ended](const CampaignLog& log) { ended.push_back(log.name); };
  CHECK(runCampaign(campaign, request, never, note));
  CHECK(ended.size() == names.size());
  CampaignTable table = campaignTable(campaign, campaignRows(campaign, request));
  CHECK(table.lines[0].done == 3);
  CHECK(table.lines[0].accuracy.front().mean == 0.25);
  CHECK(table.lines[1].failed == 3);
  CHECK(table.lines[1].accuracy.front().count == 0);
  CHECK(table.lines[1].says == std::vector<std::string>{"health was good too seldom"});
  for (const std::size_t aborted : {2U, 3U, 4U}) CHECK(table.lines[aborted].aborted == 3);
  CHECK_THAT(table.lines[3].says.front(), Contains("ended by signal 11"));
  CHECK(table.lines[4].says == std::vector<std::string>{"no such log", "repeat 0 left no settings"});
  const std::string calls = textOf(folder / "calls");
  CHECK_THAT(calls, Contains("replay good --out out/runs/good.0\n") &&
                        Contains("good.1 --set frontend.max_features=118\n") &&
                        Contains("good.2 --set frontend.max_features=122\n"));

  CHECK(runCampaign(campaign, request, never, note));
  CHECK(callsOf(folder, "good") == 3);
  CHECK(callsOf(folder, "poor") == 3);
  CHECK(callsOf(folder, "stopped") == 6);
  CHECK(callsOf(folder, "crash") == 2);

  // Another program, or this one built anew, does not go on where the first stopped.
  std::ofstream(request.program, std::ios::app) << "# changed\n";
  request.version = programVersion(request.program);
  CHECK_THROWS_WITH(campaignRows(campaign, request), Contains("was run by swiftlet 1 crc32"));
  CHECK_THROWS_WITH(programVersion("/nowhere/swiftlet"), Contains("does not run: No such file"));
}

TEST_CASE("a run without a pose has failed, also where the list names the truth") {
  const Logs logs;
  Campaign campaign = campaignOf({"poor"}, 1);
  campaign.folder = logs.folder();
  campaign.logs.front().truth = logs.folder() / "truth.tum";
  writeWholeFile(campaign.logs.front().truth, "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n");
  CampaignRequest request{logs.folder() / "out", standIn(logs.folder()), "swiftlet", 1};
  const std::atomic<bool> never{false};
  for (int i = 0; i < 2; ++i) CHECK(runCampaignJob(campaign, request, campaign.logs.front(), never));
  CHECK(callsOf(logs.folder(), "poor") == 1);
  const CampaignTable table = campaignTable(campaign, campaignRows(campaign, request));
  CHECK(table.lines.front().failed == 1);
  CHECK(table.lines.front().says == std::vector<std::string>{"health was good too seldom"});
}

TEST_CASE("repeats keep max_features in its range") {
  const Logs logs;
  Campaign campaign = campaignOf({"good_most"}, 6);
  campaign.folder = logs.folder();
  CampaignRequest request{logs.folder() / "out", standIn(logs.folder()), "swiftlet", 1};
  CHECK(runCampaignJob(campaign, request, campaign.logs.front(), {}));
  const std::string calls = textOf(logs.folder() / "calls");
  const std::vector<int> features = {395, 399, 393, 391, 389};
  for (std::size_t i = 0; i < features.size(); ++i) {
    CHECK_THAT(calls, Contains("good_most." + std::to_string(i + 1) +
                               " --set frontend.max_features=" + std::to_string(features[i])));
  }
}

TEST_CASE("a run that is refused for an option shows the option, not the hint at --help") {
  const Logs logs;
  const fs::path program = logs.folder() / "refusing";
  writeWholeFile(program,
                 "#!/bin/sh\nif [ \"$1\" = --version ]; then echo 'swiftlet 1'; exit 0; fi\n"
                 "echo 'The following argument was not expected: --bad'\n"
                 "echo 'Run with --help for more information.'\nexit 2\n");
  fs::permissions(program, fs::perms::owner_all);
  Campaign campaign = campaignOf({"a"}, 1);
  campaign.folder = logs.folder();
  CampaignRequest request{logs.folder() / "out", program, "", 1};
  request.version = programVersion(program);
  CHECK(runCampaignJob(campaign, request, campaign.logs.front(), {}));
  const std::vector<CampaignRow> rows = campaignRows(campaign, request);
  REQUIRE(rows.size() == 1);
  CHECK(rows[0].outcome == CampaignOutcome::kAborted);
  CHECK(rows[0].says == "The following argument was not expected: --bad");
}

TEST_CASE("a program that cannot tell its version says why") {
  const Logs logs;
  const fs::path program = logs.folder() / "broken";
  writeWholeFile(program, "#!/bin/sh\necho 'error: libfoo.so is missing'\nexit 2\n");
  fs::permissions(program, fs::perms::owner_all);
  CHECK_THROWS_WITH(programVersion(program), Contains("does not run: libfoo.so is missing"));
}

TEST_CASE("a program beside this one: its end, its output, its stop") {
  const Logs logs;
  const std::string output = logs.folder() / "said.txt";
  const std::atomic<bool> never{false};
  const ChildEnd done = runChild({"sh", "-c", "pwd; echo wrong >&2; exit 3"}, logs.folder(), output, never);
  CHECK(done.exit_code == 3);
  CHECK(textOf(output) == logs.folder().string() + "\nwrong\n");
  const ChildEnd killed = runChild({"sh", "-c", "kill -ABRT $$"}, "/", output, never);
  CHECK(killed.exit_code == -1);
  CHECK(killed.signal == SIGABRT);
  CHECK(runChild({"/nowhere/swiftlet"}, "/", output, never).errno_of_start == ENOENT);
  CHECK_THROWS_WITH(runChild({"true"}, "/", "/nowhere/said.txt", never), Contains("/nowhere/said.txt"));
  std::atomic<bool> stop{false};
  std::thread stopper([&stop] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stop = true;
  });
  const ChildEnd stopped = runChild({"sleep", "1000"}, "/", output, stop);
  stopper.join();
  CHECK(stopped.stopped);
  CHECK(stopped.signal == SIGTERM);
}

}  // namespace
}  // namespace swiftlet
