// The live view's document and patches: of known values of an outlet.

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/outputs/view/live_document.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kFirst = 1'403'636'579'763'555'584;
constexpr double kFrame = 0.05;

std::vector<unsigned char> bytesOf(const std::string& text) {
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<unsigned char> bytes;
  unsigned bits = 0;
  int have = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6U | static_cast<unsigned>(letters.find(c));
    have += 6;
    if (have < 8) continue;
    have -= 8;
    bytes.push_back(static_cast<unsigned char>(bits >> static_cast<unsigned>(have) & 255U));
  }
  return bytes;
}

template <typename T>
std::vector<T> numbersOf(const Json& column) {
  const std::vector<unsigned char> bytes = bytesOf(column.get<std::string>());
  std::vector<T> numbers(bytes.size() / sizeof(T));
  std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(T));
  return numbers;
}

const Json& named(const Json& list, const char* key, const std::string& name) {
  for (const Json& one : list) {
    if (one[key] == name) return one;
  }
  FAIL("there is no " << name);
  return list;
}

std::vector<float> series(const Json& of, const std::string& plot, const std::string& name,
                          const char* axis) {
  return numbersOf<float>(named(named(of["plots"], "id", plot)["series"], "name", name)[axis]);
}

/// An outlet that is fed as a run would.
struct Run {
  std::unique_ptr<LiveOutlet> outlet = std::make_unique<LiveOutlet>();
  LiveDocument document{"a run"};
  double now = 100;

  static Stamp at(double t) { return {kFirst + Duration::fromSeconds(t).ns}; }

  void frame(double t, bool has_state = true, Health health = Health::kGood) {
    FrameNews news;
    news.stamp = at(t);
    news.has_state = has_state;
    news.waiting_for = has_state ? "" : "motion";
    news.health = health;
    news.statistics.tracks = 250;
    news.statistics.inliers_mono = 40;
    news.statistics.inliers_stereo = 150;
    news.statistics.reprojection_rms = 0.5;
    news.since_arrival = 0.006;
    outlet->frame.write(news);
  }
  void state(double t, Health health = Health::kGood, std::uint32_t epoch = 0) {
    NavState state;
    state.stamp = at(t);
    state.health = health;
    state.epoch = epoch;
    state.T_world_body = SE3(expSo3({0, 0, 0.5}), {t, 2 * t, -t});
    state.v_world_body = {1, 2, -1};
    state.bias_gyro = {0.01, 0.02, 0.03};
    state.covariance.diagonal().setConstant(0.01);
    outlet->state.write({state, Eigen::Vector3d::Zero()});
  }
  void sample(bool watched = true) {
    document.sample(*outlet, now, watched);
    now += 0.05;
  }
};

TEST_CASE("before anything comes the document is a whole one") {
  Run run;
  run.sample();
  const Json patch = run.document.patch();
  CHECK(patch["sequence"] == 1);
  const Json document = run.document.document();
  CHECK(document["format"] == 1);
  CHECK(document["sequence"] == 1);
  REQUIRE(document["runs"].is_array());
  REQUIRE(document["runs"].size() == 1);
  CHECK(document["runs"][0]["plots"].size() == 17);
  CHECK(document["runs"][0]["scene"]["trajectories"].size() == 1);
  CHECK(document["runs"][0]["scene"]["pose"].is_null());
  CHECK(document["live"]["health"] == "nothing yet");
}

TEST_CASE("states and frames become rows of the plots, once") {
  Run run;
  run.frame(0);
  run.state(0.005);
  run.sample();
  static_cast<void>(run.document.patch());
  // Ten samples between two looks; each plot shows their mean distance.
  for (int i = 2; i <= 11; ++i) run.state(0.005 * i);
  run.frame(kFrame);
  run.sample();
  const Json patch = run.document.patch();
  CHECK(patch["sequence"] == 2);
  CHECK(patch["duration"].get<double>() == Approx(0.055));
  CHECK(series(patch, "velocity", "y", "x") == std::vector<float>{0.055F});
  CHECK(series(patch, "velocity", "y", "y") == std::vector<float>{2});
  CHECK(series(patch, "bias_gyro", "z", "y") == std::vector<float>{0.03F});
  CHECK(series(patch, "plan", "odometry", "y")[0] == Approx(0.11));
  CHECK(series(patch, "side", "odometry", "y")[0] == Approx(-0.055));
  CHECK(series(patch, "plan", "odometry", "value")[0] == Approx(0.3));
  CHECK(series(patch, "sigma_attitude", "x", "y")[0] == Approx(0.3 * 57.29578));
  CHECK(series(patch, "features", "inliers, both cameras", "y") == std::vector<float>{150});
  CHECK(series(patch, "frame_interval", "ms", "y")[0] == Approx(50));
  CHECK(series(patch, "state_interval", "ms", "y")[0] == Approx(5).margin(1e-3));
  CHECK(series(patch, "image_to_pose", "ms", "y")[0] == Approx(6));
  const Json& trajectory = patch["scene"]["trajectories"][0];
  CHECK(trajectory["count"] == 1);
  CHECK(numbersOf<float>(trajectory["points"])[1] == Approx(0.11));
  CHECK(patch["scene"]["pose"].size() == 7);
  CHECK(patch["scene"]["pose"][6].get<double>() == Approx(std::cos(0.25)));
  // Nothing new, nothing in the patch; all of it in the document.
  run.sample();
  const Json empty = run.document.patch();
  CHECK(empty["plots"].empty());
  CHECK_FALSE(empty.contains("health"));
  CHECK(series(run.document.document()["runs"][0], "velocity", "y", "x") ==
        std::vector<float>{0.005F, 0.055F});
}

