// The thread that publishes a run, from a scripted outlet to another implementation: every field of every
// topic; and labels on their way in, also while somebody floods them.

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/ros2/dds_thread.hpp"
#include "tests/drivers/dds/peer_process.hpp"

namespace swiftlet {
namespace {

using test::ownDomain;
using test::PeerProcess;

constexpr int kWidth = 64;
constexpr int kHeight = 48;
constexpr std::int64_t kOffset = 5'000'000'123;    ///< ns, from the run's clock to ROS's
constexpr std::int64_t kStep = 3'600'000'000'077;  ///< ns, by which the wall clock is set ahead in a run
constexpr double kGyroSigma = 0.01;

// Everything of message n is a function of n, which is its stamp in milliseconds.

Stamp stampOf(std::int64_t n) { return {n * 1'000'000}; }

StateNews stateOf(std::int64_t n) {
  const auto v = static_cast<double>(n);
  NavState state;
  state.stamp = stampOf(n);
  state.epoch = 1;
  state.health = Health::kGood;
  // A quarter turn about z: body x is world y.
  state.T_world_body.rotation = Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5));
  state.T_world_body.translation = {v, 2 * v, -v};
  state.v_world_body = {0, v, 1};
  for (int i = 0; i < kStateDim; ++i) state.covariance(i, i) = i + 1;
  return {state, {0.1, -0.2, v}};
}

FrameNews frameOf(std::int64_t n) {
  FrameNews news;
  news.stamp = stampOf(n);
  news.has_state = true;
  news.health = Health::kDegraded;
  news.epoch = 3;
  news.statistics.at_rest = true;
  news.statistics.tracks = 101;
  news.statistics.landmarks = 102;
  news.statistics.inliers_mono = 103;
  news.statistics.inliers_stereo = 104;
  news.statistics.reprojection_rms = 0.25;
  news.statistics.imu_residual = 1.5;
  return news;
}

void fill(LocalMesh& mesh, std::int64_t n) {
  mesh.stamp = stampOf(n);
  mesh.vertices.clear();
  mesh.faces.clear();
  for (int i = 0; i < 4; ++i) {
    MeshVertex vertex;
    vertex.p_world = {static_cast<float>(n), static_cast<float>(i), 0.5F};
    vertex.grey = static_cast<std::uint8_t>(51 * i);
    static_cast<void>(mesh.vertices.tryPushBack(vertex));
  }
  static_cast<void>(mesh.faces.tryPushBack({{0, 1, 2}, 0}));
  static_cast<void>(mesh.faces.tryPushBack({{2, 1, 3}, 5}));
}

void fill(SurfaceNews& surface, std::int64_t n) {
  surface.stamp = stampOf(n);
  surface.vertices.assign(2, SurfaceVertex{});
  surface.vertices[0].p_world = {1, 2, static_cast<float>(n)};
  surface.vertices[0].grey = 17;
  surface.vertices[1].p_world = {-1, -2, -3};
  surface.vertices[1].label = 9;
}

/// By turns in unknown space, at least 2 m, a surface at 1.25 m; every other one of them without the newest
/// image. In unknown space that surface is there, too, every other time.
ObstacleNews obstacleOf(std::int64_t n) {
  ObstacleNews news;
  news.stamp = stampOf(n);
  // Body x is map y.
  news.T_map_body.rotation = Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5));
  news.nearest.kind = static_cast<DistanceKind>(n % 3);
  news.nearest.stale = n % 2 == 0;
  news.nearest.up_to = stampOf(news.nearest.stale ? n - 750 : n);
  const bool unknown = news.nearest.kind == DistanceKind::kUnknown;
  if (unknown && n % 2 == 0) return news;
  if (!unknown) news.nearest.known_to = 0.5;
  news.nearest.distance = news.nearest.kind == DistanceKind::kAtLeast ? 2 : 1.25;
  if (news.nearest.kind != DistanceKind::kAtLeast) news.nearest.gradient = {0, 0.8, -0.6};
  return news;
}

/// The words of a printed message after its topic.
class Fields {
 public:
  explicit Fields(const std::string& line) : words_(line) { words_ >> topic; }
  std::string topic;
  std::string word() {
    std::string word;
    REQUIRE(words_ >> word);
    return word;
  }
  double number() { return std::stod(word()); }
  /// n of a header's stamp.
  std::int64_t stamp() {
    std::int64_t ns = std::stoll(word()) - kOffset;
    if (ns >= kStep) ns -= kStep;
    REQUIRE(ns % 1'000'000 == 0);
    return ns / 1'000'000;
  }
  void expect(std::initializer_list<double> values) {
    for (const double value : values) {
      const double said = number();
      CHECK((std::isnan(value) ? std::isnan(said) : said == Approx(value).margin(1e-6)));
    }
  }
  void expectWords(std::initializer_list<const char*> values) {
    for (const char* value : values) CHECK(word() == value);
  }
  void expectEnd() {
    std::string word;
    CHECK_FALSE(words_ >> word);
  }

