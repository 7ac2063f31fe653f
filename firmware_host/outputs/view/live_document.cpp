#include "firmware_host/outputs/view/live_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/core/units.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/outputs/map_files/mesh_files.hpp"
#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/outputs/view/live_scene.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSigmas = 3;
constexpr double kMeshPeriod = 0.4;   // s
constexpr double kSurfacePeriod = 3;  // s
constexpr int kPatchesBetweenTables = 5;
constexpr const char* kUnsupervised = "the supervisor has stopped: health unknown";

/// Columns of the states' table.
enum State : std::size_t {
  kTime,
  kPosition,
  kVelocity = kPosition + 3,
  kBiasGyro = kVelocity + 3,
  kBiasAccel = kBiasGyro + 3,
  kSigmaPosition = kBiasAccel + 3,
  kSigmaAttitude = kSigmaPosition + 3,
  kSigmaVelocity = kSigmaAttitude + 3,
  kLargestSigma = kSigmaVelocity + 3,
  kStateColumns
};
/// Columns of the frames' table.
enum Frame : std::size_t {
  kTracks = 1,
  kMono,
  kStereo,
  kLandmarks,
  kTrackLength,
  kReprojection,
  kImuResidual,
  kIterations,
  kFrameColumns
};

/// Columns of the nearest obstacle's table.
enum Obstacle : std::size_t { kToSurface = 1, kToUnknown, kObstacleColumns };

std::string encoded(std::span<const float> values) { return base64Of(values); }

Json table(const char* id, const char* title, Json columns, Json rows) {
  return {{"id", id},
          {"title", title},
          {"columns", std::move(columns)},
          {"rows", std::move(rows)},
          {"folded", false}};
}

}  // namespace

LiveDocument::LiveDocument(std::string name, Json cameras)
    : name_(std::move(name)),
      cameras_(std::move(cameras)),
      states_(kStateColumns),
      frames_(kFrameColumns),
      state_intervals_(2, 1),
      frame_intervals_(2, 1),
      latencies_(2, 1),
      obstacles_(kObstacleColumns) {
  const auto axes = [](std::size_t first) {
    return std::vector<Line>{{"x", first}, {"y", first + 1}, {"z", first + 2}};
  };
  const char* state = "State";
  const char* features = "Features and residuals";
  plans_ = {
      {"plan", "Trajectory", "From above", "y [m]", &states_, {{"odometry", kPosition + 1}}, kPosition},
      {"side", "Trajectory", "From the side", "z [m]", &states_, {{"odometry", kPosition + 2}}, kPosition},
      {"velocity", state, "Velocity", "m/s", &states_, axes(kVelocity)},
      {"bias_gyro", state, "Gyro bias", "rad/s", &states_, axes(kBiasGyro)},
      {"bias_accel", state, "Accelerometer bias", "m/s^2", &states_, axes(kBiasAccel)},
      {"sigma_position", state, "3 sigma of position", "m", &states_, axes(kSigmaPosition)},
      {"sigma_attitude", state, "3 sigma of attitude", "deg", &states_, axes(kSigmaAttitude)},
      {"sigma_velocity", state, "3 sigma of velocity", "m/s", &states_, axes(kSigmaVelocity)},
      {"features",
       features,
       "Features and inliers",
       "count",
       &frames_,
       {{"tracks", kTracks},
        {"inliers, one camera", kMono},
        {"inliers, both cameras", kStereo},
        {"landmarks in the window", kLandmarks}}},
      {"track_length", features, "Mean track length", "frames", &frames_, {{"frames", kTrackLength}}},
      {"reprojection", features, "Reprojection RMS of the window", "px", &frames_, {{"px", kReprojection}}},
      {"imu_residual",
       features,
       "Normalized IMU residual (1 = as the noise model says)",
       "",
       &frames_,
       {{"residual", kImuResidual}}},
      {"iterations",
       features,
       "Iterations of the smoother",
       "count",
       &frames_,
       {{"iterations", kIterations}}},
      {"frame_interval", "Stamps", "Between frames", "ms", &frame_intervals_, {{"ms", 1}}},
      {"state_interval",
       "Stamps",
       "Between states at IMU rate (means)",
       "ms",
       &state_intervals_,
       {{"ms", 1}}},
      {"obstacle",
       "Map",
       "Room around the vehicle, with a map",
       "m",
       &obstacles_,
       {{"to the nearest surface", kToSurface}, {"to the unknown", kToUnknown}}},
      {"image_to_pose", "Latency", "Image's arrival to its pose, wall time", "ms", &latencies_, {{"ms", 1}}},
  };
}

