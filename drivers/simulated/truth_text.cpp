#include "drivers/simulated/truth_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace swiftlet {

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