TEST_CASE("nothing is drawn of a state that is none") {
  Run run;
  run.frame(0, false, Health::kInitializing);
  run.state(0.005, Health::kInitializing);
  run.sample();
  Json patch = run.document.patch();
  CHECK(patch["live"]["waiting_for"] == "motion");
  CHECK_FALSE(patch.contains("scene"));
  run.frame(kFrame);
  run.state(kFrame);
  run.sample();
  static_cast<void>(run.document.patch());
  run.state(0.1, Health::kFailed);
  run.sample();
  patch = run.document.patch();
  CHECK(patch["live"]["health"] == "failed");
  CHECK_FALSE(patch["scene"].contains("trajectories"));
}

TEST_CASE("health is a history of spans, changes are events") {
  Run run;
  run.frame(0);
  for (int i = 0; i < 10; ++i) {
    run.state(0.1 * i, i < 5 ? Health::kGood : Health::kDegraded, i < 8 ? 0 : 1);
    run.sample();
  }
  const Json patch = run.document.patch();
  const Json& spans = patch["health"];
  REQUIRE(spans.size() == 3);
  CHECK(spans[0]["health"] == "good");
  CHECK(spans[0]["to"].get<double>() == Approx(0.5));
  CHECK(spans[1]["health"] == "degraded");
  CHECK(spans[2]["epoch"] == 1);
  CHECK(spans[2]["to"].get<double>() == Approx(0.9));
  CHECK(named(patch["events"], "name", "reset")["text"] == "epoch 1");
  // A health that changes with every state is bounded too.
  for (int i = 0; i < 2000; ++i) {
    run.state(1 + 0.1 * i, i % 2 == 0 ? Health::kGood : Health::kDegraded, 1);
    run.sample();
  }
  CHECK(run.document.patch()["events"].size() <= LiveDocument::kMostEvents);
  const Json document = run.document.document();
  CHECK(document["runs"][0]["health"].size() == LiveDocument::kMostSpans);
  CHECK(document["runs"][0]["events"].size() == LiveDocument::kMostEvents);
}

TEST_CASE("the verdict on arming is in the bar, in the table and among the events") {
  Run run;
  run.frame(0);
  Verdict verdict;
  verdict.evaluated = Stamp{} + Duration::fromSeconds(1e6);  // never stale
  verdict.arming_changes = 1;
  MissingCondition missing;
  missing.condition = ArmingCondition::kSensors;
  std::strcpy(missing.text.data(), "camera 1 is silent");
  missing.remedy = "look at its cable";
  static_cast<void>(verdict.arming.missing.tryPushBack(missing));
  run.outlet->verdict.write(verdict);
  run.sample();
  Json patch = run.document.patch();
  CHECK(patch["live"]["arming"]["ready"] == false);
  CHECK(patch["live"]["arming"]["missing"][0]["what"] == "camera 1 is silent");
  CHECK(named(patch["tables"], "id", "arming")["rows"][0][2] == "look at its cable");
  CHECK(run.document.text().find("look at its cable") != std::string::npos);
  verdict.arming = {};
  ++verdict.arming_changes;
  run.outlet->verdict.write(verdict);
  run.sample();
  patch = run.document.patch();
  CHECK(patch["live"]["arming"]["ready"] == true);
  CHECK(named(patch["events"], "name", "arming")["text"] == "ready to arm");
}

TEST_CASE(
    "who is late or lost is in the bar, in the table and among the events; a stale verdict says nothing") {
  Run run;
  run.frame(0);
  run.state(0.01);
  Verdict verdict;
  verdict.evaluated = Stamp{} + Duration::fromSeconds(1e6);
  verdict.health = Health::kDegraded;
  verdict.trouble_changes = 1;
  Trouble trouble;
  std::strcpy(trouble.member.data(), "mesh");
  std::strcpy(trouble.text.data(), "no memory");
  trouble.condition = Condition::kLost;
  trouble.cause = Cause::kThrew;
  static_cast<void>(verdict.troubles.tryPushBack(trouble));
  run.outlet->verdict.write(verdict);
  run.sample();
  Json patch = run.document.patch();
  CHECK(patch["live"]["health"] == "degraded");
  CHECK(patch["live"]["troubles"][0]["member"] == "mesh");
  CHECK(named(patch["events"], "name", "supervisor")["text"] == "mesh is lost: no memory");
  CHECK(named(patch["tables"], "id", "supervision")["rows"][0][2] == "no memory");
  CHECK(run.document.text().find("mesh is lost: no memory") != std::string::npos);

  verdict.troubles.clear();
  ++verdict.trouble_changes;
  verdict.health = Health::kGood;
  run.outlet->verdict.write(verdict);
  run.sample();
  patch = run.document.patch();
  CHECK(named(patch["events"], "name", "supervisor")["text"] == "mesh has recovered");
  CHECK(patch["live"]["troubles"].empty());

  verdict.evaluated = Stamp{} + Duration::fromSeconds(-1e6);
  run.outlet->verdict.write(verdict);
  run.sample();
  patch = run.document.patch();
  CHECK(patch["live"]["health"] == "unknown");
  CHECK_FALSE(patch["live"].contains("arming"));
  CHECK(patch["live"]["unsupervised"].get<std::string>().find("supervisor") != std::string::npos);
}

