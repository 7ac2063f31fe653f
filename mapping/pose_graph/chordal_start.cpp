#include "mapping/pose_graph/chordal_start.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "mapping/pose_graph/pose_error.hpp"

namespace swiftlet {
namespace {

// Damping as a share of the largest diagonal entry. It holds directions that edges do not determine
// (information without full rank) in place and is negligible for the others.
constexpr double kRelativeDamping = 1e-12;

double rotationWeight(const RelativePose<SE2>& edge) { return edge.information(0, 0); }

/// kappa of an isotropic rotation error with the same mean variance. If a direction has no information, the
/// mean information, so that the edge is not lost.
double rotationWeight(const RelativePose<SE3>& edge) {
  const Eigen::Matrix3d information = edge.information.topLeftCorner<3, 3>();
  const double mean = information.trace() / 3;
  const double determinant = information.determinant();
  constexpr double kSingular = 1e-9;  // of the mean's cube
  if (!(determinant > kSingular * mean * mean * mean)) return mean;
  return 3 / information.inverse().trace();
}

template <int kSpace>
using Square = Eigen::Matrix<double, kSpace, kSpace>;

/// The measured rotation M between the unknowns: x_to = M x_from.
Square<2> relation(const SE2& measured) { return measured.R(); }
Square<3> relation(const SE3& measured) { return measured.R().transpose(); }

/// The unknowns: in the plane the image of the x axis, in space the transposed rotation.
Eigen::Vector2d unknownsOf(const SE2& pose) { return {std::cos(pose.angle), std::sin(pose.angle)}; }
Eigen::Matrix3d unknownsOf(const SE3& pose) { return pose.R().transpose(); }

void takeRotation(const Eigen::Vector2d& x, SE2& pose) {
  if (x.squaredNorm() > 0) pose.angle = std::atan2(x.y(), x.x());
}

/// Nearest rotation in the Frobenius norm (Umeyama, PAMI 1991).
void takeRotation(const Eigen::Matrix3d& x, SE3& pose) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(x.transpose(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign(2, 2) = -1;
  pose.rotation = Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * sign * svd.matrixV().transpose()));
  pose.rotation.normalize();
}

template <int kSpace>
Eigen::VectorXd smallDamping(const BlockMatrix<kSpace>& matrix) {
  double largest = 0;
  for (const auto& block : matrix.diagonal) largest = std::max(largest, block.diagonal().maxCoeff());
  return Eigen::VectorXd::Constant(kSpace * static_cast<Eigen::Index>(matrix.diagonal.size()),
                                   kRelativeDamping * largest);
}

}  // namespace

template <typename Pose>
bool ChordalStart<Pose>::solveRotations(std::span<const RelativePose<Pose>> edges,
                                        std::span<const double> weights, const GraphLayout& layout,
                                        std::vector<Pose>& poses) {
  matrix_.reset(layout.unknowns, layout.pairs.size());
  constexpr int kSides = kSpace == 2 ? 1 : 3;
  solution_.setZero(static_cast<Eigen::Index>(layout.unknowns) * kSpace, kSides);
  const auto right = [&](std::uint32_t unknown) {
    return solution_.middleRows<kSpace>(static_cast<Eigen::Index>(unknown) * kSpace);
  };
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const RelativePose<Pose>& edge = edges[e];
    const double weight = weights[e] * rotationWeight(edge);
    const std::uint32_t from = layout.unknown[edge.from];
    const std::uint32_t to = layout.unknown[edge.to];
    const Square<kSpace> M = relation(edge.T_from_to);
    if (from != GraphLayout::kHeld) matrix_.diagonal[from].diagonal().array() += weight;
    if (to != GraphLayout::kHeld) matrix_.diagonal[to].diagonal().array() += weight;
    if (from == GraphLayout::kHeld && to != GraphLayout::kHeld) {
      right(to) += weight * M * unknownsOf(poses[edge.from]);
    } else if (to == GraphLayout::kHeld && from != GraphLayout::kHeld) {
      right(from) += weight * M.transpose() * unknownsOf(poses[edge.to]);
    } else if (layout.edge_pair[e] != GraphLayout::kNoPair) {
      if (layout.edge_reversed[e]) {
        matrix_.pairs[layout.edge_pair[e]] -= weight * M;
      } else {
        matrix_.pairs[layout.edge_pair[e]] -= weight * M.transpose();
      }
    }
  }
  if (!factor_.factor(matrix_, smallDamping(matrix_))) return false;
  factor_.solve(solution_);
  if (!solution_.allFinite()) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (layout.unknown[k] == GraphLayout::kHeld) continue;
    takeRotation(right(layout.unknown[k]), poses[k]);
  }
  return true;
}

