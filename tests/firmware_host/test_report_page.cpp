// The report of a run folder: what a good one shows, what a missing or damaged file takes away and what it
// says.

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/lab/report/plain_page.hpp"
#include "firmware_host/lab/report/run_plots.hpp"
#include "firmware_host/lab/report/scene.hpp"
#include "firmware_host/lab/report/table.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::int64_t kFirst = 1'403'636'579'763'555'584;
constexpr int kFrames = 200;
constexpr int kKeyframeEvery = 4;

Stamp stampOf(int frame) { return {kFirst + frame * 50'000'000LL}; }

/// A turn of a circle, climbing.
SE3 poseOf(int frame) {
  const double angle = 0.05 * frame;
  return SE3(expSo3({0, 0, angle}), {3 * std::cos(angle), 2 * std::sin(angle), 0.01 * frame});
}

Trajectory truthOf() {
  // In axes of its own: turned about gravity and moved.
  const SE3 T_truth_world(expSo3({0, 0, 0.7}), {10, -4, 2});
  Trajectory truth;
  for (int i = 0; i < kFrames; ++i) {
    TrajectoryPoint point;
    point.stamp = stampOf(i);
    point.T_world_body = T_truth_world * poseOf(i);
    point.has_motion = true;
    truth.push_back(point);
  }
  return truth;
}

TriangleMesh meshOf(int side) {
  TriangleMesh mesh;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      mesh.vertices.emplace_back(0.05F * static_cast<float>(x), 0.05F * static_cast<float>(y), 0.0F);
      mesh.grey.push_back(static_cast<std::uint8_t>(x % 256));
    }
  }
  const auto at = [&](int x, int y) { return static_cast<std::uint32_t>(y * side + x); };
  for (int y = 0; y + 1 < side; ++y) {
    for (int x = 0; x + 1 < side; ++x) {
      mesh.faces.push_back({at(x, y), at(x + 1, y), at(x, y + 1)});
      mesh.faces.push_back({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)});
      mesh.labels.insert(mesh.labels.end(), 2, static_cast<std::uint8_t>(1 + x % 3));
    }
  }
  return mesh;
}

Json summaryJson() {
  const Json figures = {{"mean_ms", 2.0},
                        {"p50_ms", 2.0},
                        {"p99_ms", 12.0},
                        {"max_ms", 12.5},
                        {"histogram", "1.995 190, 11.22 10"}};
  return {{"version", {{"swiftlet", "0.1.0"}}},
          {"run",
           {{"log", "a <log> & more"},
            {"cameras", 2},
            {"first_image_ns", kFirst},
            {"last_image_ns", stampOf(kFrames - 1).ns}}},
          {"settings", {{"budgets.track_p99_ms", 9.0}, {"frontend.features", 200}}},
          {"health",
           {{{"stamp_ns", kFirst}, {"health", "initializing"}, {"epoch", 0}},
            {{"stamp_ns", stampOf(20).ns}, {"health", "good"}, {"epoch", 0}}}},
          {"counters", {{"odometry", {{"frames", kFrames}}}}},
          {"timing", {{"track", {{"frames", {{"count", 200}, {"cpu", figures}, {"wall", figures}}}}}}},
          {"cpu", {{"cpu_s", 1.5}}},
          {"memory", {{"peak_resident_bytes", 1 << 20}}}};
}

/// A whole run folder; its poses are off by 0.1 m along x over ten frames in the middle.
void writeRun(const std::string& folder) {
  fs::create_directories(folder);
  const fs::path path(folder);
  LineFile odometry(path / "odometry.tum");
  LineFile states(path / "states.csv");
  states.write(statesHeader());
  for (int i = 0; i < kFrames; ++i) {
    SE3 pose = poseOf(i);
    if (i >= 100 && i < 110) pose.translation.x() += 0.1;
    odometry.write(formatTum(stampOf(i), pose));
    if (i % kKeyframeEvery != 0) continue;
    KeyframeState keyframe;
    keyframe.state.stamp = stampOf(i);
    keyframe.state.T_world_body = poseOf(i);
    keyframe.state.v_world_body = {1, 2, 3};
    keyframe.state.bias_gyro = {0.001 * i, 0, 0};
    keyframe.state.covariance = Matrix15d::Identity() * 1e-4;
    keyframe.statistics.tracks = 150 + i % 7;
    keyframe.statistics.track_length = 12.5;
    keyframe.statistics.reprojection_rms = 0.75;
    states.write(statesRow(keyframe));
  }
  LineFile events(path / "events.log");
  events.write(formatSeconds(stampOf(20)) + " health_changed good");
  events.write(formatSeconds(stampOf(30)) + " remark a </script> remark");
  writeJson((path / "summary.json").string(), summaryJson());
  writePly((path / "local_mesh.ply").string(), meshOf(10));
}

