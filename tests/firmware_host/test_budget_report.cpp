// Budgets: verdicts at their edges, and the same verdicts in the table, in JSON and in JUnit XML.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/budget/budget_report.hpp"
#include "firmware_host/lab/budget/xml_text.hpp"
#include "tests/firmware_host/xml_reader.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::contains;

/// 1 to `count` milliseconds, each once.
LatencyHistogram ramp(int count) {
  LatencyHistogram histogram;
  for (int i = 1; i <= count; ++i) histogram.add(1e-3 * i);
  return histogram;
}

LatencyHistogram constant(double seconds, int count = 100) {
  LatencyHistogram histogram;
  for (int i = 0; i < count; ++i) histogram.add(seconds);
  return histogram;
}

BudgetVerdict verdictOf(const LatencyHistogram& measured, const BudgetLimits& allowed) {
  return BudgetRow{"row", TimeKind::kCpu, measured, allowed}.verdict();
}

TEST_CASE("a row is judged by each figure that has a budget") {
  const LatencyHistogram histogram = ramp(200);  // p50 100 ms, p99 198 ms, max 200 ms
  CHECK(verdictOf(histogram, {}) == BudgetVerdict::kShown);
  CHECK(verdictOf(histogram, {0.110, {}, {}, {}}) == BudgetVerdict::kMet);
  CHECK(verdictOf(histogram, {0.090, {}, {}, {}}) == BudgetVerdict::kMissed);
  CHECK(verdictOf(histogram, {{}, 0.210, {}, {}}) == BudgetVerdict::kMet);
  CHECK(verdictOf(histogram, {{}, 0.190, {}, {}}) == BudgetVerdict::kMissed);
  CHECK(verdictOf(histogram, {{}, {}, 0.200, {}}) == BudgetVerdict::kMet);  // equal is within
  CHECK(verdictOf(histogram, {{}, {}, 0.199, {}}) == BudgetVerdict::kMissed);
  CHECK(verdictOf(histogram, {{}, {}, {}, 2.1}) == BudgetVerdict::kMet);
  CHECK(verdictOf(histogram, {{}, {}, {}, 1.9}) == BudgetVerdict::kMissed);
  CHECK(verdictOf(histogram, {0.110, 0.210, 0.199, {}}) == BudgetVerdict::kMissed);
  CHECK(verdictOf({}, {0.110, {}, {}, {}}) == BudgetVerdict::kNotMeasured);
  CHECK(verdictOf({}, {}) == BudgetVerdict::kShown);
  const double nan = std::nan("");
  CHECK(verdictOf(histogram, {nan, {}, {}, {}}) == BudgetVerdict::kMissed);
}

TEST_CASE("the whole is met when every budget is, and something was judged") {
  BudgetReport report;
  CHECK(!report.met());
  report.add("shown", TimeKind::kWall, ramp(10));
  CHECK(!report.met());
  report.add("good", TimeKind::kCpu, ramp(10), {{}, {}, 0.010, {}});
  CHECK(report.met());
  BudgetReport with_miss = report;
  with_miss.add("bad", TimeKind::kCpu, ramp(10), {{}, {}, 0.009, {}});
  CHECK(!with_miss.met());
  BudgetReport with_gap = report;
  with_gap.add("gap", TimeKind::kCpu, {}, {{}, {}, 0.009, {}});
  CHECK(!with_gap.met());
}

TEST_CASE("durations up to a value are counted from the percentiles alone") {
  const LatencyHistogram histogram = ramp(200);
  CHECK(LatencyHistogram{}.countUpTo(1) == 0);
  CHECK(histogram.countUpTo(1e-6) == 0);
  CHECK(histogram.countUpTo(1) == 200);
  // To the bucket, of which there are a hundred to a decade.
  CHECK(std::abs(static_cast<double>(histogram.countUpTo(0.1)) - 100) <= 3);
  CHECK(std::abs(static_cast<double>(histogram.countUpTo(0.01)) - 10) <= 1);
}

