#include "firmware_host/lab/calibrate/cameras/camera_bundle.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/core/median.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"
#include "firmware_host/lab/calibrate/cameras/lens_jacobian.hpp"

namespace swiftlet {
namespace {

constexpr int kMostSteps = 60;
constexpr double kSmallestGain = 1e-9;  ///< relative decrease of the cost that ends the solution
constexpr double kMostDamping = 1e8;
constexpr double kOutlierSigmas = 4;  ///< over two axes: exceeded by chance once in 3000 corners
constexpr int kMostRounds = 12;
constexpr std::size_t kFewestUsed = 6;  ///< corners of a view
/// Median length of two normal axes, in sigmas.
constexpr double kMedianLength = 1.1774;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

double cauchy(double squared, double scale) {
  return scale > 0 ? scale * scale * std::log1p(squared / (scale * scale)) : squared;
}

}  // namespace

struct CameraBundle::Block {
  Eigen::MatrixXd H;               ///< between globals
  Eigen::Matrix<double, -1, 6> W;  ///< between globals and pose
  Matrix6d V = Matrix6d::Zero();
  Eigen::VectorXd g;
  Vector6d pose_gradient = Vector6d::Zero();
  double cost = 0;

  explicit Block(int globals)
      : H(Eigen::MatrixXd::Zero(globals, globals)),
        W(Eigen::Matrix<double, -1, 6>::Zero(globals, 6)),
        g(Eigen::VectorXd::Zero(globals)) {}
};

void BundleView::add(const CalibrationTarget& target, std::size_t camera, const BoardView& view) {
  for (const BoardCorner& corner : view.corners) {
    corners.push_back({camera, corner.id, target.corner(corner.id), corner.pixel, true});
  }
}

bool CameraBundle::residual(const BundleView& view, const BundleCorner& corner, Eigen::Vector2d& r) const {
  Eigen::Vector3d p = view.T_cam0_board * corner.point;
  if (corner.camera == 1) p = T_cam1_cam0 * p;
  Eigen::Vector2d predicted;
  if (!lens[corner.camera].project(p, predicted)) return false;
  r = corner.pixel - predicted;
  return true;
}

double CameraBundle::medianResidual() const {
  std::vector<double> norms;
  for (const BundleView& view : views) {
    for (const BundleCorner& corner : view.corners) {
      Eigen::Vector2d r;
      norms.push_back(residual(view, corner, r) ? r.norm() : std::numeric_limits<double>::infinity());
    }
  }
  return norms.empty() ? 0 : medianOf(norms);
}

void CameraBundle::addCorner(const BundleView& view, const BundleCorner& corner, double robust_scale,
                             Block& block) const {
  const CameraModel& camera = lens[corner.camera];
  const Eigen::Vector3d p0 = view.T_cam0_board * corner.point;
  const bool second = corner.camera == 1;
  const Eigen::Vector3d p = second ? T_cam1_cam0 * p0 : p0;
  Eigen::Vector2d predicted;
  Matrix23d by_point;
  if (!camera.project(p, predicted, &by_point)) {
    block.cost += cauchy(kNoPixel * kNoPixel, robust_scale);
    return;
  }
  const Eigen::Vector2d r = corner.pixel - predicted;
  const double squared = r.squaredNorm();
  block.cost += cauchy(squared, robust_scale);
  const double weight = robust_scale > 0 ? 1 / (1 + squared / (robust_scale * robust_scale)) : 1;

  const Eigen::Matrix<double, 2, 8> by_lens = lensJacobian(camera, p);
  const Matrix23d by_p0 = second ? Matrix23d(by_point * T_cam1_cam0.R()) : by_point;
  Eigen::Matrix<double, 2, 6> by_pose;
  by_pose << -by_p0 * view.T_cam0_board.R() * hat(corner.point), by_p0;
  block.V.noalias() += weight * by_pose.transpose() * by_pose;
  block.pose_gradient.noalias() += weight * by_pose.transpose() * r;
  const int at = second ? 8 : 0;
  block.H.block<8, 8>(at, at).noalias() += weight * by_lens.transpose() * by_lens;
  block.W.block<8, 6>(at, 0).noalias() += weight * by_lens.transpose() * by_pose;
  block.g.segment<8>(at).noalias() += weight * by_lens.transpose() * r;
  if (!second) return;
  Eigen::Matrix<double, 2, 6> by_pair;
  by_pair << -by_point * T_cam1_cam0.R() * hat(p0), by_point;
  block.H.block<6, 6>(16, 16).noalias() += weight * by_pair.transpose() * by_pair;
  const Eigen::Matrix<double, 8, 6> mixed = weight * by_lens.transpose() * by_pair;
  block.H.block<8, 6>(8, 16) += mixed;
  block.H.block<6, 8>(16, 8) += mixed.transpose();
  block.W.block<6, 6>(16, 0).noalias() += weight * by_pair.transpose() * by_pose;
  block.g.segment<6>(16).noalias() += weight * by_pair.transpose() * r;
}

CameraBundle::Block CameraBundle::blockOf(const BundleView& view, double robust_scale) const {
  Block block(globalCount());
  for (const BundleCorner& corner : view.corners) {
    if (corner.used) addCorner(view, corner, robust_scale, block);
  }
  return block;
}

CameraBundle::Information CameraBundle::information(const BundleView& view) const {
  const Block block = blockOf(view, 0);
  return block.H - block.W * block.V.ldlt().solve(block.W.transpose());
}

CameraBundle::Information CameraBundle::information() const {
  Information sum = Information::Zero(globalCount(), globalCount());
  for (const BundleView& view : views) sum += information(view);
  return sum;
}

double CameraBundle::cost(double robust_scale) const {
  double sum = 0;
  for (const BundleView& view : views) {
    for (const BundleCorner& corner : view.corners) {
      Eigen::Vector2d r;
      if (!corner.used) continue;
      sum += cauchy(residual(view, corner, r) ? r.squaredNorm() : kNoPixel * kNoPixel, robust_scale);
    }
  }
  return sum;
}

CameraBundle CameraBundle::moved(const Eigen::VectorXd& globals, const std::vector<Vector6d>& poses) const {
  CameraBundle next = *this;
  for (std::size_t c = 0; c < camera_count; ++c) {
    next.lens[c] = movedLens(lens[c], globals.segment<8>(static_cast<Eigen::Index>(8 * c)));
  }
  const auto move = [](SE3& T, const Vector6d& step) {
    T = SE3(T.rotation * expSo3(step.head<3>()), T.translation + step.tail<3>());
  };
  if (camera_count == 2) move(next.T_cam1_cam0, globals.tail<6>());
  for (std::size_t i = 0; i < poses.size(); ++i) move(next.views[i].T_cam0_board, poses[i]);
  return next;
}

bool CameraBundle::solve(Terms terms, double robust_scale) {
  const int n = globalCount();
  double damping = 1e-4;
  for (int step = 0; step < kMostSteps; ++step) {
    std::vector<Block> blocks;
    blocks.reserve(views.size());
    double before = 0;
    for (const BundleView& view : views) {
      blocks.push_back(blockOf(view, robust_scale));
      before += blocks.back().cost;
    }
    bool better = false;
    while (!better && damping < kMostDamping) {
      Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n, n);
      Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
      for (const Block& block : blocks) {
        Matrix6d V = block.V;
        V.diagonal() *= 1 + damping;
        const Eigen::LDLT<Matrix6d> factor(V);
        S += block.H - block.W * factor.solve(block.W.transpose());
        S.diagonal() += damping * block.H.diagonal();
        g += block.g - block.W * factor.solve(block.pose_gradient);
      }
      for (std::size_t c = 0; terms == Terms::kOne && c < camera_count; ++c) {
        for (int k = 5; k < 8; ++k) {
          const auto held = static_cast<Eigen::Index>(8 * c) + k;
          S.row(held).setZero();
          S.col(held).setZero();
          S(held, held) = 1;
          g[held] = 0;
        }
      }
      // Scaled to a diagonal of one: the distortion terms differ by powers of the image's width.
      const Eigen::VectorXd scale = S.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd scaled = scale.asDiagonal() * S * scale.asDiagonal();
      const Eigen::VectorXd globals = scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(g)));
      std::vector<Vector6d> poses;
      for (const Block& block : blocks) {
        Matrix6d V = block.V;
        V.diagonal() *= 1 + damping;
        poses.emplace_back(V.ldlt().solve(block.pose_gradient - block.W.transpose() * globals));
      }
      if (globals.allFinite() &&
          std::all_of(poses.begin(), poses.end(), [](const Vector6d& p) { return p.allFinite(); })) {
        CameraBundle next = moved(globals, poses);
        const double after = next.cost(robust_scale);
        if (after < before) {
          *this = std::move(next);
          damping = std::max(0.1 * damping, 1e-12);
          if (before - after < kSmallestGain * before) return true;
          better = true;
          continue;
        }
        // At the minimum, only rounding decides.
        if (after - before < kSmallestGain * before && damping < 1) return true;
      }
      damping *= 10;
    }
    if (!better) return false;
  }
  return true;
}