ReportedRun readRun(const std::string& folder, const Trajectory& truth = truthOf()) {
  ReportedRun run;
  run.view = viewOf(readRunFiles(folder), truth, "truth", AccuracyOptions());
  return run;
}

const Plot* findPlot(const std::vector<Plot>& plots, const std::string& id) {
  for (const Plot& plot : plots) {
    if (plot.id == id) return &plot;
  }
  return nullptr;
}

bool says(const Json& document, const std::string& file, const std::string& what) {
  for (const Json& missing : document["missing"]) {
    if (missing["file"] == file && missing["what"].get<std::string>().find(what) != std::string::npos)
      return true;
  }
  return false;
}

void cut(const fs::path& path, double share) {
  fs::resize_file(path, static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(path))));
}

TEST_CASE("a whole run shows every plot with its data") {
  const ScratchFolder folder("report");
  writeRun(folder.file("run"));
  const ReportedRun run = readRun(folder.file("run"));
  const std::vector<Plot> plots = plotsOf(run.view);
  for (const char* id :
       {"from_above", "from_the_side", "error_position", "error_attitude", "error_x", "error_phi_z",
        "velocity", "bias_gyro", "bias_accel", "sigma_position", "features", "track_length", "reprojection",
        "imu_residual", "interval_images", "latency_track_cpu"}) {
    INFO(id);
    REQUIRE(findPlot(plots, id) != nullptr);
    CHECK_FALSE(findPlot(plots, id)->empty());
  }
  CHECK(run.view.files.missing.empty());

  // Off by 0.1 m over ten of 200 frames: the alignment gives way by at most that share.
  const Series& error = findPlot(plots, "error_position")->series[0];
  REQUIRE(error.y.size() == kFrames);
  CHECK(error.y[105] == Approx(0.1).margin(0.015));
  CHECK(error.y[50] < 0.015);
  const Series& above = findPlot(plots, "from_above")->series.back();
  REQUIRE(above.value.size() == kFrames);
  CHECK(above.value[105] == Approx(error.y[105]));
  // The truth is shown in the run's world.
  const Series& truth = findPlot(plots, "from_above")->series.front();
  CHECK(truth.x[150] == Approx(above.x[150]).margin(0.02));

  const Series& band = findPlot(plots, "error_y")->series[0];
  CHECK(band.style == SeriesStyle::kBand);
  CHECK(band.y[3] == Approx(0.03));
  CHECK(findPlot(plots, "velocity")->series.back().y.front() == 3);
  CHECK(findPlot(plots, "features")->series[0].y[2] == 150 + 8 % 7);
  CHECK(findPlot(plots, "interval_images")->series[0].y[7] == Approx(50));

  const Plot& latency = *findPlot(plots, "latency_track_cpu");
  REQUIRE(latency.series[0].x.size() == 2);
  CHECK(latency.series[0].x[1] == Approx(11.22));
  CHECK(latency.series[0].y[1] == 10);
  REQUIRE(latency.markers.size() == 1);
  CHECK(latency.markers[0].x == 9);
}

TEST_CASE("the document holds health, events, tables and the scene") {
  const ScratchFolder folder("report_document");
  writeRun(folder.file("run"));
  const Json document = reportDocument({readRun(folder.file("run"))});
  CHECK(document["format"] == kReportFormat);
  const Json& run = document["runs"][0];
  CHECK(run["missing"].empty());
  REQUIRE(run["health"].size() == 2);
  CHECK(run["health"][0]["to"].get<double>() == Approx(1));
  CHECK(run["health"][1]["to"].get<double>() == Approx(0.05 * (kFrames - 1)));
  CHECK(run["events"][1]["text"] == "a </script> remark");
  bool missed = false;
  for (const Json& table : run["tables"]) {
    for (const Json& row : table["rows"]) {
      CHECK(row.size() == table["columns"].size());
      for (const Json& cell : row) missed = missed || cell == "12 / 9 missed";
    }
  }
  CHECK(missed);
  CHECK(run["scene"]["surfaces"][0]["faces"] == 2 * 9 * 9);
  CHECK(run["scene"]["trajectories"].size() == 2);

  // Text of files cannot end the page's script.
  const std::string page = pageWith("<a><!--swiftlet-report-document--></a>", "page", document);
  CHECK(page.find("</script> remark") == std::string::npos);
  const std::size_t begin = page.find('>', page.find("report-document")) + 1;
  CHECK(Json::parse(page.substr(begin, page.find("</script>") - begin)) == document);
  CHECK_THROWS_AS(pageWith("<a></a>", "page", document), InputError);
}