TEST_CASE("the table shows both values, marks the miss and draws each row") {
  BudgetReport report;
  report.add("smooth", TimeKind::kCpu, constant(0.0025), {0.003, 0.002, {}, {}});
  LatencyHistogram tail = constant(1e-5, 1000);
  tail.add(0.05);
  report.add("bare timer loop", TimeKind::kWall, tail);
  const std::string text = report.text();
  INFO(text);
  CHECK(contains(text, "2.500 /      -"));  // the maximum is exact
  CHECK(contains(text, " /      3"));
  CHECK(contains(text, "!/      2"));
  CHECK(contains(text, "missed"));
  CHECK(contains(text, "shown"));
  CHECK(contains(text, "|1ms"));
  CHECK(contains(text, "budgets missed"));
  // Most of the timer loop stands at 10 us and the one at 50 ms is seen.
  const std::size_t row = text.rfind("bare timer loop");
  const std::string line = text.substr(row, text.find('\n', row) - row);
  CHECK(std::count(line.begin(), line.end(), '@') == 1);
  CHECK(std::count(line.begin(), line.end(), '.') == 1);
  CHECK(line.find('@') < line.find('.'));
  CHECK(!contains(text, "\t"));
}

TEST_CASE("JSON holds what was measured, what is allowed and all durations") {
  BudgetReport report;
  report.add("track", TimeKind::kCpu, ramp(50), {0.1, {}, {}, 3.0});
  report.add("bare", TimeKind::kWall, constant(1e-7, 7));
  report.add("gap", TimeKind::kCpu, {}, {0.1, {}, {}, {}});
  // As a reader gets it.
  const auto json = nlohmann::json::parse(report.json().dump());
  CHECK(json["met"] == false);
  REQUIRE(json["rows"].size() == 3);
  const auto& track = json["rows"][0];
  CHECK(track["name"] == "track");
  CHECK(track["kind"] == "cpu");
  CHECK(track["count"] == 50);
  CHECK(track["verdict"] == "met");
  CHECK(track["measured"]["max_ms"].get<double>() == Approx(50));
  CHECK(track["allowed"]["p50_ms"].get<double>() == Approx(100));
  CHECK(track["allowed"]["spread"].get<double>() == Approx(3));
  CHECK(!track["allowed"].contains("p99_ms"));
  CHECK(json["rows"][2]["verdict"] == "not measured");
  for (const auto& row : json["rows"]) {
    std::uint64_t sum = 0;
    for (const auto& bin : row["histogram"]) sum += bin["count"].get<std::uint64_t>();
    CHECK(sum == row["count"].get<std::uint64_t>());
  }
}

TEST_CASE("JUnit: one case a budgeted figure, failures where it was missed, and well-formed") {
  BudgetReport report;
  report.add("image <to> \"pose\" & more", TimeKind::kCpu, ramp(100), {0.060, 0.050, {}, {}});
  report.add("gap", TimeKind::kWall, {}, {{}, {}, 0.1, {}});
  report.add("shown", TimeKind::kWall, ramp(3));
  const std::string text = report.junit("log <a&b>\n\x01\xff");
  INFO(text);
  const XmlElement root = XmlReader::read(text);
  CHECK(root.name == "testsuites");
  CHECK(root.attributes.at("tests") == "3");
  CHECK(root.attributes.at("failures") == "2");
  const auto suites = root.all("testsuite");
  REQUIRE(suites.size() == 1);
  CHECK(suites[0]->attributes.at("name") == "log <a&b>\n??");
  CHECK(suites[0]->attributes.at("tests") == "3");
  const auto cases = root.all("testcase");
  REQUIRE(cases.size() == 3);
  CHECK(cases[0]->attributes.at("name") == "image <to> \"pose\" & more p50");
  CHECK(cases[0]->attributes.at("classname") == "budget.cpu");
  CHECK(cases[0]->children.empty());
  REQUIRE(cases[1]->children.size() == 1);
  CHECK(cases[1]->children[0].name == "failure");
  CHECK(contains(cases[1]->children[0].attributes.at("message"), "50 ms allowed"));
  CHECK(cases[2]->children[0].attributes.at("type") == "not measured");
  REQUIRE(root.all("system-out").size() == 1);
  CHECK(root.all("system-out")[0]->text == report.text());
}