 private:
  std::istringstream words_;
};

void checkOdometry(Fields& fields) {
  const auto n = static_cast<double>(fields.stamp());
  fields.expectWords({"odom", "base_link"});
  fields.expect({n, 2 * n, -n, 0, 0, std::sqrt(0.5), std::sqrt(0.5)});
  fields.expect({n, 0, 1, 0.1, -0.2, n});  // world y is body x
  // Ours: phi 1 2 3, p 4 5 6, about the body's axes; theirs: p, then turned to the world's.
  const std::array<double, 6> pose = {4, 5, 6, 2, 1, 3};
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      fields.expect({row == column ? pose[static_cast<std::size_t>(row)] : 0});
    }
  }
  // v_body = R^T v: R^T P_v R, and [v_body]x P_phi [v_body]x^T with v_body = (n, 0, 1).
  const Eigen::Matrix3d hat = (Eigen::Matrix3d() << 0, -1, 0, 1, 0, -n, 0, n, 0).finished();
  const Eigen::Matrix3d P_phi = Eigen::Vector3d(1, 2, 3).asDiagonal();
  const Eigen::Matrix3d P_v = Eigen::Vector3d(8, 7, 9).asDiagonal();
  const Eigen::Matrix3d twist = hat * P_phi * hat.transpose() + P_v;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      double expected = row < 3 && column < 3 ? twist(row, column) : 0;
      if (row >= 3 && row == column) expected = 10 + (row - 3) + kGyroSigma * kGyroSigma;
      fields.expect({expected});
    }
  }
}

void checkTransforms(Fields& fields) {
  fields.expect({2});
  const std::int64_t n = fields.stamp();
  const auto v = static_cast<double>(n);
  fields.expectWords({"map", "odom"});
  fields.expect({0.25, -0.5, 1, 0, 0, 0, 1});
  CHECK(fields.stamp() == n);
  fields.expectWords({"odom", "base_link"});
  fields.expect({v, 2 * v, -v, 0, 0, std::sqrt(0.5), std::sqrt(0.5)});
}

void checkMesh(Fields& fields) {
  const auto n = static_cast<double>(fields.stamp());
  fields.expectWords({"odom", "local_mesh"});
  fields.expect({0, 11, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 6, 6});
  for (const double i : {0, 1, 2, 2, 1, 3}) fields.expect({n, i, 0.5});
  for (const double grey : {0.0, 0.2, 0.4}) {
    for (int c = 0; c < 3; ++c) CHECK(fields.number() == Approx(grey).epsilon(1e-6));
    fields.expect({1});
  }
  for (int i = 0; i < 3; ++i) {
    for (const std::uint8_t c : labelColour(5)) CHECK(fields.number() == Approx(c / 255.0).epsilon(1e-6));
    fields.expect({1});
  }
}

void checkSurface(Fields& fields) {
  const auto n = static_cast<double>(fields.stamp());
  fields.expectWords({"map"});
  fields.expect({1, 2, 20, 40, 0, 1, 5});
  int offset = 0;
  for (const char* name : {"x", "y", "z", "rgb", "label"}) {
    fields.expectWords({name});
    fields.expect({static_cast<double>(offset), offset < 16 ? 7.0 : 6.0, 1});
    offset += 4;
  }
  fields.expect({1, 2, n, 17 * 0x010101, 0});
  const auto [r, g, b] = labelColour(9);
  fields.expect({-1, -2, -3, static_cast<double>((r << 16) | (g << 8) | b), 9});
}

