#include "firmware_host/lab/export/bag_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "drivers/recorded/log_messages.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"

namespace swiftlet {
namespace {

constexpr float kFullColour = 255;
constexpr std::uint8_t kMiddleGrey = 128;  // for vertices not seen by any image

template <typename Point>
void set(Point& to, const Eigen::Vector3d& from) {
  to.x = from.x();
  to.y = from.y();
  to.z = from.z();
}

template <typename Quaternion>
void set(Quaternion& to, const Eigen::Quaterniond& from) {
  to.x = from.x();
  to.y = from.y();
  to.z = from.z();
  to.w = from.w();
}

rosmsg::ColorRGBA colourOf(std::uint8_t red, std::uint8_t green, std::uint8_t blue) {
  rosmsg::ColorRGBA colour;
  colour.r = static_cast<float>(red) / kFullColour;
  colour.g = static_cast<float>(green) / kFullColour;
  colour.b = static_cast<float>(blue) / kFullColour;
  colour.a = 1;
  return colour;
}

using Colour = std::array<std::uint8_t, 3>;

/// The label's colour; the grey value if there is no label.
Colour surfaceColour(const TriangleMesh& mesh, std::uint32_t vertex, std::uint8_t label) {
  if (label != 0) return labelColour(label);
  const std::uint8_t grey = mesh.grey.empty() ? kMiddleGrey : mesh.grey[vertex];
  return {grey, grey, grey};
}

std::uint8_t levelOf(const std::string& health) {
  if (health == healthName(Health::kGood)) return rosmsg::DiagnosticStatus::kOk;
  return health == healthName(Health::kFailed) ? rosmsg::DiagnosticStatus::kError
                                               : rosmsg::DiagnosticStatus::kWarn;
}

/// `name` as grouped by rqt_robot_monitor: the part before the slash is one tree.
rosmsg::DiagnosticStatus statusOf(const char* name, std::uint8_t level, const std::string& message) {
  rosmsg::DiagnosticStatus status;
  status.name = name;
  status.hardware_id = "swiftlet";
  status.level = {level};
  status.message = message;
  return status;
}

void add(rosmsg::DiagnosticStatus& status, const char* key, const std::string& value) {
  status.values.push_back({key, value});
}

}  // namespace

rosmsg::PoseStamped bagPose(Stamp stamp, const std::string& frame, const SE3& T_frame_body) {
  rosmsg::PoseStamped pose;
  pose.header = bagHeader(stamp, frame);
  set(pose.pose.position, T_frame_body.translation);
  set(pose.pose.orientation, T_frame_body.rotation);
  return pose;
}

rosmsg::TransformStamped bagTransform(Stamp stamp, const std::string& frame, const std::string& child,
                                      const SE3& T_frame_child) {
  rosmsg::TransformStamped transform;
  transform.header = bagHeader(stamp, frame);
  transform.child_frame_id = child;
  set(transform.transform.translation, T_frame_child.translation);
  set(transform.transform.rotation, T_frame_child.rotation);
  return transform;
}

rosmsg::Odometry bagOdometry(const NavState& state, const RosFrames& frames) {
  rosmsg::Odometry odometry;
  odometry.header = bagHeader(state.stamp, frames.odom);
  odometry.child_frame_id = frames.body;
  set(odometry.pose.pose.position, state.T_world_body.translation);
  set(odometry.pose.pose.orientation, state.T_world_body.rotation);
  set(odometry.twist.twist.linear, bodyVelocity(state));
  Eigen::Map<RosCovariance>(odometry.pose.covariance.data()) = rosPoseCovariance(state);
  Eigen::Map<RosCovariance>(odometry.twist.covariance.data()) = rosTwistCovariance(state);
  return odometry;
}

rosmsg::Path bagPath(const std::string& frame, const Trajectory& trajectory) {
  rosmsg::Path path;
  path.header = bagHeader(trajectory.front().stamp, frame);
  path.poses.reserve(trajectory.size());
  for (const TrajectoryPoint& point : trajectory) {
    path.poses.push_back(bagPose(point.stamp, frame, point.T_world_body));
  }
  return path;
}

rosmsg::Vector3Stamped bagVector(Stamp stamp, const std::string& frame, const Eigen::Vector3d& vector) {
  rosmsg::Vector3Stamped message;
  message.header = bagHeader(stamp, frame);
  set(message.vector, vector);
  return message;
}

rosmsg::Marker bagMarker(Stamp stamp, const std::string& frame, const std::string& name,
                         const TriangleMesh& mesh) {
  rosmsg::Marker marker;
  marker.header = bagHeader(stamp, frame);
  marker.ns = name;
  marker.type = rosmsg::Marker::kTriangleList;
  marker.action = mesh.faces.empty() ? rosmsg::Marker::kDelete : rosmsg::Marker::kAdd;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = 1;
  marker.color = colourOf(kMiddleGrey, kMiddleGrey, kMiddleGrey);
  marker.points.reserve(3 * mesh.faces.size());
  marker.colors.reserve(3 * mesh.faces.size());
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    const std::uint8_t label = mesh.labels.empty() ? std::uint8_t{0} : mesh.labels[face];
    for (const std::uint32_t corner : mesh.faces[face]) {
      rosmsg::Point point;
      set(point, mesh.vertices[corner].cast<double>());
      marker.points.push_back(point);
      const auto [r, g, b] = surfaceColour(mesh, corner, label);
      marker.colors.push_back(colourOf(r, g, b));
    }
  }
  return marker;
}

