#include "mapping/place/relative_pose.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Inner steps that place one point for a given pose: the system is nearly linear in the inverse depth.
constexpr int kPlaceSteps = 3;
// An inverse depth below minus this many sigma is behind the view.
constexpr double kBehindSigmas = 3.0;
// Two directions without depth: sine of their angle below which the point is taken at infinity.
constexpr double kMinSine = 1e-6;

using Basis = Eigen::Matrix<double, 3, 2>;

// Two unit vectors orthogonal to a unit vector, and to each other (Duff et al., 2017).
Basis tangentBasis(const Eigen::Vector3d& n) {
  const double sign = n.z() < 0 ? -1.0 : 1.0;
  const double a = -1.0 / (sign + n.z());
  const double b = n.x() * n.y() * a;
  Basis basis;
  basis << 1.0 + sign * n.x() * n.x() * a, b, sign * b, sign + n.y() * n.y() * a, -sign * n.x(), -n.y();
  return basis;
}

// Residuals of one match: old bearing (0, 1), old depth (2), new bearing (3, 4), new depth (5); rows of
// unknown depths stay zero. Derivatives by the point (offset, inverse depth) and by the pose.
struct Residuals {
  Vector6d r = Vector6d::Zero();
  Eigen::Matrix<double, 6, 3> by_point = Eigen::Matrix<double, 6, 3>::Zero();
  Eigen::Matrix<double, 6, 6> by_pose = Eigen::Matrix<double, 6, 6>::Zero();
  bool in_front = false;
};

Residuals residuals(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t, const MatchedPoint& m) {
  Residuals out;
  const PointView& o = m.old_view;
  const PointView& n = m.new_view;
  const Basis old_basis = tangentBasis(o.bearing);
  const Eigen::Vector3d raw = o.bearing + old_basis * m.offset;
  const double raw_length = raw.norm();
  const Eigen::Vector3d u = raw / raw_length;

  out.r.head<2>() = m.offset / o.bearing_sigma;
  out.by_point.topLeftCorner<2, 2>() = Eigen::Matrix2d::Identity() / o.bearing_sigma;
  if (o.hasDepth()) {
    out.r[2] = (m.inverse_depth - o.inverse_depth) / o.inverse_depth_sigma;
    out.by_point(2, 2) = 1.0 / o.inverse_depth_sigma;
  }
  // The point in the new view, times the inverse depth in the old one.
  const Eigen::Vector3d h = R_new_old * (u - m.inverse_depth * t);
  const double length = h.norm();
  const Eigen::Vector3d s = h / length;
  out.in_front = length > 0 && s.dot(n.bearing) > 0;
  // d h by the point and by T_old_new <- T_old_new (Exp(phi), delta): h -> Exp(-phi) h - rho delta.
  Eigen::Matrix3d h_by_point;
  h_by_point.leftCols<2>() = R_new_old * ((old_basis - u * (u.transpose() * old_basis)) / raw_length);
  h_by_point.col(2) = -R_new_old * t;
  Eigen::Matrix<double, 3, 6> h_by_pose;
  h_by_pose << hat(h), -m.inverse_depth * Eigen::Matrix3d::Identity();

  const Basis new_basis = tangentBasis(n.bearing);
  out.r.segment<2>(3) = new_basis.transpose() * s / n.bearing_sigma;
  const Eigen::Matrix<double, 2, 3> bearing_by_h =
      (new_basis.transpose() - (new_basis.transpose() * s) * s.transpose()) / (length * n.bearing_sigma);
  out.by_point.middleRows<2>(3) = bearing_by_h * h_by_point;
  out.by_pose.middleRows<2>(3) = bearing_by_h * h_by_pose;
  if (n.hasDepth()) {
    const double new_inverse = m.inverse_depth / length;
    out.r[5] = (new_inverse - n.inverse_depth) / n.inverse_depth_sigma;
    const Eigen::RowVector3d depth_by_h = -new_inverse / length / n.inverse_depth_sigma * s.transpose();
    out.by_point.row(5) = depth_by_h * h_by_point;
    out.by_point(5, 2) += 1.0 / (length * n.inverse_depth_sigma);
    out.by_pose.row(5) = depth_by_h * h_by_pose;
  }
  return out;
}

// Initial inverse depth in the old view.
double startInverseDepth(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t, const MatchedPoint& m) {
  if (m.old_view.hasDepth()) return m.old_view.inverse_depth;
  if (m.new_view.hasDepth() && m.new_view.inverse_depth > 0) {
    const Eigen::Vector3d p = R_new_old.transpose() * m.new_view.bearing / m.new_view.inverse_depth + t;
    return 1.0 / p.norm();
  }
  // s x (a - rho c) = 0 in the least-squares sense.
  const Eigen::Vector3d a = m.new_view.bearing.cross(R_new_old * m.old_view.bearing);
  const Eigen::Vector3d c = m.new_view.bearing.cross(R_new_old * t);
  const double square = c.squaredNorm();
  return square > kMinSine * kMinSine ? a.dot(c) / square : 0.0;
}