/// Of what kind it was.
std::int64_t checkObstacle(Fields& fields) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::int64_t n = fields.stamp();
  const std::int64_t kind = n % 3;
  fields.expectWords({"base_link"});
  const bool surface = kind == 2 || (kind == 0 && n % 2 == 1);
  fields.expect({1, 1, 40, 40, 0, surface ? 1.0 : 0.0, 10});
  int offset = 0;
  for (const char* name :
       {"x", "y", "z", "normal_x", "normal_y", "normal_z", "distance", "known_to", "age", "kind"}) {
    fields.expectWords({name});
    fields.expect({static_cast<double>(offset), offset < 36 ? 7.0 : 6.0, 1});
    offset += 4;
  }
  if (surface) {
    fields.expect({-1, 0, 0.75, 0.8, 0, -0.6, 1.25, kind == 2 ? 0.5 : 0.0});  // map y is body x
  } else if (kind == 1) {
    fields.expect({kNone, kNone, kNone, 0, 0, 0, 2, 0.5});
  } else {
    fields.expect({kNone, kNone, kNone, 0, 0, 0, 0, 0});
  }
  fields.expect({n % 2 == 0 ? 0.75 : 0.0, static_cast<double>(kind)});
  return kind;
}

void checkDiagnostics(Fields& fields) {
  fields.word();  // the newest frame's stamp, carried on
  fields.expectWords({"-"});
  fields.expect({1, 1});
  fields.expectWords({"swiftlet/health", "degraded", "swiftlet"});
  fields.expect({10});
  fields.expectWords({"epoch", "3", "at_rest", "1", "tracks", "101", "landmarks", "102", "inliers_mono",
                      "103", "inliers_stereo", "104", "reprojection_rms", "0.2500", "imu_residual", "1.5000",
                      "nearest_obstacle"});
  const std::string obstacle = fields.word();
  const bool known = obstacle.starts_with("at_least_2.00_m,_") || obstacle.starts_with("1.25_m,_") ||
                     obstacle.starts_with("unknown_here,_1.25_m,_");
  CHECK((obstacle == "unknown" || (known && obstacle.ends_with("_s_old"))));
  fields.expectWords({"dds_refused", "0"});
}

std::vector<std::uint8_t> imageOf(std::int64_t n) {
  std::vector<std::uint8_t> pixels(std::size_t{kWidth} * kHeight);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<std::uint8_t>(n + 3 * static_cast<int>(i));
  return pixels;
}

void checkImage(Fields& fields) {
  const std::int64_t n = fields.stamp();
  fields.expectWords({"cam0"});
  fields.expect({kHeight, kWidth});
  fields.expectWords({"mono8"});
  fields.expect({0, kWidth, kWidth * kHeight});
  double sum = 0;
  const auto pixels = imageOf(n);
  for (std::size_t i = 0; i < pixels.size(); ++i) sum += static_cast<double>(i % 101) * pixels[i];
  fields.expect({sum});
}

/// Stands for the map: opens a place for every frame, and takes its labels when they come.
class ScriptedMap {
 public:
  explicit ScriptedMap(LabelExchange& exchange) : exchange_(exchange) {}
  void step(std::int64_t n, bool frame) {
    for (auto open = open_.begin(); open != open_.end();) {
      const bool late = n - open->second > 1000;
      if ((!exchange_.isLabelled(open->first) && !late) || !exchange_.tryClose(open->first)) {
        ++open;
        continue;
      }
      const ImageView labels = exchange_.labels(open->first);
      // What a labeller sends before it has found this reader goes nowhere.
      if (!labels.empty()) ++labelled;
      if (labels.empty() && labelled > 0) ++unlabelled;
      for (int i = 0; i < labels.width * labels.height; ++i) wrong_pixels += labels.data[i] != 7 ? 1 : 0;
      exchange_.free(open->first);
      open = open_.erase(open);
    }
    if (!frame) return;
    const auto pixels = imageOf(n);
    const int place = exchange_.open(stampOf(n), {pixels.data(), kWidth, kHeight, kWidth});
    if (place >= 0) open_.emplace_back(place, n);
  }
  int labelled = 0, unlabelled = 0, wrong_pixels = 0;

 private:
  LabelExchange& exchange_;
  std::vector<std::pair<int, std::int64_t>> open_;
};

/// The wall clock, which a test may set.
std::atomic<std::int64_t> ahead{kOffset};

DdsThreadOptions optionsFor(LabelExchange& exchange) {
  ahead = kOffset;
  DdsThreadOptions options;
  options.settings.enabled = true;
  options.settings.domain = static_cast<int>(ownDomain());
  options.settings.odometry_hz = 100;
  options.settings.mesh_hz = 20;
  options.settings.label_topic = "/segmentation/labels";
  options.clocks = [] { return HostClocks{monotonicNow(), {ahead.load()}, {1}}; };
  options.gyro_sigma = kGyroSigma;
  options.labels = &exchange;
  return options;
}

std::vector<std::string> peerArguments(std::initializer_list<std::string> more) {
  std::vector<std::string> arguments = {"domain=" + std::to_string(ownDomain()), "label=7"};
  arguments.insert(arguments.end(), more);
  return arguments;
}

