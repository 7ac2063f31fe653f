#include "mapping/pose_graph/loop_consistency.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace swiftlet {
namespace {

/// Large enough that tests ignore the direction, small enough for a Cholesky factor in doubles.
constexpr double kUnknownVarianceRatio = 1e9;

/// Volumes of the unit ball of 3 and 6 dimensions, and of all rotations as vectors of angles near the
/// identity.
constexpr double kBall3 = 4 * M_PI / 3;
constexpr double kBall6 = M_PI * M_PI * M_PI / 6;
constexpr double kTurns2 = 2 * M_PI;
constexpr double kTurns3 = 8 * M_PI * M_PI;

}  // namespace

template <typename Pose>
CycleTest cycleTest(const PoseMatrix<Pose>& covariance, const PoseVector<Pose>& error) {
  const Eigen::LLT<PoseMatrix<Pose>> llt(covariance);
  CycleTest test;
  if (llt.info() != Eigen::Success) {
    return test;
  }
  const double value = llt.matrixL().solve(error).squaredNorm();
  if (value >= 0) {  // not NaN
    test.chi_squared = value;
    test.log_deviation = std::log(llt.matrixLLT().diagonal().prod());
  }
  return test;
}

template <typename Matrix>
Matrix covarianceFromInformation(const Matrix& information) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(information);
  const double largest = eigen.eigenvalues().maxCoeff();
  if (!(largest > 0)) {
    return Matrix::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  const auto variances = eigen.eigenvalues().cwiseMax(largest / kUnknownVarianceRatio).cwiseInverse();
  return eigen.eigenvectors() * variances.asDiagonal() * eigen.eigenvectors().transpose();
}

template <typename Pose>
ChainedLoop<Pose> chainLoop(const OdometryChain<Pose>& chain, const RelativePose<Pose>& loop) {
  ChainedLoop<Pose> chained;
  chained.from = loop.from;
  chained.to = loop.to;
  chained.covariance = covarianceFromInformation(loop.information);
  Pose Z = loop.T_from_to;
  if (chained.from > chained.to) {
    // Z Exp(zeta) inverted is Z^-1 Exp(-Ad(Z) zeta).
    std::swap(chained.from, chained.to);
    const PoseMatrix<Pose> adjoint = poseAdjoint(Z);
    chained.covariance = (adjoint * chained.covariance * adjoint.transpose()).eval();
    Z = Z.inverse();
  }
  chained.from_component = chain.component(chained.from);
  chained.to_component = chain.component(chained.to);
  chained.T_chain_loop = chain.pose(chained.from) * Z;
  chained.T_from_to_chain = chained.T_chain_loop * chain.pose(chained.to).inverse();
  const PoseMatrix<Pose> to = poseAdjoint(chain.pose(chained.to));
  chained.carried = to * chained.covariance * to.transpose();
  return chained;
}

template <typename Pose>
double logChance(const CycleTest& test, double log_box) {
  constexpr int kDof = PoseSpace<Pose>::kDof;
  constexpr double kBall = kDof == 3 ? kBall3 : kBall6;
  constexpr double kTurns = kDof == 3 ? kTurns2 : kTurns3;
  return std::log(kBall / kTurns) + 0.5 * kDof * std::log(std::max(test.chi_squared, 1.0 * kDof)) +
         test.log_deviation - log_box;
}

template <typename Pose>
CycleTest odometryTest(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop) {
  const PoseMatrix<Pose> covariance = loop.covariance + chain.covariance(loop.from, loop.to);
  return cycleTest<Pose>(covariance, poseLog(loop.T_chain_loop.inverse() * chain.pose(loop.to)));
}

template <typename Pose>
PairTest<Pose>::PairTest(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop)
    : chain_(chain),
      loop_(loop),
      T_to_(chain.pose(loop.to)),
      to_(poseAdjoint(T_to_.inverse())),
      from_(poseAdjoint(loop.T_chain_loop.inverse())) {}

template <typename Pose>
CycleTest PairTest<Pose>::against(const ChainedLoop<Pose>& other) const {
  using Matrix = PoseMatrix<Pose>;
  if (!loop_.joinsSame(other)) {
    return {};
  }
  const auto [low_j, high_j] = std::minmax(loop_.to, other.to);
  const auto [low_i, high_i] = std::minmax(loop_.from, other.from);
  Matrix at_to = other.carried;
  if (low_j != high_j) {
    at_to += chain_.between(low_j, high_j);
  }
  Matrix covariance = loop_.covariance;
  Matrix half;
  half.noalias() = to_ * at_to;
  covariance.noalias() += half * to_.transpose();
  if (low_i != high_i) {
    half.noalias() = from_ * chain_.between(low_i, high_i);
    covariance.noalias() += half * from_.transpose();
  }
  const std::uint32_t low = std::max(low_i, low_j);
  const std::uint32_t high = std::min(high_i, high_j);
  if (low < high && loop_.withinComponent()) {
    // The cycle runs ja -> jb and ib -> ia.
    const bool same_direction = (loop_.to < other.to) == (other.from < loop_.from);
    half.noalias() = to_ * chain_.between(low, high);
    const Matrix cross = half * from_.transpose();
    const Matrix both = cross + cross.transpose();
    same_direction ? covariance += both : covariance -= both;
  }
  const Pose X = (other.T_from_to_chain * T_to_).inverse() * loop_.T_chain_loop;
  return cycleTest<Pose>(covariance, poseLog(X));
}

template CycleTest cycleTest<SE2>(const PoseMatrix<SE2>&, const PoseVector<SE2>&);
template CycleTest cycleTest<SE3>(const PoseMatrix<SE3>&, const PoseVector<SE3>&);
template PoseMatrix<SE2> covarianceFromInformation(const PoseMatrix<SE2>&);
template PoseMatrix<SE3> covarianceFromInformation(const PoseMatrix<SE3>&);
template ChainedLoop<SE2> chainLoop(const OdometryChain<SE2>&, const RelativePose<SE2>&);
template ChainedLoop<SE3> chainLoop(const OdometryChain<SE3>&, const RelativePose<SE3>&);
template double logChance<SE2>(const CycleTest&, double);
template double logChance<SE3>(const CycleTest&, double);
template CycleTest odometryTest(const OdometryChain<SE2>&, const ChainedLoop<SE2>&);
template CycleTest odometryTest(const OdometryChain<SE3>&, const ChainedLoop<SE3>&);
template class PairTest<SE2>;
template class PairTest<SE3>;

}  // namespace swiftlet