bool CameraBundle::solveWithoutOutliers(double& sigma) {
  for (const double factor : {6.0, 3.0}) {
    const double median = medianResidual();
    if (!std::isfinite(median) || !solve(Terms::kAll, factor * std::max(median, 1e-6))) return false;
  }
  sigma = medianResidual() / kMedianLength;
  for (int round = 0; round < kMostRounds; ++round) {
    bool changed = false;
    for (BundleView& view : views) {
      for (BundleCorner& corner : view.corners) {
        Eigen::Vector2d r;
        const bool use = residual(view, corner, r) && r.norm() < kOutlierSigmas * sigma;
        changed = changed || use != corner.used;
        corner.used = use;
      }
    }
    const auto poor = [](const BundleView& view) {
      return static_cast<std::size_t>(std::count_if(view.corners.begin(), view.corners.end(),
                                                    [](const BundleCorner& c) { return c.used; })) <
             kFewestUsed;
    };
    changed = std::erase_if(views, poor) > 0 || changed;
    if (views.empty()) return false;
    if (!changed && round > 0) break;
    if (!solve(Terms::kAll, 0)) return false;
    double used = 0;
    for (const BundleView& view : views) {
      for (const BundleCorner& corner : view.corners) used += corner.used ? 1 : 0;
    }
    const double unknowns = globalCount() + 6.0 * static_cast<double>(views.size());
    sigma = std::sqrt(cost(0) / std::max(1.0, 2 * used - unknowns));
  }
  return true;
}

}  // namespace swiftlet
