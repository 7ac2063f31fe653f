#include "firmware_host/outputs/ros2/dds_thread.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "drivers/dds/dds_link.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/ros2/ros_clock.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

constexpr double kSurfacePeriod = 2;      // s; maps are large and are rarely viewed more often
constexpr double kDiagnosticsPeriod = 1;  // s; changes of health are published at once
/// Longest interval between checks for labels and for images to be labelled [s]: at up to 1600 images a
/// second none is overwritten.
constexpr double kLabelPeriod = kKeptImages / 1600.0;
constexpr float kFullColour = 255;
constexpr const char* kCameraFrame = "cam0";

std::array<std::uint8_t, 3> colourOf(std::uint8_t label, std::uint8_t grey) {
  return label == 0 ? std::array{grey, grey, grey} : labelColour(label);
}

std::uint8_t levelOf(Health health) {
  if (health == Health::kGood) return 0;
  return health == Health::kFailed ? 2 : 1;
}

DdsObstacle::Point obstaclePoint(const ObstacleNews& news) {
  const DistanceSample& nearest = news.nearest;
  DdsObstacle::Point point;
  point.kind = static_cast<std::uint32_t>(nearest.kind);
  point.distance = static_cast<float>(nearest.distance);
  point.known_to = static_cast<float>(nearest.known_to);
  if (nearest.stale) point.age = static_cast<float>((news.stamp - nearest.up_to).seconds());
  // Zero if nothing is known, and at equal distance from two surfaces.
  if (!nearest.gradient.isZero()) {
    const Eigen::Vector3d normal_body = news.T_map_body.rotation.conjugate() * nearest.gradient;
    point.p = (-nearest.distance * normal_body).cast<float>();
    point.normal = normal_body.cast<float>();
  }
  return point;
}
static_assert(static_cast<int>(DistanceKind::kUnknown) == 0 &&
              static_cast<int>(DistanceKind::kAtLeast) == 1 &&
              static_cast<int>(DistanceKind::kDistance) == 2);

/// "1.25 m, 0.3 s old", "at least 2.00 m, 0.3 s old", "unknown here, 1.25 m, 0.3 s old", "unknown".
std::string obstacleText(const DistanceSample& nearest, Stamp now) {
  const char* before = "";
  if (nearest.kind == DistanceKind::kAtLeast) before = "at least ";
  if (nearest.kind == DistanceKind::kUnknown) {
    if (nearest.gradient.isZero()) return "unknown";
    before = "unknown here, ";
  }
  return fmt::format("{}{:.2f} m, {:.1f} s old", before, nearest.distance, (now - nearest.up_to).seconds());
}

/// diagnostic_msgs/DiagnosticStatus: STALE.
constexpr std::uint8_t kStaleLevel = 3;

}  // namespace

class DdsThread::Work final : public Follower::Work {
 public:
  Work(LiveOutlet& outlet, const DdsThreadOptions& options)
      : outlet_(outlet), options_(options), mesh_pace_{1 / options.settings.mesh_hz} {
    DdsSettings settings;
    settings.domain = static_cast<std::uint32_t>(options.settings.domain);
    settings.interface = options.settings.interface;
    settings.complain = [](std::string_view line) { warn("dds: " + std::string(line)); };
    if (options.labels != nullptr) settings.label_topic = options.settings.label_topic;
    if (!link_.open(settings)) {
      // A network interface may come up later: a service that ends with this exception is restarted, one that
      // ends with an InputError is not.
      throw std::runtime_error("settings: ros2.interface, ros2.domain: " + link_.error() +
                               ". Or disable it with ros2.enabled: false");
    }
    ThreadSettings thread;
    thread.name = "dds";
    thread_.start(thread, "settings", "ros2.enabled", [this] { run(); });
  }

  [[nodiscard]] nlohmann::ordered_json json() const override {
    const DdsCounters link = link_.counters();
    nlohmann::ordered_json json = {{"odometry", odometries_},       {"meshes", meshes_},
                                   {"surfaces", surfaces_},         {"obstacles", obstacles_},
                                   {"written", link.written},       {"refused", link.refused},
                                   {"complaints", link.complaints}, {"clock_steps", clock_.steps()}};
    if (options_.labels != nullptr) {
      const LabelExchange::Counters& labels = options_.labels->counters();
      json["labels"] = {{"images_shown", labels.shown},
                        {"received", link.images + link.images_refused + link.images_skipped},
                        {"used", labels.taken},
                        {"overrun", link.images_skipped},
                        {"wrong_encoding", link.images_refused},
                        {"wrong_size", labels.wrong_size},
                        {"unawaited", labels.unawaited}};
    }
    return json;
  }

 private:
  /// Limits the rate to once per period.
  struct Pace {
    double period;
    double next = 0;
    bool due(double now) {
      if (now < next) return false;
      next = now + period;
      return true;
    }
  };

