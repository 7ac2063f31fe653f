#include "firmware_host/lab/export/run_bag.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "drivers/input/input_error.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/lab/export/bag_messages.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// A record's size is 32 bits and viewers hold a marker several times: 120 bytes per face.
constexpr std::size_t kMostFaces = 4'000'000;

// First indices of error states, in the order of nav_state.hpp.
constexpr int kAttitude = 0;
constexpr int kPosition = 3;
constexpr int kVelocity = 6;

/// Collects the messages, then writes them in the order of their stamps.
class RunBag {
 public:
  RunBag(const RunFolder& run, const BagTruth& truth, const RunBagOptions& options, MessageBag& bag)
      : run_(run), truth_(truth), frames_(options.frames), meshes_(options.meshes), bag_(bag) {}

  /// `log`: its messages are merged with those of the run; null: none.
  void write(LogBag* log) {
    log_ = log;
    plan();
    std::ranges::stable_sort(entries_, {}, &Entry::stamp);
    for (const Entry& entry : entries_) {
      if (log != nullptr) log->writeUntil(entry.stamp);
      entry.write();
    }
    if (log != nullptr) log->writeRest();
  }

 private:
  struct Entry {
    Stamp stamp;
    std::function<void()> write;
  };

  void plan() {
    planTransforms();
    planTrajectories();
    planKeyframes();
    planEvents();
    planTruth();
    if (meshes_) planMeshes();
  }

  /// `make` creates the message when it is written.
  template <typename Make>
  void at(Stamp stamp, const std::string& where, const std::string& topic, Make make, bool latched = false) {
    if (!bag_.holds(stamp)) {
      throw InputError(where, 0, "stamp", fmt::format("{} ns has no place in a ROS bag", stamp.ns),
                       "A bag holds times from 1 ns to the year 2106 (ROS 1) or 2038 (ROS 2); `--tum` takes "
                       "the others too");
    }
    entries_.push_back(
        {stamp, [this, stamp, topic, make, latched] { bag_.write(topic, stamp, make(), latched); }});
  }

  void planTransforms() {
    const std::string where = pathOf(run_.odometry_file);
    const Stamp first = run_.odometry.front().stamp;
    // A single message, because a player repeats only the last of a topic.
    if (run_.map.empty() || !truth_.poses.empty() || log_ != nullptr) {
      at(
          first, where, "/tf_static",
          [this, first] {
            rosmsg::TFMessage fixed;
            if (log_ != nullptr) fixed.transforms = log_->cameraTransforms(first);
            if (run_.map.empty()) fixed.transforms.push_back(mapTransform(first, {}));
            if (!truth_.poses.empty()) {
              fixed.transforms.push_back(
                  bagTransform(first, frames_.odom, frames_.truth, truth_.T_world_truth));
            }
            return fixed;
          },
          true);
    }
    const std::vector<SE3> corrections = mapCorrections(run_);
    for (std::size_t i = 0; i < run_.odometry.size(); ++i) {
      const TrajectoryPoint& point = run_.odometry[i];
      at(point.stamp, where, "/tf", [this, &point, correction = corrections[i]] {
        const rosmsg::TransformStamped body =
            bagTransform(point.stamp, frames_.odom, frames_.body, point.T_world_body);
        if (run_.map.empty()) return transforms({body});
        return transforms({mapTransform(point.stamp, correction), body});
      });
    }
  }

  void planTrajectories() {
    planPath("/swiftlet/path", frames_.odom, run_.odometry, pathOf(run_.odometry_file));
    planPoses("/swiftlet/pose", frames_.odom, run_.odometry, pathOf(run_.odometry_file));
    planPoses("/swiftlet/imu_rate", frames_.odom, run_.imu_rate, pathOf("imu_rate.tum"));
    planPath("/swiftlet/map_path", frames_.map, run_.map, pathOf("map.tum"));
  }

  void planKeyframes() {
    const std::string where = pathOf("states.csv");
    for (const KeyframeState& keyframe : run_.keyframes) {
      const NavState& state = keyframe.state;
      at(state.stamp, where, "/swiftlet/odometry", [this, &state] { return bagOdometry(state, frames_); });
      at(state.stamp, where, "/swiftlet/bias_gyro",
         [this, &state] { return bagVector(state.stamp, frames_.body, state.bias_gyro); });
      at(state.stamp, where, "/swiftlet/bias_accel",
         [this, &state] { return bagVector(state.stamp, frames_.body, state.bias_accel); });
      planFigures(keyframe, where);
      at(state.stamp, where, "/diagnostics", [&keyframe] { return bagDiagnostics(keyframe); });
    }
  }

