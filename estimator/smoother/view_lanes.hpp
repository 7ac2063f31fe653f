#pragma once
// Four views of one landmark at once: the reprojection of vision_factor.hpp with one view per vector lane.
//
// A view of a landmark takes a few dozen products of 3-vectors, too small to vectorize one by one but the
// same for every view. Residuals, Jacobians and weights equal those of the scalar functions to rounding
// (tests/smoother/test_lanes.cpp). Sums run over lanes first, in a fixed order: deterministic. Lanes are the
// compiler's vector extensions, compiled to the registers of the target.
// Frames, units as in vision_factor.hpp. Shapes: arrays of V, one number of four views each; 3 x 3 and 2 x 3
// matrices by columns, as in Eigen. V is only passed in memory, so that no interface depends on the
// instruction set. Cost: about 100 multiply-adds of V per group of four views. No allocation.

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "estimator/smoother/vision_factor.hpp"

// Put before a loop of fixed count over an array of V, which stays in registers only if unrolled.
#ifdef __clang__
#define SWIFTLET_UNROLL _Pragma("unroll")
#else
#define SWIFTLET_UNROLL _Pragma("GCC unroll 9")
#endif

namespace swiftlet::lanes {

inline constexpr std::size_t kLanes = 4;
using V = double __attribute__((vector_size(kLanes * sizeof(double))));
/// All bits set if true, as returned by comparisons of V.
using Mask = decltype(V{} < V{});

// Four numbers in memory, aligned or not.
inline void load(const double* from, V& v) { std::memcpy(&v, from, sizeof v); }
inline void store(const V& v, double* to) { std::memcpy(to, &v, sizeof v); }

inline double sum(const V& v) { return (v[0] + v[1]) + (v[2] + v[3]); }
inline bool any(const Mask& m) { return ((m[0] | m[1]) | (m[2] | m[3])) != 0; }
inline int count(const Mask& m) { return -static_cast<int>((m[0] + m[1]) + (m[2] + m[3])); }

/// Pointers to the data of four views. Lanes may be set in any order and may stay unset.
class ViewPointers {
 public:
  void set(std::size_t lane, const CameraPose& camera, const CameraSighting& view) {
    camera_[lane] = &camera;
    view_[lane] = &view;
    if (!any(used_)) first_ = lane;
    used_[lane] = -1;
  }
  [[nodiscard]] bool empty() const { return !any(used_); }
  [[nodiscard]] const Mask& used() const { return used_; }
  /// An unset lane returns the data of a set one, so that every lane computes with regular numbers.
  [[nodiscard]] const CameraPose& camera(std::size_t lane) const { return *camera_[at(lane)]; }
  [[nodiscard]] const CameraSighting& view(std::size_t lane) const { return *view_[at(lane)]; }

 private:
  [[nodiscard]] std::size_t at(std::size_t lane) const { return used_[lane] != 0 ? lane : first_; }

  const CameraPose* camera_[kLanes];
  const CameraSighting* view_[kLanes];
  std::size_t first_ = 0;
  Mask used_{};
};

/// Data of four views, and which of them are valid.
struct ViewGroup {
  V R_cam_world[9];
  V center[3];
  V bearing[3];
  V weight[6];
  Mask used;

  ViewGroup() = default;
  /// At least one lane must be set.
  explicit ViewGroup(const ViewPointers& p) : used(p.used()) {
    const double* R[kLanes];
    const double* c[kLanes];
    const float* m[kLanes];
    const float* W[kLanes];
    SWIFTLET_UNROLL
    for (std::size_t l = 0; l < kLanes; ++l) {
      R[l] = p.camera(l).R_cam_world.data();
      c[l] = p.camera(l).center.data();
      m[l] = p.view(l).bearing.data();
      W[l] = p.view(l).weight.data();
    }
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 9; ++k) R_cam_world[k] = V{R[0][k], R[1][k], R[2][k], R[3][k]};
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) center[k] = V{c[0][k], c[1][k], c[2][k], c[3][k]};
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) bearing[k] = V{m[0][k], m[1][k], m[2][k], m[3][k]};
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 6; ++k) weight[k] = V{W[0][k], W[1][k], W[2][k], W[3][k]};
    if (!p.camera(0).rows.none()) takeRows(p);
  }

 private:
  void takeRows(const ViewPointers& p);
};

// Like CameraPose::centerAt() and inMiddleRow(). The angle is below 0.2 rad; its sine and cosine are computed
// by series, to 1e-9.
inline void ViewGroup::takeRows(const ViewPointers& p) {
  V angle[3];
  for (std::size_t l = 0; l < kLanes; ++l) {
    const RowMotion& rows = p.camera(l).rows;
    const auto row = static_cast<double>(p.view(l).row);
    const double time = rows.readout * row;
    const Eigen::Vector3d& rate = row < 0 ? rows.before : rows.after;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      angle[k][l] = time * rate[i];
      center[k][l] += time * rows.velocity[i];
    }
  }
  const V square = angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2];
  const V first = 1.0 - square / 6.0 * (1.0 - square / 20.0);
  const V second = 0.5 - square / 24.0 * (1.0 - square / 30.0);
  const auto turn = [&](V& x, V& y, V& z) {
    const V once[3] = {angle[1] * z - angle[2] * y, angle[2] * x - angle[0] * z, angle[0] * y - angle[1] * x};
    x += first * once[0] + second * (angle[1] * once[2] - angle[2] * once[1]);
    y += first * once[1] + second * (angle[2] * once[0] - angle[0] * once[2]);
    z += first * once[2] + second * (angle[0] * once[1] - angle[1] * once[0]);
  };
  turn(bearing[0], bearing[1], bearing[2]);
  for (std::size_t i = 0; i < 2; ++i) turn(weight[i], weight[i + 2], weight[i + 4]);
}