TEST_CASE("a missing file takes its plots away and is named") {
  const ScratchFolder folder("report_missing");
  for (const char* name : {"summary.json", "odometry.tum", "states.csv", "events.log"}) {
    INFO(name);
    const std::string run = folder.file(std::string("run_") + name);
    writeRun(run);
    fs::remove(fs::path(run) / name);
    const ReportedRun reported = readRun(run);
    const Json document = runDocument(reported);
    CHECK(says(document, name, "missing"));
    CHECK(document["plots"].size() > 3);
    CHECK_FALSE(plainPage({reported}).empty());
  }
  // Without truth the way is coloured by what the run itself says.
  const std::string run = folder.file("without_truth");
  writeRun(run);
  const std::vector<Plot> plots = plotsOf(readRun(run, {}).view);
  CHECK(findPlot(plots, "error_position") == nullptr);
  CHECK(findPlot(plots, "from_above")->value_label == "3 sigma of position [m]");
  CHECK(findPlot(plots, "from_above")->series[0].value[9] == Approx(3 * std::sqrt(3e-4)));
}

TEST_CASE("a damaged file is named with its fault and the rest is shown") {
  const ScratchFolder folder("report_damaged");
  const std::string run = folder.file("run");
  writeRun(run);
  const fs::path path(run);
  cut(path / "summary.json", 0.6);
  cut(path / "local_mesh.ply", 0.5);
  std::ofstream(path / "states.csv") << "#header\nno,numbers,here\n";
  std::ofstream(path / "odometry.tum", std::ios::app) << "1403636590.1 nonsense\n";
  std::ofstream(path / "events.log", std::ios::app) << "not a stamp\n";
  std::ofstream(path / "map.ply") << std::string(500, '\xff');
  const ReportedRun reported = readRun(run);
  const Json document = runDocument(reported);
  for (const auto& [file, what] :
       std::map<std::string, std::string>{{"summary.json", "not a valid JSON object"},
                                          {"local_mesh.ply", "local_mesh.ply"},
                                          {"map.ply", "map.ply"},
                                          {"states.csv", "states.csv"},
                                          {"odometry.tum", "1 damaged rows"},
                                          {"events.log", "1 lines without"}}) {
    INFO(file);
    CHECK(says(document, file, what));
  }
  const std::vector<Plot> plots = plotsOf(reported.view);
  CHECK(findPlot(plots, "error_position") != nullptr);
  CHECK(findPlot(plots, "velocity") == nullptr);
  // The events tell the health where the summary cannot.
  REQUIRE(document["health"].size() == 1);
  CHECK(document["health"][0]["health"] == "good");
}

TEST_CASE("a summary with the wrong kinds of values does no harm") {
  const ScratchFolder folder("report_kinds");
  writeRun(folder.file("run"));
  const std::string path = folder.file("run") + "/summary.json";
  for (const char* text :
       {"[]", "{}", R"({"run": 3, "health": {}, "timing": [], "settings": "x"})",
        R"({"run": {"log": 5, "cameras": "two", "first_image_ns": "x"}, "health": [1, {"stamp_ns": 1.5}],
                              "timing": {"track": 3, "smooth": {"frames": 1, "keyframes": {"cpu": 5, "wall":
                              {"histogram": "x 1"}}}}, "memory": {"table_bytes": {"a": "b"}}, "warnings": {}})",
        R"({"health": [{"stamp_ns": 1, "health": 5}],
            "timing": {"track": {"frames": {"cpu": {"histogram": 5}}}}})"}) {
    INFO(text);
    std::ofstream(path) << text;
    const ReportedRun run = readRun(folder.file("run"));
    CHECK(runDocument(run)["plots"].size() > 10);
    CHECK_FALSE(plainPage({run, run}).empty());
  }
}

TEST_CASE("what is no run folder is refused") {
  const ScratchFolder folder("report_none");
  CHECK_THROWS_AS(readRunFiles(folder.file("none")), InputError);
  CHECK_THROWS_AS(readRunFiles(folder.path()), InputError);
}

TEST_CASE("two runs: what differs is named") {
  const ScratchFolder folder("report_two");
  writeRun(folder.file("a"));
  writeRun(folder.file("b"));
  Json summary = summaryJson();
  summary["settings"]["frontend.features"] = 250;
  summary["settings"]["only.here"] = true;
  writeJson(folder.file("b") + "/summary.json", summary);
  const Json document = reportDocument({readRun(folder.file("a")), readRun(folder.file("b"))});
  CHECK(document["runs"].size() == 2);
  REQUIRE(document["differences"].size() == 1);
  const Json expected = {{"frontend.features", "200", "250", "+50 (+25.0 %)"},
                         {"only.here", "none", "true", ""}};
  CHECK(document["differences"][0]["rows"] == expected);
}