TEST_CASE("every field of a run reaches another implementation, and its labels come back", "[dds]") {
  const auto outlet = std::make_unique<LiveOutlet>();
  LabelExchange exchange(kWidth, kHeight, Duration::fromSeconds(1));
  DdsThread thread(*outlet, optionsFor(exchange));
  PeerProcess peer(SWIFTLET_DDS_LABELLER, peerArguments({"delay=0.7", "dump=1"}));
  MapCorrection correction;
  correction.epoch = 1;
  correction.T_map_world.translation = {0.25, -0.5, 1};
  outlet->correction.write(correction);
  ScriptedMap map(exchange);
  std::string text;
  // Until its labels have come for 3.5 s; half way the wall clock is set, while labels are awaited.
  std::int64_t since = -1;
  for (std::int64_t n = 1; n < 20'000 && (since < 0 || n < since + 3500); n += 5) {
    if (since >= 0 && n == since + 1750) ahead += kStep;
    outlet->state.write(stateOf(n));
    if (n % 50 == 1) outlet->frame.write(frameOf(n));
    if (n % 50 == 1) fill(outlet->mesh.draft(), n), outlet->mesh.publish();
    if (n % 25 == 1) outlet->obstacle.write(obstacleOf(n));
    if (outlet->surface_wanted.exchange(false)) fill(outlet->surface.draft(), n), outlet->surface.publish();
    map.step(n, exchange.hasLabeller() && n % 200 == 1);
    text += peer.poll();
    if (since < 0 && map.labelled > 0) since = n;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const nlohmann::ordered_json said = thread.finish();
  text += peer.finish();
  INFO(said.dump());
  std::map<std::string, int> seen;
  std::map<std::int64_t, int> kinds;
  std::map<std::string, std::int64_t> last;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    INFO(line);
    Fields fields(line);
    ++seen[fields.topic];
    if (fields.topic == "odometry") checkOdometry(fields);
    if (fields.topic == "tf") checkTransforms(fields);
    if (fields.topic == "local_mesh") checkMesh(fields);
    if (fields.topic == "surface") checkSurface(fields);
    if (fields.topic == "nearest_obstacle") ++kinds[checkObstacle(fields)];
    if (fields.topic == "diagnostics") checkDiagnostics(fields);
    if (fields.topic == "mapped_image") checkImage(fields);
    if (fields.topic != "labeller") fields.expectEnd();
  }
  CHECK(seen["odometry"] >= 100);
  CHECK(seen["tf"] >= 100);
  CHECK(seen["local_mesh"] >= 20);
  CHECK(seen["surface"] >= 1);
  CHECK(seen["nearest_obstacle"] <= said["obstacles"].get<int>());
  for (const std::int64_t kind : {0, 1, 2}) CHECK(kinds[kind] >= 10);
  CHECK(seen["diagnostics"] >= 1);
  CHECK(seen["mapped_image"] >= 8);
  CHECK(seen["odometry"] <= said["odometry"].get<int>());
  CHECK(said["refused"] == 0);
  CHECK(map.labelled >= 8);
  CHECK(map.unlabelled <= 1);
  CHECK(said["clock_steps"] == 1);
  CHECK(map.wrong_pixels == 0);
  CHECK(said["labels"]["used"].get<int>() >= map.labelled);
  CHECK(said["labels"]["wrong_size"] == 0);
}

