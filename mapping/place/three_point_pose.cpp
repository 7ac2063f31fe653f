#include "mapping/place/three_point_pose.hpp"

#include <cmath>

#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/real_roots.hpp"

namespace swiftlet {
namespace {

// A triangle whose height is below this part of its sides is a line.
constexpr double kMinSineOfTriangle = 1e-3;

// The cosines between bearings and the squared sides between points, both opposite to the same corner: index
// i stands for the two corners other than i.
struct Triangle {
  std::array<double, 3> side2{};
  std::array<double, 3> cosine{};
};

// Polynomial in v = distance 2 / distance 0.
Polynomial quartic(const Triangle& tri) {
  const double a2 = tri.side2[0];
  const double b2 = tri.side2[1];
  const double c2 = tri.side2[2];
  const double ca = tri.cosine[0];
  const double cb = tri.cosine[1];
  const double cg = tri.cosine[2];
  const double minus = (a2 - c2) / b2;
  const double plus = (a2 + c2) / b2;
  Polynomial p{};
  p[4] = (minus - 1) * (minus - 1) - 4 * c2 / b2 * ca * ca;
  p[3] = 4 * (minus * (1 - minus) * cb - (1 - plus) * ca * cg + 2 * c2 / b2 * ca * ca * cb);
  p[2] = 2 * (minus * minus - 1 + 2 * minus * minus * cb * cb + 2 * (b2 - c2) / b2 * ca * ca -
              4 * plus * ca * cb * cg + 2 * (b2 - a2) / b2 * cg * cg);
  p[1] = 4 * (-minus * (1 + minus) * cb + 2 * a2 / b2 * cg * cg * cb - (1 - plus) * ca * cg);
  p[0] = (1 + minus) * (1 + minus) - 4 * a2 / b2 * cg * cg;
  return p;
}

bool distances(const Triangle& tri, double v, std::array<double, 3>& s) {
  const double minus = (tri.side2[0] - tri.side2[2]) / tri.side2[1];
  const double denominator = 2 * (tri.cosine[2] - v * tri.cosine[0]);
  const double u = ((minus - 1) * v * v - 2 * minus * tri.cosine[1] * v + 1 + minus) / denominator;
  const double square = tri.side2[1] / (1 + v * v - 2 * v * tri.cosine[1]);
  if (!(v > 0) || !(u > 0) || !(square > 0) || !std::isfinite(u)) return false;
  s[0] = std::sqrt(square);
  s[1] = u * s[0];
  s[2] = v * s[0];
  return true;
}

}  // namespace

FixedVector<SE3, 4> poseFromThreePoints(const std::array<Eigen::Vector3d, 3>& points,
                                        const std::array<Eigen::Vector3d, 3>& bearings) {
  FixedVector<SE3, 4> poses;
  Triangle tri;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const std::size_t k = (i + 2) % 3;
    tri.side2[i] = (points[j] - points[k]).squaredNorm();
    tri.cosine[i] = bearings[j].dot(bearings[k]);
  }
  const double twice_area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(twice_area > kMinSineOfTriangle * std::sqrt(tri.side2[1] * tri.side2[2]))) return poses;
  const auto roots = realRoots(quartic(tri), 4);
  for (const double v : roots) {
    std::array<double, 3> s{};
    if (poses.full() || !distances(tri, v, s)) continue;
    const std::array<Eigen::Vector3d, 3> seen = {s[0] * bearings[0], s[1] * bearings[1], s[2] * bearings[2]};
    Alignment alignment;
    if (!alignRigid(seen, points, alignment).ok()) continue;
    (void)poses.tryPushBack(alignment.T_to_from);
  }
  return poses;
}

}  // namespace swiftlet