TEST_CASE("thinned series keep their ends and extremes") {
  Random random(5);
  Series series{"noise", SeriesStyle::kLine, {}, {}, {}};
  for (int i = 0; i < 50'000; ++i) {
    series.x.push_back(i);
    series.y.push_back(random.normal());
  }
  series.y[31'234] = 40;
  series.y[77] = -40;
  const Series thin = decimated(series, 1000);
  CHECK(thin.x.size() <= 1000);
  CHECK(thin.x.size() > 900);
  CHECK(std::is_sorted(thin.x.begin(), thin.x.end()));
  CHECK(thin.x.front() == 0);
  CHECK(thin.x.back() == 49'999);
  CHECK(std::count(thin.y.begin(), thin.y.end(), 40) == 1);
  CHECK(std::count(thin.y.begin(), thin.y.end(), -40) == 1);
  CHECK(decimated(thin, 1000).x == thin.x);
}

TEST_CASE("a surface is thinned to what a page holds") {
  const TriangleMesh mesh = meshOf(300);
  double cell = 0;
  const TriangleMesh same = thinned(mesh, 100'000, 200'000, cell);
  CHECK(cell == 0);
  CHECK(same.faces.size() == mesh.faces.size());
  const TriangleMesh thin = thinned(mesh, 5000, 8000, cell);
  CHECK(cell > 0.05);
  CHECK(thin.vertices.size() <= 5000);
  CHECK(thin.faces.size() <= 8000);
  CHECK(thin.faces.size() > 2000);
  CHECK(thin.labels.size() == thin.faces.size());
  CHECK(thin.grey.size() == thin.vertices.size());
  for (const auto& face : thin.faces) {
    for (const std::uint32_t corner : face) REQUIRE(corner < thin.vertices.size());
  }
  // The plane's corners stay within a cell of its own.
  for (const Eigen::Vector3f& p : thin.vertices) {
    CHECK(p.z() == 0);
    CHECK(p.x() >= 0);
    CHECK(p.x() <= 0.05F * 300);
  }
}

TEST_CASE("base64 as RFC 4648 has it") {
  const auto of = [](const std::string& text) {
    return base64({reinterpret_cast<const unsigned char*>(text.data()), text.size()});
  };
  CHECK(of("").empty());
  CHECK(of("f") == "Zg==");
  CHECK(of("fo") == "Zm8=");
  CHECK(of("foo") == "Zm9v");
  CHECK(of("foobar") == "Zm9vYmFy");
  CHECK(of("\xff\xfe\xfd") == "//79");
}

TEST_CASE("summary.json tells the latencies' distribution") {
  RunStatistics statistics;
  for (int i = 0; i < 97; ++i) addTime(statistics.times, StageId::kTrack, {2.05e-3, 1.05e-3});
  for (int i = 0; i < 3; ++i) addTime(statistics.times, StageId::kTrack, {50.5e-3, 1.05e-3});
  const ScratchFolder folder("report_histogram");
  writeRun(folder.file("run"));
  writeJson(folder.file("run") + "/summary.json", summaryOf(RunFacts(), Settings(), statistics));
  const std::vector<Plot> plots = plotsOf(readRun(folder.file("run")).view);
  const Plot* wall = findPlot(plots, "latency_track_wall");
  REQUIRE(wall != nullptr);
  const Series& series = wall->series[0];
  REQUIRE(series.x.size() == 2);
  CHECK(series.y == std::vector<double>{97, 3});
  const double width = std::pow(10.0, 1.0 / kHistogramColumnsPerDecade);
  CHECK((series.x[0] < 2.05 && series.x[0] * width > 2.02));
  CHECK((series.x[1] < 50.5 && series.x[1] * width > 49.9));
}

TEST_CASE("the plain page draws every plot and says what it lacks") {
  const ScratchFolder folder("report_plain");
  writeRun(folder.file("run"));
  const ReportedRun run = readRun(folder.file("run"));
  const std::string page = plainPage({run});
  for (const Plot& plot : plotsOf(run.view)) {
    INFO(plot.id);
    CHECK(page.find("<svg id=\"" + plot.id + "\"") != std::string::npos);
  }
  CHECK(page.find("npm") != std::string::npos);
  CHECK(page.find("nan") == std::string::npos);
  CHECK(page.find("a &lt;log&gt; &amp; more") != std::string::npos);
  CHECK(page.find("http") == std::string::npos);
}

}  // namespace
}  // namespace swiftlet