TEST_CASE("diagnostics tell the verdict at once, and go on while no frame comes", "[dds]") {
  const auto outlet = std::make_unique<LiveOutlet>();
  LabelExchange exchange(kWidth, kHeight, Duration::fromSeconds(1));
  DdsThread thread(*outlet, optionsFor(exchange));
  PeerProcess peer(SWIFTLET_DDS_LABELLER, peerArguments({"dump=1"}));
  std::string text;
  const auto heard = [&](const std::string& what, const char* topic = "diagnostics") {
    std::istringstream lines(text);
    int count = 0;
    for (std::string line; std::getline(lines, line);) {
      count += line.starts_with(topic) && line.find(what) != std::string::npos ? 1 : 0;
    }
    return count;
  };
  const auto until = [&](const std::string& what, int times, auto&& each) {
    for (int i = 0; i < 4000 && heard(what) < times; ++i) {
      each();
      text += peer.poll();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    CHECK(heard(what) >= times);
  };
  outlet->frame.write(frameOf(1));
  Verdict verdict;
  verdict.health = Health::kGood;
  const auto supervise = [&] {
    verdict.evaluated = monotonicNow();
    outlet->verdict.write(verdict);
  };
  // Blanks are printed as underscores. No frame comes after the first.
  until("swiftlet/health good", 3, supervise);
  Trouble trouble;
  std::snprintf(trouble.member.data(), trouble.member.size(), "mesh");
  std::snprintf(trouble.text.data(), trouble.text.size(), "no memory");
  trouble.condition = Condition::kLost;
  trouble.since = monotonicNow();
  static_cast<void>(verdict.troubles.tryPushBack(trouble));
  ++verdict.trouble_changes;
  verdict.health = Health::kDegraded;
  until("degraded;_mesh_is_lost", 1, supervise);
  CHECK(heard("lost/mesh no_memory;_since") > 0);
  CHECK(heard("ready_to_arm 1") > 0);
  until("supervisor_stopped", 2, [] {});
  verdict.troubles.clear();
  ++verdict.trouble_changes;
  until("degraded swiftlet", 1, supervise);
  // Odometry ends with the verdict, even if the estimator still calls its state good.
  NavState state;
  state.health = Health::kGood;
  const auto fly = [&] {
    state.stamp = monotonicNow();
    outlet->state.write({state, Eigen::Vector3d::Zero()});
    supervise();
  };
  until("degraded", heard("degraded") + 2, fly);
  CHECK(heard("", "odometry") > 0);
  verdict.health = Health::kFailed;
  until("swiftlet/health failed", 1, fly);
  const int before = heard("", "odometry");
  until("swiftlet/health failed", 3, fly);
  CHECK(heard("", "odometry") == before);
  static_cast<void>(thread.finish());
  peer.finish();
}

TEST_CASE("a flood of label images costs them alone, each one counted", "[dds]") {
  const auto outlet = std::make_unique<LiveOutlet>();
  LabelExchange exchange(kWidth, kHeight, Duration::fromSeconds(1));
  DdsThread thread(*outlet, optionsFor(exchange));
  PeerProcess peer(SWIFTLET_DDS_LABELLER,
                   peerArguments({"delay=0.1", "flood=1000", "width=64", "height=48"}));
  ScriptedMap map(exchange);
  std::int64_t since = -1;
  for (std::int64_t n = 1; n < 20'000 && (since < 0 || n < since + 3000); n += 5) {
    outlet->state.write(stateOf(n));
    map.step(n, exchange.hasLabeller() && n % 100 == 1);
    if (since < 0 && exchange.hasLabeller()) since = n;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const nlohmann::ordered_json said = thread.finish();
  std::istringstream text(peer.finish());
  std::string word;
  std::uint64_t images = 0, answers = 0, flooded = 0;
  REQUIRE(text >> word >> images >> answers >> flooded);
  INFO(said.dump() << " answers " << answers << " flooded " << flooded);
  std::printf("flood: %s, labelled %d of %d, answers %d, flooded %d\n", said.dump().c_str(), map.labelled,
              map.labelled + map.unlabelled, static_cast<int>(answers), static_cast<int>(flooded));
  const nlohmann::ordered_json& labels = said["labels"];
  const auto count = [&](const char* name) { return labels[name].get<std::uint64_t>(); };
  CHECK(flooded > 500);
  CHECK(count("received") <= answers + flooded);
  CHECK(count("received") > 100);
  CHECK(count("wrong_size") > 0);
  CHECK(count("wrong_encoding") > 0);
  CHECK(count("unawaited") > 0);
  // Nothing is lost silently; a few that came early may still wait.
  const std::uint64_t counted =
      count("used") + count("overrun") + count("wrong_size") + count("wrong_encoding") + count("unawaited");
  CHECK(counted <= count("received"));
  CHECK(counted + LabelExchange::kEarly >= count("received"));
  CHECK(map.wrong_pixels == 0);
  // Those that are waited for find their way through.
  CHECK(map.labelled * 2 > map.unlabelled);
}

TEST_CASE("what cannot be published on is said by its setting", "[dds]") {
  const auto outlet = std::make_unique<LiveOutlet>();
  DdsThreadOptions options;
  options.settings.interface = "no_such_interface";
  options.settings.domain = static_cast<int>(ownDomain()) + 1;
  try {
    const DdsThread thread(*outlet, options);
    FAIL("it opened");
  } catch (const std::runtime_error& error) {  // no InputError: a service tries again
    const std::string text = error.what();
    CHECK(text.find("ros2.interface") != std::string::npos);
    CHECK(text.find("no_such_interface") != std::string::npos);
  }
}

}  // namespace
}  // namespace swiftlet