void LiveDocument::begin(Stamp stamp) {
  if (begun_) return;
  begun_ = true;
  first_ = stamp;
}

void LiveDocument::sample(LiveOutlet& outlet, double now, bool watched) {
  now_ = now;
  takeFrame(outlet);
  takeState(outlet, now);
  takeVerdict(outlet, now);
  takeObstacle(outlet);
  if (!watched) return;
  if (now - mesh_came_ >= kMeshPeriod) takeMesh(outlet);
  takeSurface(outlet, now);
}

void LiveDocument::takeFrame(LiveOutlet& outlet) {
  const std::uint64_t number = outlet.frame.refresh();
  if (number == frame_number_) return;
  const FrameNews& news = outlet.frame.value();
  begin(news.stamp);
  const double t = seconds(news.stamp);
  duration_ = std::max(duration_, t);
  if (frame_) {
    const double interval =
        (news.stamp - frame_->stamp).seconds() / static_cast<double>(number - frame_number_);
    frame_intervals_.add(std::array{static_cast<float>(t), static_cast<float>(interval * kToMs)});
  }
  const FrameStatistics& s = news.statistics;
  const auto row = std::array<double, kFrameColumns>{t,
                                                     static_cast<double>(s.tracks),
                                                     static_cast<double>(s.inliers_mono),
                                                     static_cast<double>(s.inliers_stereo),
                                                     static_cast<double>(s.landmarks),
                                                     s.track_length,
                                                     s.reprojection_rms,
                                                     s.imu_residual,
                                                     static_cast<double>(s.iterations)};
  std::array<float, kFrameColumns> narrow{};
  std::ranges::transform(row, narrow.begin(), [](double v) { return static_cast<float>(v); });
  frames_.add(narrow);
  latency_.add(news.since_arrival);
  latencies_.add(std::array{static_cast<float>(t), static_cast<float>(news.since_arrival * kToMs)});
  const std::string waits = news.has_state ? "" : news.waiting_for;
  if (waits != waiting_for_) {
    waiting_for_ = waits;
    if (!waits.empty()) note(t, "waiting_for", waits);
  }
  frame_number_ = number;
  frame_ = news;
  if (state_number_ == 0) takeHealth(t, news.health, news.epoch);
}

void LiveDocument::takeState(LiveOutlet& outlet, double now) {
  const std::uint64_t number = outlet.state.refresh();
  // No states are taken before the first pose.
  if (number == state_number_ || !frame_ || (!state_ && !frame_->has_state)) return;
  const NavState state = outlet.state.value().state();
  const double t = seconds(state.stamp);
  if (state_ && state.stamp <= state_->stamp) {
    state_number_ = number;
    return;
  }
  if (state_) {
    const double interval =
        (state.stamp - state_->stamp).seconds() / static_cast<double>(number - state_number_);
    state_intervals_.add(std::array{static_cast<float>(t), static_cast<float>(interval * kToMs)});
  }
  duration_ = std::max(duration_, t);
  std::array<float, kStateColumns> row{};
  row[kTime] = static_cast<float>(t);
  const auto put = [&row](std::size_t first, const Eigen::Vector3d& value) {
    for (int axis = 0; axis < 3; ++axis)
      row[first + static_cast<std::size_t>(axis)] = static_cast<float>(value[axis]);
  };
  const auto sigma = [&state](int block) -> Eigen::Vector3d {
    return kSigmas * state.covariance.diagonal().segment<3>(3 * block).cwiseMax(0).cwiseSqrt();
  };
  put(kPosition, state.T_world_body.translation);
  put(kVelocity, state.v_world_body);
  put(kBiasGyro, state.bias_gyro);
  put(kBiasAccel, state.bias_accel);
  put(kSigmaPosition, sigma(1));
  put(kSigmaAttitude, sigma(0) * kToDegrees);
  put(kSigmaVelocity, sigma(2));
  row[kLargestSigma] = static_cast<float>(sigma(1).maxCoeff());
  // A failed state has no valid pose.
  if (state.health != Health::kFailed) states_.add(row);
  state_number_ = number;
  state_ = state;
  state_came_ = now;
  takeHealth(t, state.health, state.epoch);
}

void LiveDocument::takeHealth(double t, Health health, std::uint32_t epoch) {
  const std::string name(healthName(health));
  if (!spans_.empty()) {
    Json& last = spans_.back();
    last["to"] = std::max(last["to"].get<double>(), t);
    if (last["health"] == name && last["epoch"] == epoch) return;
    if (last["epoch"] != epoch) note(t, "reset", fmt::format("epoch {}", epoch));
  }
  spans_.push_back({{"from", t}, {"to", t}, {"health", name}, {"epoch", epoch}});
  if (spans_.size() > kMostSpans) spans_.pop_front();
  spans_changed_ = true;
  note(t, "health_changed", name);
}