  void run() {
    const double state_period = 1 / options_.settings.odometry_hz;
    const double turns = options_.labels != nullptr ? std::ceil(state_period / kLabelPeriod) : 1;
    double turn = 0;
    thread_.repeat(state_period / turns, [&](double now) {
      if (options_.clocks) clock_.follow(options_.clocks());
      if (turn == 0) publishState();
      turn = std::fmod(turn + 1, turns);
      if (options_.labels != nullptr) exchangeLabels(*options_.labels);
      publishDiagnostics(now);
      if (mesh_pace_.due(now)) publishMesh();
      publishSurface(now);
      publishObstacle();
    });
  }

  [[nodiscard]] Stamp ros(Stamp stamp) const { return clock_.toRos(stamp); }

  void publishState() {
    outlet_.correction.refresh();
    const std::uint64_t number = outlet_.state.refresh();
    if (number == state_) return;
    state_ = number;
    const NavState state = outlet_.state.value().state();
    if (state.health == Health::kFailed || judgedFailed()) return;  // there is no valid pose
    DdsOdometry odometry;
    odometry.stamp = ros(state.stamp);
    odometry.frame = frames_.odom;
    odometry.child_frame = frames_.body;
    odometry.T_frame_child = state.T_world_body;
    odometry.velocity = bodyVelocity(state);
    odometry.angular_velocity = outlet_.state.value().omegaBody();
    Eigen::Map<RosCovariance>(odometry.pose_covariance.data()) = rosPoseCovariance(state);
    Eigen::Map<RosCovariance>(odometry.twist_covariance.data()) =
        rosTwistCovariance(state, options_.gyro_sigma);
    if (link_.publish(odometry)) ++odometries_;
    const MapCorrection& now = outlet_.correction.value();
    const bool corrected = outlet_.correction.sequence() > 0 && now.epoch == state.epoch;
    const std::array<DdsTransform, 2> transforms = {
        DdsTransform{odometry.stamp, frames_.map, frames_.odom, corrected ? now.T_map_world : SE3()},
        DdsTransform{odometry.stamp, frames_.odom, frames_.body, state.T_world_body}};
    link_.publish(transforms);
  }

  /// The supervisor may know it before the estimator does.
  bool judgedFailed() {
    const bool judged = outlet_.verdict.refresh() > 0;
    const Verdict& verdict = outlet_.verdict.value();
    return judged && !verdict.stale(monotonicNow()) && verdict.health == Health::kFailed;
  }

  /// Publishes at once when something changes, and every second even if no frames arrive.
  void publishDiagnostics(double now) {
    const Stamp host = monotonicNow();
    const bool judged = outlet_.verdict.refresh() > 0;
    const Verdict& verdict = outlet_.verdict.value();
    const bool stale = judged && verdict.stale(host) && !verdict.ending;
    const bool any_frame = outlet_.frame.refresh() > 0;
    if (!judged && !any_frame) return;
    const Told told = {judged ? verdict.health : outlet_.frame.value().health, stale, verdict.trouble_changes,
                       verdict.arming_changes};
    const bool changed = told_ != told;
    if (!changed && !diagnostics_pace_.due(now)) return;
    told_ = told;
    const FrameNews& news = outlet_.frame.value();
    DdsStatus status;
    status.name = "swiftlet/health";
    status.level = stale ? kStaleLevel : levelOf(told.health);
    status.message = stale ? "supervisor stopped, health unknown" : std::string(healthName(told.health));
    if (!news.has_state)
      status.message += std::string(", waits for ") + (any_frame ? news.waiting_for : "images");
    if (judged && !stale) {
      for (const Trouble& trouble : verdict.troubles) {
        status.message += fmt::format("; {} is {}", trouble.name(), conditionName(trouble.condition));
      }
      status.values.push_back({"ready_to_arm", verdict.arming.ready() ? "1" : "0"});
      for (const MissingCondition& missing : verdict.arming.missing) {
        status.values.push_back({std::string("not_ready/") + missing.name(), missing.text.data()});
      }
      for (const Trouble& trouble : verdict.troubles) {
        status.values.push_back(
            {fmt::format("{}/{}", conditionName(trouble.condition), trouble.name()),
             fmt::format("{}; since {:.1f} s", trouble.text.data(), (host - trouble.since).seconds())});
      }
    }
    if (any_frame) addFigures(news, status);
    const Stamp stamp = stampOfNow(host);
    if (obstacle_ > 0) {
      status.values.push_back({"nearest_obstacle", obstacleText(outlet_.obstacle.value().nearest, stamp)});
    }
    if (const MapCorrection& map = outlet_.correction.value(); map.kept_map) {
      status.values.push_back({"kept_map", map.located ? "located" : "searching"});
    }
    status.values.push_back({"dds_refused", std::to_string(link_.counters().refused)});
    link_.publish(ros(stamp), {&status, 1});
  }