rosmsg::PointCloud2 bagPoints(Stamp stamp, const std::string& frame, const TriangleMesh& mesh) {
  struct Point {
    float x = 0, y = 0, z = 0;
    std::uint32_t rgb = 0;
    std::uint32_t label = 0;
  };
  constexpr std::array<const char*, 5> kFields = {"x", "y", "z", "rgb", "label"};
  static_assert(sizeof(Point) == kFields.size() * sizeof(float));
  std::vector<std::uint8_t> labels(mesh.vertices.size(), 0);
  for (std::size_t face = 0; face < mesh.labels.size(); ++face) {
    for (const std::uint32_t corner : mesh.faces[face]) {
      if (labels[corner] == 0) labels[corner] = mesh.labels[face];
    }
  }
  rosmsg::PointCloud2 cloud;
  cloud.header = bagHeader(stamp, frame);
  for (std::uint32_t i = 0; i < kFields.size(); ++i) {
    rosmsg::PointField field;
    field.name = kFields[i];
    field.offset = i * static_cast<std::uint32_t>(sizeof(float));
    field.datatype = i + 1 < kFields.size() ? rosmsg::PointField::kFloat32 : rosmsg::PointField::kUint32;
    cloud.point_fields.push_back(field);
  }
  cloud.width = static_cast<std::uint32_t>(mesh.vertices.size());
  cloud.point_step = sizeof(Point);
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.data.resize(cloud.row_step);
  for (std::uint32_t i = 0; i < cloud.width; ++i) {
    const Eigen::Vector3f& p = mesh.vertices[i];
    const auto [r, g, b] = surfaceColour(mesh, i, labels[i]);
    const Point point{p.x(), p.y(), p.z(), std::uint32_t{r} << 16U | std::uint32_t{g} << 8U | b, labels[i]};
    std::memcpy(cloud.data.data() + i * sizeof(Point), &point, sizeof(Point));
  }
  return cloud;
}

Eigen::Vector3d bagSigma(const NavState& state, int first) {
  return state.covariance.diagonal().segment<3>(first).cwiseMax(0).cwiseSqrt();
}

rosmsg::Float64 bagLevel(Health health) {
  return {static_cast<double>(levelOf(std::string(healthName(health))))};
}

rosmsg::DiagnosticArray bagDiagnostics(const KeyframeState& keyframe) {
  const std::string health(healthName(keyframe.state.health));
  const FrameStatistics& figures = keyframe.statistics;
  rosmsg::DiagnosticStatus status = statusOf("swiftlet/keyframe", levelOf(health), health);
  add(status, "epoch", fmt::format("{}", keyframe.state.epoch));
  add(status, "at_rest", figures.at_rest ? "1" : "0");
  add(status, "tracks", fmt::format("{}", figures.tracks));
  add(status, "landmarks", fmt::format("{}", figures.landmarks));
  add(status, "inliers_mono", fmt::format("{}", figures.inliers_mono));
  add(status, "inliers_stereo", fmt::format("{}", figures.inliers_stereo));
  add(status, "track_length", fmt::format("{}", figures.track_length));
  add(status, "reprojection_rms", fmt::format("{}", figures.reprojection_rms));
  add(status, "imu_residual", fmt::format("{}", figures.imu_residual));
  add(status, "iterations", fmt::format("{}", figures.iterations));
  rosmsg::DiagnosticArray diagnostics;
  diagnostics.header = bagHeader(keyframe.state.stamp, "");
  diagnostics.status.push_back(status);
  return diagnostics;
}

rosmsg::DiagnosticArray bagDiagnostics(const EventLine& event, const std::string& health) {
  rosmsg::DiagnosticStatus status = statusOf("swiftlet/health", levelOf(health), health);
  rosmsg::DiagnosticStatus what = statusOf("swiftlet/event", rosmsg::DiagnosticStatus::kOk,
                                           event.text.empty() ? event.name : event.name + " " + event.text);
  add(what, "event", event.name);
  add(what, "value", event.text);
  rosmsg::DiagnosticArray diagnostics;
  diagnostics.header = bagHeader(event.stamp, "");
  diagnostics.status.push_back(status);
  diagnostics.status.push_back(what);
  return diagnostics;
}

}  // namespace swiftlet