template <typename Pose>
bool ChordalStart<Pose>::solvePositions(std::span<const RelativePose<Pose>> edges,
                                        std::span<const double> weights, const GraphLayout& layout,
                                        std::vector<Pose>& poses) {
  constexpr int kTurn = PoseSpace<Pose>::kRotationDof;
  matrix_.reset(layout.unknowns, layout.pairs.size());
  solution_.setZero(static_cast<Eigen::Index>(layout.unknowns) * kSpace, 1);
  // The problem is linear in the positions, so one step from any start, here zero, reaches the minimum.
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (layout.unknown[k] != GraphLayout::kHeld) poses[k].translation.setZero();
  }
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const RelativePose<Pose>& edge = edges[e];
    const std::uint32_t from = layout.unknown[edge.from];
    const std::uint32_t to = layout.unknown[edge.to];
    const PoseTangent<Pose> error = relativeError(edge.T_from_to, poses[edge.from], poses[edge.to]);
    const Square<kSpace> M = (poses[edge.from].R() * edge.T_from_to.R());
    const Square<kSpace> H =
        weights[e] * M * edge.information.template bottomRightCorner<kSpace, kSpace>() * M.transpose();
    const Eigen::Matrix<double, kSpace, 1> g =
        weights[e] * M * (edge.information.template bottomRows<kSpace>() * error);
    static_assert(kTurn + kSpace == PoseSpace<Pose>::kDof);
    if (from != GraphLayout::kHeld) {
      matrix_.diagonal[from] += H;
      solution_.middleRows<kSpace>(static_cast<Eigen::Index>(from) * kSpace) += g;
    }
    if (to != GraphLayout::kHeld) {
      matrix_.diagonal[to] += H;
      solution_.middleRows<kSpace>(static_cast<Eigen::Index>(to) * kSpace) -= g;
    }
    if (layout.edge_pair[e] != GraphLayout::kNoPair) matrix_.pairs[layout.edge_pair[e]] -= H;
  }
  if (!factor_.factor(matrix_, smallDamping(matrix_))) return false;
  factor_.solve(solution_);
  if (!solution_.allFinite()) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (layout.unknown[k] == GraphLayout::kHeld) continue;
    poses[k].translation =
        solution_.middleRows<kSpace>(static_cast<Eigen::Index>(layout.unknown[k]) * kSpace);
  }
  return true;
}

template <typename Pose>
Status ChordalStart<Pose>::run(std::span<const RelativePose<Pose>> edges, std::span<const double> weights,
                               const GraphLayout& layout, std::vector<Pose>& poses) {
  if (layout.unknowns == 0) return okStatus();
  factor_.prepare(layout.structure);
  std::vector<Pose> found = poses;
  if (!solveRotations(edges, weights, layout, found)) {
    return {StatusCode::kNumerical, "the rotations' linear system could not be factored"};
  }
  if (!solvePositions(edges, weights, layout, found)) {
    return {StatusCode::kNumerical, "the positions' linear system could not be factored"};
  }
  poses.swap(found);
  return okStatus();
}

template class ChordalStart<SE2>;
template class ChordalStart<SE3>;

}  // namespace swiftlet