TEST_CASE("the local mesh and the map's surface are drawn where they are, for those who look") {
  Run run;
  run.frame(0);
  run.state(0.01);
  LocalMesh mesh;
  for (int i = 0; i < 3; ++i) {
    MeshVertex vertex;
    vertex.p_world = Eigen::Vector3f(i == 1, i == 2, 1);
    static_cast<void>(mesh.vertices.tryPushBack(vertex));
  }
  static_cast<void>(mesh.faces.tryPushBack(MeshFace{{0, 1, 2}, 0}));
  run.outlet->mesh.write(mesh);
  run.sample(false);
  CHECK_FALSE(run.outlet->surface_wanted.load());
  CHECK_FALSE(run.document.patch()["scene"].contains("surfaces"));
  run.sample();
  CHECK(run.outlet->surface_wanted.load());
  MapCorrection correction;
  correction.T_map_world = SE3(expSo3(Eigen::Vector3d::Zero()), {10, 0, 0});
  run.outlet->correction.write(correction);
  SurfaceNews& surface = run.outlet->surface.draft();
  for (std::size_t i = 0; i < 2 * LiveDocument::kMostCloudPoints + 2; ++i) {
    SurfaceVertex vertex;
    vertex.p_world = {10, 0, static_cast<float>(i % 7)};
    vertex.grey = 77;
    surface.vertices.push_back(vertex);
  }
  run.outlet->surface.publish();
  run.sample();
  const Json patch = run.document.patch();
  CHECK(patch["scene"]["surfaces"][0]["id"] == "local_mesh");
  CHECK(patch["scene"]["surfaces"][0]["faces"] == 1);
  const Json& cloud = patch["scene"]["clouds"][0];
  CHECK(cloud["count"].get<std::size_t>() <= LiveDocument::kMostCloudPoints);
  CHECK(cloud["low"][0].get<double>() == Approx(0).margin(1e-5));  // in the odometry's world
  CHECK(cloud["size"][2].get<double>() == Approx(6));
  CHECK(bytesOf(cloud["grey"].get<std::string>())[5] == 77);
  const Json document = run.document.document();
  CHECK(document["runs"][0]["scene"]["clouds"].size() == 1);
  CHECK(document["runs"][0]["scene"]["surfaces"].size() == 1);
  // A map of no points is none.
  run.outlet->surface.draft().vertices.clear();
  run.outlet->surface.publish();
  run.sample();
  CHECK_FALSE(run.document.patch()["scene"].contains("clouds"));
}

TEST_CASE("the nearest obstacle is a row with each frame that was mapped") {
  Run run;
  run.frame(0);
  ObstacleNews news;
  news.stamp = Run::at(0.1);
  news.nearest.kind = DistanceKind::kDistance;
  news.nearest.distance = 1.25;
  news.nearest.known_to = 0.5;
  run.outlet->obstacle.write(news);
  run.sample();
  const Json patch = run.document.patch();
  CHECK(series(patch, "obstacle", "to the nearest surface", "x") == std::vector<float>{0.1F});
  CHECK(series(patch, "obstacle", "to the nearest surface", "y") == std::vector<float>{1.25F});
  CHECK(series(patch, "obstacle", "to the unknown", "y") == std::vector<float>{0.5F});
  run.sample();
  const Json next = run.document.patch();
  for (const Json& plot : next["plots"]) CHECK(plot["id"] != "obstacle");
}

TEST_CASE("an hour's document stays small, and a thinned series is sent anew") {
  Run run;
  std::size_t largest_patch = 0;
  int replaced = 0;
  for (int i = 0; i < 20 * 600; ++i) {
    run.frame(kFrame * i);
    run.state(kFrame * i + 0.001);
    run.sample();
    if (i % 4 != 3) continue;
    const Json patch = run.document.patch();
    largest_patch = std::max(largest_patch, patch.dump().size());
    for (const Json& plot : patch["plots"]) replaced += plot.contains("replace") ? 1 : 0;
  }
  CHECK(replaced > 16);
  CHECK(largest_patch < 700'000);
  CHECK(run.document.document().dump().size() < 700'000);
  const Json document = run.document.document();
  const Json& velocity = named(document["runs"][0]["plots"], "id", "velocity");
  CHECK(velocity["series"][0]["count"].get<std::size_t>() <= LiveTable::kMost);
}

}  // namespace
}  // namespace swiftlet