bool isBehind(const MatchedPoint& m, const Residuals& at, const Eigen::Matrix3d& H) {
  if (!at.in_front || !std::isfinite(m.inverse_depth)) return true;
  if (m.inverse_depth >= 0) return false;
  // 1 / H(2, 2) is the least possible variance of the inverse depth: the bound is strict on purpose.
  return m.inverse_depth < -kBehindSigmas / std::sqrt(std::max(H(2, 2), std::numeric_limits<double>::min()));
}

// A weak hold on the inverse depth (sigma 10 m^-1), for points without depth and parallax.
constexpr double kLooseInformation = 1e-2;

Eigen::Matrix3d pointSystem(const Residuals& at) {
  Eigen::Matrix3d H = at.by_point.transpose() * at.by_point;
  H(2, 2) += kLooseInformation;
  return H;
}

void placePoint(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t, MatchedPoint& m) {
  m.offset.setZero();
  m.inverse_depth = startInverseDepth(R_new_old, t, m);
  m.chi_squared = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kPlaceSteps; ++step) {
    const Residuals at = residuals(R_new_old, t, m);
    const Eigen::Vector3d d = pointSystem(at).inverse() * (at.by_point.transpose() * at.r);
    if (!d.allFinite()) return;
    m.offset -= d.head<2>();
    m.inverse_depth -= d[2];
  }
  const Residuals at = residuals(R_new_old, t, m);
  if (isBehind(m, at, pointSystem(at))) return;
  m.chi_squared = at.r.squaredNorm();
}

struct System {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();
  double cost = 0;
  double chi_squared = 0;
  double dof = 0;
  int equations = 0;  ///< as dof, without weights
  std::size_t used = 0;
};

// Huber's cost of a chi-square, and the equivalent weight. `threshold`: sigmas.
double huberCost(double chi_squared, double threshold) {
  const double limit = threshold * threshold;
  return chi_squared <= limit ? chi_squared : 2.0 * threshold * std::sqrt(chi_squared) - limit;
}
double huberWeight(double chi_squared, double threshold) {
  return chi_squared <= threshold * threshold ? 1.0 : threshold / std::sqrt(chi_squared);
}

void addMatch(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t, double huber, const MatchedPoint& m,
              System& system) {
  const double threshold = huber * std::sqrt(static_cast<double>(m.dof()));
  const Residuals at = residuals(R_new_old, t, m);
  const Eigen::Matrix<double, 3, 6> H_point_pose = at.by_point.transpose() * at.by_pose;
  const Eigen::Matrix3d inverse = pointSystem(at).inverse();
  const Eigen::Matrix<double, 6, 3> gain = H_point_pose.transpose() * inverse;
  const double weight = huberWeight(m.chi_squared, threshold);
  system.H.noalias() += weight * (at.by_pose.transpose() * at.by_pose);
  system.H.noalias() -= weight * (gain * H_point_pose);
  system.g.noalias() += weight * (at.by_pose.transpose() * at.r);
  system.g.noalias() -= weight * (gain * (at.by_point.transpose() * at.r));
  system.cost += huberCost(m.chi_squared, threshold);
  system.chi_squared += weight * m.chi_squared;
  system.dof += weight * m.dof();
  system.equations += m.dof();
  ++system.used;
}

double robustCost(double huber, std::span<const MatchedPoint> points) {
  double cost = 0;
  for (const MatchedPoint& m : points) {
    if (m.used) cost += huberCost(m.chi_squared, huber * std::sqrt(static_cast<double>(m.dof())));
  }
  return cost;
}

// Removes points behind a view from the refinement, because they have no gradient.
void dropBehind(std::span<MatchedPoint> points) {
  for (MatchedPoint& m : points) m.used = m.used && std::isfinite(m.chi_squared);
}

System assemble(const SE3& T_old_new, double huber, std::span<const MatchedPoint> points) {
  System system;
  const Eigen::Matrix3d R_new_old = T_old_new.R().transpose();
  for (const MatchedPoint& m : points) {
    if (m.used) addMatch(R_new_old, T_old_new.translation, huber, m, system);
  }
  return system;
}

struct Seed {
  double leverage = 0;  ///< share of the pose's degrees of freedom that this match determines
  std::size_t index = 0;
};

std::array<Seed, kSupportSeeds> greatestLeverage(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t,
                                                 double huber, std::span<const MatchedPoint> points,
                                                 const Matrix6d& covariance) {
  std::array<Seed, kSupportSeeds> seeds{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].used) continue;
    System match;
    addMatch(R_new_old, t, huber, points[i], match);
    Seed seed{(covariance * match.H).trace(), i};
    for (Seed& kept : seeds) {
      if (seed.leverage > kept.leverage) std::swap(seed, kept);
    }
  }
  return seeds;
}

}  // namespace