  /// Values for plotting, one number per field, so that viewers need no formulas.
  void planFigures(const KeyframeState& keyframe, const std::string& where) {
    const NavState& state = keyframe.state;
    const auto vector = [&](const char* topic, const std::string& frame, const Eigen::Vector3d& value) {
      at(state.stamp, where, topic, [&state, &frame, value] { return bagVector(state.stamp, frame, value); });
    };
    vector("/swiftlet/velocity", frames_.odom, state.v_world_body);
    vector("/swiftlet/sigma_attitude", frames_.body, bagSigma(state, kAttitude));
    vector("/swiftlet/sigma_position", frames_.odom, bagSigma(state, kPosition));
    vector("/swiftlet/sigma_velocity", frames_.odom, bagSigma(state, kVelocity));
    const auto number = [&](const char* topic, rosmsg::Float64 value) {
      at(state.stamp, where, topic, [value] { return value; });
    };
    number("/swiftlet/health", bagLevel(state.health));
    number("/swiftlet/tracks", {static_cast<double>(keyframe.statistics.tracks)});
    number("/swiftlet/reprojection_rms", {keyframe.statistics.reprojection_rms});
    number("/swiftlet/imu_residual", {keyframe.statistics.imu_residual});
  }

  void planEvents() {
    std::string health(healthName(Health::kInitializing));
    for (const EventLine& event : run_.events) {
      if (event.name == eventName(EventKind::kHealthChanged)) health = event.text;
      at(event.stamp, pathOf("events.log"), "/diagnostics",
         [&event, health] { return bagDiagnostics(event, health); });
    }
  }

  void planTruth() {
    planPath("/truth/path", frames_.truth, truth_.poses, "the truth");
    planPoses("/truth/pose", frames_.truth, truth_.poses, "the truth");
  }

  void planMeshes() {
    const std::string where = pathOf("meshes/frames.csv");
    for (const MeshFrame& frame : run_.meshes) {
      planMesh("/swiftlet/frame_mesh", frames_.odom, frame.stamp, frame.frame_mesh, where);
      planMesh("/swiftlet/local_mesh", frames_.odom, frame.stamp, frame.horizon_mesh, where);
      planPoints("/swiftlet/local_points", frames_.odom, frame.stamp, frame.horizon_mesh, where);
    }
    const std::string odometry = pathOf(run_.odometry_file);
    planMesh("/swiftlet/local_mesh", frames_.odom, run_.odometry.back().stamp, run_.local_mesh, odometry);
    planPoints("/swiftlet/local_points", frames_.odom, run_.odometry.back().stamp, run_.local_mesh, odometry);
    planMesh("/swiftlet/map_mesh", frames_.map, run_.odometry.front().stamp, run_.map_mesh, odometry);
    planPoints("/swiftlet/map_points", frames_.map, run_.odometry.front().stamp, run_.map_mesh, odometry);
  }

  void planPoses(const std::string& topic, const std::string& frame, const Trajectory& trajectory,
                 const std::string& where) {
    for (const TrajectoryPoint& point : trajectory) {
      at(point.stamp, where, topic,
         [&frame, &point] { return bagPose(point.stamp, frame, point.T_world_body); });
    }
  }

  /// The whole path at its beginning: a path that grows with every pose would fill the bag.
  void planPath(const std::string& topic, const std::string& frame, const Trajectory& trajectory,
                const std::string& where) {
    if (trajectory.empty()) return;
    at(
        trajectory.front().stamp, where, topic, [&frame, &trajectory] { return bagPath(frame, trajectory); },
        true);
  }

  void planMesh(const std::string& topic, const std::string& frame, Stamp stamp, const std::string& mesh_file,
                const std::string& where) {
    if (mesh_file.empty()) return;
    const std::string name = topic.substr(topic.rfind('/') + 1);
    at(stamp, where, topic,
       [&frame, stamp, mesh_file, name] { return bagMarker(stamp, frame, name, readMesh(mesh_file)); });
  }

  /// The same surface as points, for viewers without triangles.
  void planPoints(const std::string& topic, const std::string& frame, Stamp stamp,
                  const std::string& mesh_file, const std::string& where) {
    if (mesh_file.empty()) return;
    at(stamp, where, topic,
       [&frame, stamp, mesh_file] { return bagPoints(stamp, frame, readMesh(mesh_file)); });
  }

  static TriangleMesh readMesh(const std::string& file) {
    TriangleMesh mesh = readPly(file);
    if (mesh.faces.size() > kMostFaces) {
      throw InputError(file, 0, "", fmt::format("{} faces are too many for one message", mesh.faces.size()),
                       "Export with --no-meshes and open map.glb beside the bag");
    }
    return mesh;
  }

  [[nodiscard]] rosmsg::TransformStamped mapTransform(Stamp stamp, const SE3& T_map_world) const {
    return bagTransform(stamp, frames_.map, frames_.odom, T_map_world);
  }
  static rosmsg::TFMessage transforms(std::initializer_list<rosmsg::TransformStamped> list) {
    rosmsg::TFMessage message;
    for (const rosmsg::TransformStamped& transform : list) message.transforms.push_back(transform);
    return message;
  }
  [[nodiscard]] std::string pathOf(const std::string& name) const { return fs::path(run_.path) / name; }

  const RunFolder& run_;
  const BagTruth& truth_;
  const RosFrames frames_;
  const bool meshes_;
  MessageBag& bag_;
  LogBag* log_ = nullptr;
  std::vector<Entry> entries_;
};

}  // namespace

void writeRunBag(const RunFolder& run, const BagTruth& truth, const RunBagOptions& options, MessageBag& bag,
                 LogBag* log) {
  RunBag(run, truth, options, bag).write(log);
}

}  // namespace swiftlet