TEST_CASE("the reader refuses what is not well-formed") {
  for (const char* broken : {"<a>", "<a></b>", "<a x=\"1\" x=\"2\"/>", "<a>&</a>", "<a b=\"<\"/>",
                             "<a>&x;</a>", "<a b=\"1\"c=\"2\"/>", "<a/><b/>", "<a>\x02</a>"}) {
    INFO(broken);
    CHECK_THROWS(XmlReader::read(broken));
  }
}

TEST_CASE("text is made fit for XML") {
  CHECK(xmlText("a<b>&\"c'") == "a&lt;b&gt;&amp;&quot;c'");
  CHECK(xmlText("a\nb\tc\r") == "a&#10;b&#9;c&#13;");
  CHECK(xmlText("a\nb\t", XmlPlace::kContent) == "a\nb\t");
  CHECK(xmlText(std::string_view("\0\x1b[1m", 5)) == "??[1m");
  CHECK(xmlText("\xc3\xa9 \xe2\x82\xac \xf0\x9f\x9a\x81") == "\xc3\xa9 \xe2\x82\xac \xf0\x9f\x9a\x81");
  // Cut, stray, longer than needed, a surrogate, beyond Unicode, no character.
  CHECK(xmlText("\xc3") == "?");
  CHECK(xmlText("\x80z") == "?z");
  CHECK(xmlText("\xc0\xaf") == "??");
  CHECK(xmlText("\xed\xa0\x80") == "???");
  CHECK(xmlText("\xf4\x90\x80\x80") == "????");
  CHECK(xmlText("\xef\xbf\xbf") == "???");
}

TEST_CASE("a run is judged against the settings' budgets, CPU and wall apart") {
  BudgetMeasurements run;
  run.propagate_cpu = constant(3e-6);
  run.track_cpu = constant(3e-3);
  run.smooth_cpu = constant(2e-3);
  run.image_to_pose_cpu = constant(5e-3);
  run.image_to_pose_cpu_frames = constant(4.5e-3);
  run.image_to_pose_cpu_keyframes = constant(8e-3);
  run.sample_to_state_cpu = constant(5e-6);
  run.image_to_pose_wall = constant(9e-3);
  run.sample_to_state_wall = constant(3e-5);
  const BudgetsGroup budgets;
  CHECK(evaluateBudgets(run, budgets).met());

  const auto missedWith = [&](auto change) {
    BudgetMeasurements worse = run;
    change(worse);
    const BudgetReport report = evaluateBudgets(worse, budgets);
    int missed = 0;
    for (const BudgetRow& row : report.rows()) missed += row.verdict() == BudgetVerdict::kMissed ? 1 : 0;
    CHECK(report.met() == (missed == 0));
    return missed;
  };
  CHECK(missedWith([](BudgetMeasurements& m) { m.image_to_pose_cpu = constant(6.2e-3); }) == 1);
  CHECK(missedWith([](BudgetMeasurements& m) { m.image_to_pose_wall = constant(0.06); }) == 1);
  CHECK(missedWith([](BudgetMeasurements& m) { m.sample_to_state_cpu = constant(6e-5); }) == 1);
  CHECK(missedWith([](BudgetMeasurements& m) {
          for (int i = 0; i < 5; ++i) m.image_to_pose_cpu_frames.add(0.012);
        }) == 1);
  // What only the wall clock saw is no miss of a CPU budget, nor the other way round.
  CHECK(missedWith([](BudgetMeasurements& m) { m.track_wall = constant(0.5); }) == 0);
  CHECK(missedWith([](BudgetMeasurements& m) { m.bare_timer_wall = constant(0.5); }) == 0);

  // The defaults are the ones that were promised.
  CHECK(budgets.image_to_pose_p50_ms == 6);
  CHECK(budgets.image_to_pose_p99_ms == 15);
  CHECK(budgets.image_to_pose_spread == 2.5);
  CHECK(budgets.sample_to_state_p99_ms == 0.05);
  CHECK(budgets.image_to_pose_wall_p99_ms == 50);
  CHECK(budgets.image_to_pose_wall_max_ms == 100);
}

}  // namespace
}  // namespace swiftlet