void LiveDocument::takeVerdict(LiveOutlet& outlet, double now) {
  if (outlet.verdict.refresh() == 0) return;
  const Verdict& verdict = outlet.verdict.value();
  const bool supervised = verdict.ending || !verdict.stale(Stamp{} + Duration::fromSeconds(now));
  if (supervised != supervised_) {
    supervised_ = supervised;
    note(duration_, "supervisor", supervised ? "the supervisor is back" : kUnsupervised);
    patches_to_tables_ = 0;
  }
  const bool first = !verdict_;
  const bool arming_changed = first || verdict.arming_changes != verdict_->arming_changes;
  const bool troubles_changed = verdict.trouble_changes != (first ? 0 : verdict_->trouble_changes);
  if (troubles_changed) noteTroubles(verdict);
  if (arming_changed) {
    std::string text = verdict.arming.ready() ? "ready to arm" : "not ready:";
    for (const MissingCondition& missing : verdict.arming.missing) text += std::string(" ") + missing.name();
    note(duration_, "arming", std::move(text));
  }
  if (arming_changed || troubles_changed) patches_to_tables_ = 0;
  verdict_ = verdict;
}

void LiveDocument::noteTroubles(const Verdict& verdict) {
  for (const Trouble& trouble : verdict.troubles) {
    const bool known = verdict_ && std::ranges::any_of(verdict_->troubles, [&](const Trouble& before) {
                         return before.sameAs(trouble);
                       });
    if (known) continue;
    note(duration_, "supervisor",
         fmt::format("{} is {}: {}", trouble.name(), conditionName(trouble.condition), trouble.text.data()));
  }
  if (!verdict_) return;
  for (const Trouble& before : verdict_->troubles) {
    const bool stands = std::ranges::any_of(
        verdict.troubles, [&](const Trouble& trouble) { return trouble.row == before.row; });
    if (!stands) note(duration_, "supervisor", fmt::format("{} has recovered", before.name()));
  }
}

void LiveDocument::takeMesh(LiveOutlet& outlet) {
  const std::uint64_t number = outlet.mesh.refresh();
  if (number == mesh_number_) return;
  mesh_number_ = number;
  mesh_came_ = now_;
  const TriangleMesh mesh = toTriangleMesh(outlet.mesh.value());
  if (mesh.faces.empty()) return;
  mesh_ = surfaceJson("local_mesh", "local mesh", mesh);
  mesh_changed_ = true;
}

void LiveDocument::takeSurface(LiveOutlet& outlet, double now) {
  if (now - surface_asked_ >= kSurfacePeriod) {
    surface_asked_ = now;
    outlet.surface_wanted.store(true, std::memory_order_release);
  }
  outlet.correction.refresh();
  const std::uint64_t number = outlet.surface.refresh();
  if (number == surface_number_) return;
  surface_number_ = number;
  const SurfaceNews& surface = outlet.surface.value();
  if (surface.vertices.empty()) return;
  // The map's axes differ from the odometry's once loop closure has moved the map.
  const MapCorrection& correction = outlet.correction.value();
  const bool moved = outlet.correction.sequence() > 0 && state_ && correction.epoch == state_->epoch;
  const SE3 T_world_map = moved ? correction.T_map_world.inverse() : SE3();
  cloud_ = cloudJson("map", "map", surface.vertices, T_world_map, kMostCloudPoints);
  cloud_changed_ = true;
}

void LiveDocument::takeObstacle(LiveOutlet& outlet) {
  const std::uint64_t number = outlet.obstacle.refresh();
  if (number == obstacle_number_ || !begun_) return;
  obstacle_number_ = number;
  const ObstacleNews& news = outlet.obstacle.value();
  const DistanceSample& nearest = news.nearest;
  obstacles_.add(std::array{static_cast<float>(seconds(news.stamp)), static_cast<float>(nearest.distance),
                            static_cast<float>(nearest.known_to)});
}

void LiveDocument::note(double t, const char* name, std::string text) {
  events_.push_back({{"t", t}, {"name", name}, {"text", std::move(text)}});
  ++unsent_events_;
  if (events_.size() > kMostEvents) events_.pop_front();
  unsent_events_ = std::min(unsent_events_, events_.size());
}