  /// Current time on the run's clock: the newest frame's stamp, extrapolated by the host's clock.
  Stamp stampOfNow(Stamp host) {
    if (outlet_.frame.sequence() == 0) return host;
    if (outlet_.frame.sequence() != frame_) {
      frame_ = outlet_.frame.sequence();
      frame_came_ = host;
    }
    return outlet_.frame.value().stamp + (host - frame_came_);
  }

  static void addFigures(const FrameNews& news, DdsStatus& status) {
    const FrameStatistics& figures = news.statistics;
    const auto add = [&status](const char* key, std::string value) {
      status.values.push_back({key, std::move(value)});
    };
    add("epoch", std::to_string(news.epoch));
    add("at_rest", figures.at_rest ? "1" : "0");
    add("tracks", std::to_string(figures.tracks));
    add("landmarks", std::to_string(figures.landmarks));
    add("inliers_mono", std::to_string(figures.inliers_mono));
    add("inliers_stereo", std::to_string(figures.inliers_stereo));
    add("reprojection_rms", fmt::format("{:.4f}", figures.reprojection_rms));
    add("imu_residual", fmt::format("{:.4f}", figures.imu_residual));
  }

  void publishMesh() {
    const std::uint64_t number = outlet_.mesh.refresh();
    if (number == mesh_) return;
    mesh_ = number;
    const LocalMesh& mesh = outlet_.mesh.value();
    points_.clear();
    colours_.clear();
    for (const MeshFace& face : mesh.faces) {
      for (const std::uint32_t corner : face.vertex) {
        points_.push_back(mesh.vertices[corner].p_world);
        const auto [r, g, b] = colourOf(face.label, mesh.vertices[corner].grey);
        colours_.push_back(Eigen::Vector3f(r, g, b) / kFullColour);
      }
    }
    if (link_.publish(DdsMesh{ros(mesh.stamp), frames_.odom, points_, colours_})) ++meshes_;
  }

  void publishSurface(double now) {
    if (surface_pace_.due(now)) outlet_.surface_wanted.store(true, std::memory_order_release);
    const std::uint64_t number = outlet_.surface.refresh();
    if (number == surface_) return;
    surface_ = number;
    const SurfaceNews& surface = outlet_.surface.value();
    cloud_.clear();
    for (const SurfaceVertex& vertex : surface.vertices) {
      const Eigen::Vector3f& p = vertex.p_world;
      const auto [r, g, b] = colourOf(vertex.label, vertex.grey);
      const std::uint32_t rgb =
          (static_cast<std::uint32_t>(r) << 16U) | (static_cast<std::uint32_t>(g) << 8U) | b;
      cloud_.push_back({p.x(), p.y(), p.z(), rgb, vertex.label});
    }
    if (link_.publish(DdsCloud{ros(surface.stamp), frames_.map, cloud_})) ++surfaces_;
  }

  void publishObstacle() {
    const std::uint64_t number = outlet_.obstacle.refresh();
    if (number == obstacle_) return;
    obstacle_ = number;
    const ObstacleNews& news = outlet_.obstacle.value();
    if (link_.publish(DdsObstacle{ros(news.stamp), frames_.body, obstaclePoint(news)})) ++obstacles_;
  }

  void exchangeLabels(LabelExchange& labels) {
    labels.setLabeller(link_.labellers() > 0);
    while (labels.show([this](Stamp stamp, const ImageView& image) {
      link_.publish(DdsImageView{clock_.toRosAndBack(stamp), kCameraFrame, image});
    })) {
    }
    labels.retryEarly();
    for (int i = 0; i < kKeptImages && link_.takeLabels(label_); ++i) {
      labels.offer(clock_.fromRos(label_.stamp),
                   {label_.pixels.data(), label_.width, label_.height, label_.width});
    }
  }

  LiveOutlet& outlet_;
  const DdsThreadOptions options_;
  const RosFrames frames_;
  RosClock clock_;
  DdsLink link_;
  Pace mesh_pace_;
  Pace surface_pace_{kSurfacePeriod};
  Pace diagnostics_pace_{kDiagnosticsPeriod};
  /// State of the last published diagnostics.
  struct Told {
    Health health = Health::kInitializing;
    bool stale = false;
    std::uint32_t troubles = 0, arming = 0;
    bool operator==(const Told&) const = default;
  };
  std::optional<Told> told_;
  std::uint64_t frame_ = 0;  ///< number of the newest frame seen by diagnostics
  Stamp frame_came_;
  std::uint64_t state_ = 0, mesh_ = 0, surface_ = 0, obstacle_ = 0;           ///< numbers taken
  std::uint64_t odometries_ = 0, meshes_ = 0, surfaces_ = 0, obstacles_ = 0;  ///< published
  std::vector<Eigen::Vector3f> points_, colours_;
  std::vector<DdsCloudPoint> cloud_;
  DdsImage label_;
};

DdsThread::DdsThread(LiveOutlet& outlet, const DdsThreadOptions& options)
    : Follower(std::make_unique<Work>(outlet, options)) {}

}  // namespace swiftlet