/// Like reprojectionResidual(). If the point is not in front of a view, the measured ray is used instead: its
/// residual is zero and all numbers stay finite. The caller must give it weight zero.
struct Residuals {
  V arm[3];  ///< reference - centre
  V h[3];    ///< ray, camera axes
  V inverse_along;
  V r[2];
  Mask in_front;

  Residuals(const ViewGroup& view, const LandmarkPoint& point) {
    const V* const R = view.R_cam_world;
    const V* const m = view.bearing;
    const V* const W = view.weight;
    V x[3];
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      arm[k] = point.reference[i] - view.center[k];
      x[k] = point.bearing[i] + point.inverse_depth * arm[k];
    }
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < 3; ++i) h[i] = R[i] * x[0] + R[i + 3] * x[1] + R[i + 6] * x[2];
    V along = m[0] * h[0] + m[1] * h[1] + m[2] * h[2];
    const V squared_limit = kMinCosine * kMinCosine * (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    in_front = (along > 0.0) & (along * along > squared_limit);
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < 3; ++i) h[i] = in_front ? h[i] : m[i];
    along = in_front ? along : V{1, 1, 1, 1};
    inverse_along = 1.0 / along;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < 2; ++i) {
      r[i] = (W[i] * h[0] + W[i + 2] * h[1] + W[i + 4] * h[2]) * inverse_along;
    }
  }
};

/// Like reprojectionJacobians(), except for the columns of the pose, which are computed from these.
struct Jacobians {
  V G[2][3];      ///< d r / d h
  V M[2][3];      ///< d r / d (ray in world axes)
  V point[2][3];  ///< two tangent coordinates of the bearing, inverse depth

  Jacobians(const ViewGroup& view, const Residuals& at, const PointBasis& basis) {
    const V* const R = view.R_cam_world;
    const PointBasis& b = basis;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < 2; ++i) {
      SWIFTLET_UNROLL
      for (std::size_t k = 0; k < 3; ++k) {
        G[i][k] = (view.weight[i + 2 * k] - at.r[i] * view.bearing[k]) * at.inverse_along;
      }
      SWIFTLET_UNROLL
      for (std::size_t k = 0; k < 3; ++k) {
        M[i][k] = G[i][0] * R[3 * k] + G[i][1] * R[3 * k + 1] + G[i][2] * R[3 * k + 2];
      }
      point[i][0] = M[i][0] * b.b1[0] + M[i][1] * b.b1[1] + M[i][2] * b.b1[2];
      point[i][1] = M[i][0] * b.b2[0] + M[i][1] * b.b2[1] + M[i][2] * b.b2[2];
      point[i][2] = M[i][0] * at.arm[0] + M[i][1] * at.arm[1] + M[i][2] * at.arm[2];
    }
  }
};

/// The 3 x 3 system of the point and the cost, summed over views.
class PointSums {
 public:
  /// Weights of `residuals` like RobustWeight::cauchy(), zero where `counts` is false; adds their cost.
  void weigh(const Residuals& residuals, const Mask& counts, V& weight) {
    constexpr double kInverseSquaredScale = 1.0 / (kCauchyScale * kCauchyScale);
    const V* const r = residuals.r;
    const V one{1, 1, 1, 1};
    const V q = counts ? one + kInverseSquaredScale * (r[0] * r[0] + r[1] * r[1]) : one;
    weight = counts ? kInformationScale / q : V{};
    // log a + log b = log ab: one logarithm for many views. A residual is at most 1 / kMinCosine times the
    // scale of the lens in sigmas, so q is below 1e12 and the product cannot overflow before the limit is
    // checked.
    constexpr double kLimit = 1e200;
    product_ *= (q[0] * q[1]) * (q[2] * q[3]);
    if (product_ > kLimit) {
      logarithm_ += std::log(product_);
      product_ = 1;
    }
  }

  /// Adds w J^T J and w J^T r of one row of the Jacobian.
  void add(const V& weight, const V (&J)[3], const V& r) {
    const V wJ[3] = {weight * J[0], weight * J[1], weight * J[2]};
    h_[0] += wJ[0] * J[0];
    h_[1] += wJ[1] * J[0];
    h_[2] += wJ[2] * J[0];
    h_[3] += wJ[1] * J[1];
    h_[4] += wJ[2] * J[1];
    h_[5] += wJ[2] * J[2];
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) g_[k] += wJ[k] * r;
  }

  /// Both triangles.
  [[nodiscard]] Eigen::Matrix3d H() const {
    Eigen::Matrix3d H;
    H(0, 0) = sum(h_[0]);
    H(1, 0) = H(0, 1) = sum(h_[1]);
    H(2, 0) = H(0, 2) = sum(h_[2]);
    H(1, 1) = sum(h_[3]);
    H(2, 1) = H(1, 2) = sum(h_[4]);
    H(2, 2) = sum(h_[5]);
    return H;
  }
  [[nodiscard]] Eigen::Vector3d g() const { return {sum(g_[0]), sum(g_[1]), sum(g_[2])}; }
  [[nodiscard]] double cost() const {
    return 0.5 * kInformationScale * kCauchyScale * kCauchyScale * (logarithm_ + std::log(product_));
  }

 private:
  V h_[6]{};
  V g_[3]{};
  double product_ = 1;
  double logarithm_ = 0;
};

}  // namespace swiftlet::lanes