Json LiveDocument::plotJson(const PlotPlan& plan, bool whole) const {
  const bool is_plan = plan.x != kTime;
  const std::size_t from = whole ? 0 : plan.table->unsent();
  Json json = {{"id", plan.id}};
  if (whole) {
    json["group"] = plan.group;
    json["title"] = plan.title;
    json["kind"] = is_plan ? "plan" : "time";
    json["x_label"] = is_plan ? "x [m]" : "time [s]";
    json["y_label"] = plan.y_label;
    if (is_plan) json["value_label"] = "3 sigma of position [m]";
  } else if (plan.table->replaced()) {
    json["replace"] = true;
  }
  json["series"] = Json::array();
  const std::string x = encoded(plan.table->column(plan.x, from));
  for (const Line& line : plan.lines) {
    Json series = {{"name", line.name}};
    if (whole) series["style"] = "line";
    series["count"] = plan.table->rows() - from;
    series["x"] = x;
    series["y"] = encoded(plan.table->column(line.column, from));
    if (is_plan) series["value"] = encoded(plan.table->column(kLargestSigma, from));
    json["series"].push_back(std::move(series));
  }
  return json;
}

Json LiveDocument::trajectoryJson(bool whole) const {
  const std::size_t from = whole ? 0 : states_.unsent();
  std::vector<float> points;
  for (std::size_t row = from; row < states_.rows(); ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) points.push_back(states_.column(kPosition + axis)[row]);
  }
  Json json = {{"name", "odometry"},
               {"style", "line"},
               {"count", states_.rows() - from},
               {"points", encoded(points)},
               {"value", encoded(states_.column(kLargestSigma, from))},
               {"value_label", "3 sigma of position [m]"}};
  if (!whole && states_.replaced()) json["replace"] = true;
  return json;
}

