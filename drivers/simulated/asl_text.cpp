#include "drivers/simulated/asl_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace swiftlet {
namespace {

std::string transformYaml(const SE3& T) {
  const Eigen::Matrix3d R = T.R();
  std::string text = "T_BS:\n  cols: 4\n  rows: 4\n  data: [";
  for (int row = 0; row < 3; ++row) {
    fmt::format_to(std::back_inserter(text), "{:.15g}, {:.15g}, {:.15g}, {:.15g},\n         ", R(row, 0),
                   R(row, 1), R(row, 2), T.translation[row]);
  }
  return text + "0.0, 0.0, 0.0, 1.0]\n";
}

}  // namespace

std::string cameraYaml(const CameraModel& camera, const SE3& T_body_cam, double rate_hz,
                       std::string_view origin, const std::string& extra) {
  const Eigen::Vector4d& k = camera.intrinsics();
  const Eigen::Vector4d& d = camera.distortion();
  const bool radtan = camera.kind() == CameraKind::kPinholeRadtan;
  return fmt::format(
      "sensor_type: camera\ncomment: {}\n{}rate_hz: {:g}\nresolution: [{}, {}]\ncamera_model: "
      "pinhole\n"
      "intrinsics: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]\ndistortion_model: {}\n"
      "distortion_coefficients: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]\n{}",
      origin, transformYaml(T_body_cam), rate_hz, camera.width(), camera.height(), k[0], k[1], k[2], k[3],
      radtan ? "radial-tangential" : "equidistant", d[0], d[1], d[2], d[3], extra);
}

std::string imuYaml(const ImuNoise& noise, std::string_view origin) {
  return fmt::format(
      "sensor_type: imu\ncomment: {}\n{}rate_hz: {:g}\ngyroscope_noise_density: {:g}\n"
      "gyroscope_random_walk: {:g}\naccelerometer_noise_density: {:g}\naccelerometer_random_walk: {:g}\n",
      origin, transformYaml(SE3()), noise.rate_hz, noise.gyro_density, noise.gyro_walk, noise.accel_density,
      noise.accel_walk);
}

std::string imuCsvHeader() {
  return "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
         "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
}

std::string imuCsvRow(const ImuSample& s) {
  return fmt::format("{},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g}\n", s.stamp.ns, s.gyro.x(),
                     s.gyro.y(), s.gyro.z(), s.accel.x(), s.accel.y(), s.accel.z());
}

std::string groundTruthCsv(const SplineTrajectory& trajectory, const SimulatedImu& imu, Stamp zero,
                           double rate_hz) {
  std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
      "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad "
      "s^-1], "
      "b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\n";
  for (std::size_t k = 0; k < imu.bias_gyro.size(); ++k) {
    const double seconds = static_cast<double>(k) / rate_hz;
    const MotionState state = trajectory.at(seconds);
    const Stamp stamp = zero + Duration{std::llround(static_cast<double>(k) * 1e9 / rate_hz)};
    const Eigen::Vector3d& p = state.T_world_body.translation;
    const Eigen::Quaterniond& q = state.T_world_body.rotation;
    const Eigen::Vector3d& v = state.v_world_body;
    fmt::format_to(std::back_inserter(text),
                   "{},{:.9f},{:.9f},{:.9f},{:.12f},{:.12f},{:.12f},{:.12f},{:.9f},{:.9f},{:.9f}", stamp.ns,
                   p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), v.x(), v.y(), v.z());
    for (const Eigen::Vector3d& b : {imu.bias_gyro[k], imu.bias_accel[k]}) {
      fmt::format_to(std::back_inserter(text), ",{:.9f},{:.9f},{:.9f}", b.x(), b.y(), b.z());
    }
    text += '\n';
  }
  return text;
}

std::string labelsCsv() {
  std::string text = "#id,name\n";
  for (std::size_t i = 0; i < kLabelCount; ++i) {
    fmt::format_to(std::back_inserter(text), "{},{}\n", i, labelName(static_cast<Label>(i)));
  }
  return text;
}

std::string meshPly(const SurfaceMesh& mesh) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\ncomment true surface, outward normals counter-clockwise\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nelement face {}\n"
      "property list uchar int vertex_indices\nproperty uchar label\nend_header\n",
      mesh.vertices.size(), mesh.triangles.size());
  for (const Eigen::Vector3f& v : mesh.vertices) {
    fmt::format_to(std::back_inserter(text), "{:.7g} {:.7g} {:.7g}\n", v.x(), v.y(), v.z());
  }
  for (const MeshTriangle& t : mesh.triangles) {
    fmt::format_to(std::back_inserter(text), "3 {} {} {} {}\n", t.vertex[0], t.vertex[1], t.vertex[2],
                   static_cast<int>(t.label));
  }
  return text;
}

std::string pointsPly(const std::vector<LabelledPoint>& points) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\ncomment surface points seen\nelement vertex {}\nproperty float x\nproperty "
      "float y\n"
      "property float z\nproperty uchar label\nend_header\n",
      points.size());
  for (const LabelledPoint& point : points) {
    fmt::format_to(std::back_inserter(text), "{:.6g} {:.6g} {:.6g} {}\n", point.position.x(),
                   point.position.y(), point.position.z(), static_cast<int>(point.label));
  }
  return text;
}

void writeText(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.flush();
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace swiftlet