double matchGate(int dof) {
  constexpr std::array<double, 3> kGates = {9.0, 11.83, 14.16};
  return kGates[static_cast<std::size_t>(std::clamp(dof, 1, 3) - 1)];
}

void placePoints(const SE3& T_old_new, std::span<MatchedPoint> points) {
  const Eigen::Matrix3d R_new_old = T_old_new.R().transpose();
  for (MatchedPoint& m : points) placePoint(R_new_old, T_old_new.translation, m);
}

Status refineRelativePose(const RelativePoseSettings& settings, std::span<MatchedPoint> points,
                          SE3& T_old_new, RelativePoseFit& fit) {
  fit = RelativePoseFit{};
  SE3 T = T_old_new;
  placePoints(T, points);
  dropBehind(points);
  System system = assemble(T, settings.huber, points);
  for (; fit.steps < settings.steps; ++fit.steps) {
    // Count equations, not weights: far from the solution all weights are small.
    if (system.equations < 6) return {StatusCode::kDegenerate, "relative pose: too few matches"};
    const Eigen::LDLT<Matrix6d> solver(system.H);
    if (solver.info() != Eigen::Success || !solver.isPositive()) {
      return {StatusCode::kDegenerate, "relative pose: the matches do not determine it"};
    }
    const Vector6d step = -solver.solve(system.g);
    if (!step.allFinite()) return {StatusCode::kNumerical, "relative pose: a step is not finite"};
    // delta is in the axes of the new view.
    const SE3 next(T.rotation * expSo3(step.head<3>()), T.translation + T.rotation * step.tail<3>());
    placePoints(next, points);
    // Points behind a view have infinite cost, so steps that put any there are rejected.
    if (!(robustCost(settings.huber, points) < system.cost)) {
      placePoints(T, points);
      break;
    }
    T = next;
    system = assemble(T, settings.huber, points);
    if (step.head<3>().norm() < settings.converged && step.tail<3>().norm() < settings.converged) break;
  }
  if (system.dof < 6) return {StatusCode::kDegenerate, "relative pose: too few matches agree"};
  T_old_new = T;
  fit.information = system.H;
  fit.chi_squared = system.chi_squared;
  fit.dof = system.dof - 6;
  fit.used = system.used;
  return okStatus();
}

RelativePoseSupport relativePoseSupport(const RelativePoseSettings& settings,
                                        std::span<const MatchedPoint> points, const SE3& T_old_new,
                                        double reach) {
  constexpr double kUndetermined = std::numeric_limits<double>::infinity();
  // Least reciprocal condition of the information (1/rad^2 and 1/m^2); below, rounding dominates.
  constexpr double kLeastCondition = 1e-10;
  const Eigen::Matrix3d R_new_old = T_old_new.R().transpose();
  const System all = assemble(T_old_new, settings.huber, points);
  const Eigen::LDLT<Matrix6d> solver(all.H);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return {kUndetermined, kUndetermined};
  const Matrix6d covariance = solver.solve(Matrix6d::Identity());
  const std::array<Seed, kSupportSeeds> seeds =
      greatestLeverage(R_new_old, T_old_new.translation, settings.huber, points, covariance);
  RelativePoseSupport support;
  const double near = std::cos(reach);
  for (const Seed& seed : seeds) {
    if (!(seed.leverage > 0)) break;
    const MatchedPoint& middle = points[seed.index];
    System group;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const bool beside = points[k].old_view.bearing.dot(middle.old_view.bearing) >= near &&
                          points[k].new_view.bearing.dot(middle.new_view.bearing) >= near;
      if (!points[k].used || (!beside && k != seed.index)) continue;
      addMatch(R_new_old, T_old_new.translation, settings.huber, points[k], group);
    }
    const Eigen::LDLT<Matrix6d> rest(all.H - group.H);
    if (rest.info() != Eigen::Success || !rest.isPositive() || !(rest.rcond() > kLeastCondition)) {
      return {kUndetermined, kUndetermined};
    }
    const Vector6d shift = rest.solve(all.g - group.g);
    if (!shift.allFinite()) return {kUndetermined, kUndetermined};
    support.rotation_shift = std::max(support.rotation_shift, shift.head<3>().norm());
    support.translation_shift = std::max(support.translation_shift, shift.tail<3>().norm());
  }
  return support;
}

Matrix6d covarianceOfBody(const SE3& T_body_cam, const Matrix6d& covariance_of_cameras) {
  const Eigen::Matrix3d R = T_body_cam.R();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomRightCorner<3, 3>() = R;
  adjoint.bottomLeftCorner<3, 3>() = hat(T_body_cam.translation) * R;
  return adjoint * covariance_of_cameras * adjoint.transpose();
}

}  // namespace swiftlet