Json LiveDocument::poseJson() const {
  if (!state_) return nullptr;
  const SE3& pose = state_->T_world_body;
  const Eigen::Vector3d& p = pose.translation;
  const Eigen::Quaterniond q(pose.rotation);
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

Json LiveDocument::healthJson() const {
  if (!supervised_) return "unknown";
  if (verdict_) return healthName(verdict_->health);
  return spans_.empty() ? Json("nothing yet") : spans_.back()["health"];
}

Json LiveDocument::liveJson() const {
  Json json = {{"t", duration_},
               {"health", healthJson()},
               {"epoch", spans_.empty() ? Json(nullptr) : spans_.back()["epoch"]},
               {"waiting_for", waiting_for_},
               {"frames", frame_number_},
               {"states", state_number_},
               {"silent_s", state_ ? now_ - state_came_ : 0.0}};
  if (state_) {
    const NavState& state = *state_;
    const Eigen::Vector3d& p = state.T_world_body.translation;
    json["position"] = {p.x(), p.y(), p.z()};
    json["speed"] = state.v_world_body.norm();
  }
  if (frame_) json["at_rest"] = frame_->statistics.at_rest;
  if (!supervised_) json["unsupervised"] = kUnsupervised;
  if (verdict_ && supervised_) json.update(toJson(*verdict_));
  return json;
}

Json LiveDocument::tablesJson() const {
  Json rows = Json::array();
  Json troubles = Json::array();
  if (!verdict_) rows.push_back(Json::array({"nothing known yet", "", ""}));
  if (!supervised_) {
    rows.push_back(Json::array({"unknown", kUnsupervised, "look into events.log, start the program again"}));
  } else if (verdict_) {
    if (verdict_->arming.ready()) rows.push_back(Json::array({"ready to arm", "", ""}));
    for (const MissingCondition& missing : verdict_->arming.missing) {
      rows.push_back(Json::array({missing.name(), missing.text.data(), missing.remedy}));
    }
    for (const Trouble& trouble : verdict_->troubles) {
      troubles.push_back(
          Json::array({trouble.name(), conditionName(trouble.condition), trouble.text.data()}));
    }
  }
  Json tables = Json::array();
  tables.push_back(table("arming", "Arming", {"condition", "what is missing", "remedy"}, rows));
  tables.push_back(
      table("supervision", "Threads and sensors at fault", {"name", "condition", "why"}, troubles));
  const auto ms = [](double seconds) { return fmt::format("{:.2f}", seconds * kToMs); };
  tables.push_back(
      table("latency", "Image's arrival to its pose, wall time [ms]", {"frames seen", "50 %", "99 %", "most"},
            Json::array({Json::array({std::to_string(latency_.count()), ms(latency_.percentile(0.5)),
                                      ms(latency_.percentile(0.99)), ms(latency_.max())})})));
  Json counters = Json::array();
  const auto count = [&counters](const std::string& name, const std::string& value) {
    counters.push_back(Json::array({name, value}));
  };
  count("frames", std::to_string(frame_number_));
  count("states at IMU rate", std::to_string(state_number_));
  for (const auto& [name, value] : viewers_.items()) count("view: " + name, value.dump());
  tables.push_back(table("counters", "Counters", {"what", "count"}, counters));
  return tables;
}

Json LiveDocument::patch() {
  ++sequence_;
  Json json = {{"sequence", sequence_}, {"run", 0}, {"live", liveJson()}, {"duration", duration_}};
  if (spans_changed_) json["health"] = spans_;
  if (unsent_events_ > 0) {
    json["events"] = Json::array();
    for (std::size_t i = events_.size() - unsent_events_; i < events_.size(); ++i)
      json["events"].push_back(events_[i]);
  }
  json["plots"] = Json::array();
  for (const PlotPlan& plan : plans_) {
    if (plan.table->unsent() < plan.table->rows()) json["plots"].push_back(plotJson(plan, false));
  }
  if (patches_to_tables_-- <= 0) {
    json["tables"] = tablesJson();
    patches_to_tables_ = kPatchesBetweenTables - 1;
  }
  Json scene = Json::object();
  if (states_.unsent() < states_.rows()) scene["trajectories"] = Json::array({trajectoryJson(false)});
  if (mesh_changed_) scene["surfaces"] = Json::array({mesh_});
  if (cloud_changed_) scene["clouds"] = Json::array({cloud_});
  if (state_) scene["pose"] = poseJson();
  if (!scene.empty()) json["scene"] = std::move(scene);
  spans_changed_ = mesh_changed_ = cloud_changed_ = false;
  unsent_events_ = 0;
  for (LiveTable* one :
       {&states_, &frames_, &state_intervals_, &frame_intervals_, &latencies_, &obstacles_}) {
    one->sent();
  }
  return json;
}

Json LiveDocument::document() const {
  Json plots = Json::array();
  for (const PlotPlan& plan : plans_) plots.push_back(plotJson(plan, true));
  Json scene = {{"trajectories", Json::array({trajectoryJson(true)})},
                {"surfaces", Json::array()},
                {"clouds", Json::array()},
                {"pose", poseJson()},
                {"labels", labelsJson({})}};
  if (!mesh_.is_null()) scene["surfaces"].push_back(mesh_);
  if (!cloud_.is_null()) scene["clouds"].push_back(cloud_);
  Json run = {{"name", name_},
              {"first_image_ns", std::to_string(first_.ns)},
              {"duration", duration_},
              {"cameras", cameras_},
              {"missing", Json::array()},
              {"health", spans_},
              {"events", events_},
              {"plots", plots},
              {"tables", tablesJson()},
              {"scene", scene}};
  return {{"format", kReportFormat},
          {"program", versionText()},
          {"sequence", sequence_},
          {"live", liveJson()},
          {"runs", Json::array({run})}};
}

std::string LiveDocument::text() const {
  const Json live = liveJson();
  std::string text =
      fmt::format("{}, {:.1f} s\nhealth    {}\n", name_, duration_, live["health"].get<std::string>());
  if (!waiting_for_.empty()) text += fmt::format("waits for {}\n", waiting_for_);
  if (state_) {
    const NavState& s = *state_;
    const Eigen::Vector3d& p = s.T_world_body.translation;
    const Eigen::Vector3d& v = s.v_world_body;
    text +=
        fmt::format("epoch     {}\nposition  {:.3f} {:.3f} {:.3f} m\nvelocity  {:.3f} {:.3f} {:.3f} m/s\n",
                    s.epoch, p.x(), p.y(), p.z(), v.x(), v.y(), v.z());
  }
  if (frame_) {
    const FrameStatistics& s = frame_->statistics;
    text += fmt::format("features  {} tracks, {} and {} inliers by one and by both cameras\n", s.tracks,
                        s.inliers_mono, s.inliers_stereo);
    text += fmt::format("latency   {:.1f} ms from image to pose, 99 % {:.1f} ms\n",
                        frame_->since_arrival * kToMs, latency_.percentile(0.99) * kToMs);
  }
  if (!supervised_) {
    text += std::string(kUnsupervised) + "\n";
  } else if (verdict_) {
    for (const Trouble& trouble : verdict_->troubles) {
      text += fmt::format("{} is {}: {}\n", trouble.name(), conditionName(trouble.condition),
                          trouble.text.data());
    }
    text += describe(verdict_->arming) + "\n";
  }
  return text;
}

}  // namespace swiftlet
