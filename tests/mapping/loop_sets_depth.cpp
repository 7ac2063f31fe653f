#include "tests/mapping/loop_sets_depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <vector>

namespace swiftlet::loop_sets {
namespace {

constexpr double kNear = 0.05;  // m: what is nearer is not drawn

using Polygon = std::vector<Eigen::Vector3d>;

// What is left of a triangle in front of the near plane (Sutherland, Hodgman 1974).
Polygon clipNear(const Polygon& in) {
  Polygon out;
  for (std::size_t i = 0; i < in.size(); ++i) {
    const Eigen::Vector3d& a = in[i];
    const Eigen::Vector3d& b = in[(i + 1) % in.size()];
    if (a.z() >= kNear) out.push_back(a);
    if ((a.z() >= kNear) != (b.z() >= kNear)) out.push_back(a + (kNear - a.z()) / (b.z() - a.z()) * (b - a));
  }
  return out;
}

// 1/z is linear over the image.
void drawTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                  const Eigen::Vector4d& k, cv::Mat& depth) {
  const auto at = [&k](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(k[0] * p.x() / p.z() + k[2], k[1] * p.y() / p.z() + k[3], 1.0 / p.z());
  };
  const Eigen::Vector3d pa = at(a), pb = at(b), pc = at(c);
  const auto side = [](const Eigen::Vector3d& from, const Eigen::Vector3d& to, double x, double y) {
    return (to.x() - from.x()) * (y - from.y()) - (to.y() - from.y()) * (x - from.x());
  };
  const double area = side(pa, pb, pc.x(), pc.y());
  if (!(std::abs(area) > 0)) return;
  const auto low = [](double v) { return static_cast<int>(std::ceil(std::max(v, 0.0))); };
  const auto high = [](double v, int size) {
    return static_cast<int>(std::floor(std::min<double>(v, size - 1)));
  };
  const int y_end = high(std::max({pa.y(), pb.y(), pc.y()}), depth.rows);
  const int x_end = high(std::max({pa.x(), pb.x(), pc.x()}), depth.cols);
  for (int y = low(std::min({pa.y(), pb.y(), pc.y()})); y <= y_end; ++y) {
    for (int x = low(std::min({pa.x(), pb.x(), pc.x()})); x <= x_end; ++x) {
      const double wa = side(pb, pc, x, y) / area;
      const double wb = side(pc, pa, x, y) / area;
      const double wc = 1 - wa - wb;
      if (wa < 0 || wb < 0 || wc < 0) continue;
      const auto z = static_cast<float>(1.0 / (wa * pa.z() + wb * pb.z() + wc * pc.z()));
      float& drawn = depth.at<float>(y, x);
      if (drawn == 0 || z < drawn) drawn = z;
    }
  }
}

}  // namespace

cv::Mat depthInMetres(const std::string& path) {
  const cv::Mat raw = cv::imread(path, cv::IMREAD_UNCHANGED);
  cv::Mat depth;
  raw.convertTo(depth, CV_32F, 1e-3);
  depth.setTo(0, raw == 65535);
  return depth;
}

cv::Mat drawDepth(const TriangleMesh& mesh, const SE3& T_cam_world, const Eigen::Vector4d& pinhole,
                  cv::Size size) {
  cv::Mat depth(size, CV_32F, cv::Scalar(0));
  for (const auto& face : mesh.faces) {
    Polygon corners;
    for (const std::uint32_t v : face) corners.push_back(T_cam_world * mesh.vertices[v].cast<double>());
    const Polygon seen = clipNear(corners);
    for (std::size_t i = 2; i < seen.size(); ++i) drawTriangle(seen[0], seen[i - 1], seen[i], pinhole, depth);
  }
  return depth;
}

}  // namespace swiftlet::loop_sets
