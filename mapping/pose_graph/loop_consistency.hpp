#pragma once
// Two tests of loop closures against the odometry chain: each loop alone, and two loops against each other.
//
// With P the chain's poses (odometry_chain.hpp) and Z a loop's T_from_to <- Z Exp(zeta), cov(zeta) = R:
// alone   The cycle from -> to by the loop and back along the chain, at `to`:
//           e = Log(Z^-1 T_from_to), C = R + cov(chain from..to).
// pair    The cycle of loops a and b with the chain between their ends, at `to` of a:
//           X = Log of P_ja^-1 P_jb Z_b^-1 P_ib^-1 P_ia Z_a = (P_ib Z_b P_jb^-1 P_ja)^-1 (P_ia Z_a), i from,
//           j to C = R_a + B (Ad(P_jb) R_b Ad(P_jb)^T + S_J) B^T + A S_I A^T + s (B S_JI A^T + A S_JI B^T)
//         with B = Ad(P_ja^-1), A = Ad((P_ia Z_a)^-1), S_J and S_I the chain's sums between the loops' two
//         ends, S_JI that of the steps which are in both: the cycle goes along them twice and their error
//         comes twice, with s = -1 when in opposite directions (then it cancels but for the loop's own turn).
// Both give e^T C^-1 e: chi-squared with as many degrees of freedom as a pose when all is true. A test with a
// large C is passed by most false loops too: agreement says something only where chance would not agree.
//
// Loops between two components have no cycle of their own; two of them have one when they join the same two
// components. Cost of a pair: 0.7 us (space), 0.2 us (plane) when one of the two stays the same; no
// allocation. Source: Mangelson, Dominic, Eustice, Vasudevan, "Pairwise Consistent Measurement Set
// Maximization for Robust Multi-robot Map Merging", ICRA 2018, equations 3 and 4; the sums and their overlap
// are this project's.

#include <Eigen/Cholesky>
#include <cstdint>
#include <limits>

#include "mapping/pose_graph/odometry_chain.hpp"

namespace swiftlet {

/// What a test finds.
struct CycleTest {
  /// Infinite when the test cannot be made (singular covariance, another pair of components).
  double chi_squared = std::numeric_limits<double>::infinity();
  /// Half the logarithm of det C: how much room the test leaves, see logChance().
  double log_deviation = 0;
};

/// e^T C^-1 e and the room that it leaves.
template <typename Pose>
CycleTest cycleTest(const PoseMatrix<Pose>& covariance, const PoseVector<Pose>& error);

/// Logarithm of the chance that a loop with a random relative pose agrees as well as this: volume of the
/// ellipsoid of chi-squared up to that found (at least its mean for true loops) over that of all rotations
/// and the box of the scene, `log_box` (OdometryChain::logBox). Above 0 the test says nothing.
template <typename Pose>
double logChance(const CycleTest& test, double log_box);

/// A loop made ready for the tests. `from` is before `to`: the constructor turns it otherwise.
template <typename Pose>
struct ChainedLoop {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  std::uint32_t from_component = 0;
  std::uint32_t to_component = 0;
  Pose T_chain_loop;     ///< P_from Z: where the loop puts `to` in from's component
  Pose T_from_to_chain;  ///< P_from Z P_to^-1: takes coordinates of to's component to those of from's
  PoseMatrix<Pose> covariance = PoseMatrix<Pose>::Identity();  ///< R, at `to`
  PoseMatrix<Pose> carried = PoseMatrix<Pose>::Identity();     ///< Ad(P_to) R Ad(P_to)^T

  [[nodiscard]] bool withinComponent() const { return from_component == to_component; }
  [[nodiscard]] bool joinsSame(const ChainedLoop& other) const {
    return from_component == other.from_component && to_component == other.to_component;
  }
};

/// Inverse of an information matrix. Directions that it says nothing (or less) of get a variance that is
/// large beside all others (kUnknownVarianceRatio times the least), so that the tests do not look at them.
template <typename Matrix>
Matrix covarianceFromInformation(const Matrix& information);

/// Inverse of a covariance, symmetric.
template <typename Matrix>
Matrix informationFromCovariance(const Matrix& covariance) {
  const Matrix information = covariance.ldlt().solve(Matrix::Identity());
  return 0.5 * (information + information.transpose());
}

/// `loop.from` and `loop.to` must be in the chain.
template <typename Pose>
ChainedLoop<Pose> chainLoop(const OdometryChain<Pose>& chain, const RelativePose<Pose>& loop);

/// The test of a loop alone; `loop` within one component.
template <typename Pose>
CycleTest odometryTest(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop);

/// The test of one loop against others.
template <typename Pose>
class PairTest {
 public:
  PairTest(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop);
  [[nodiscard]] CycleTest against(const ChainedLoop<Pose>& other) const;

 private:
  const OdometryChain<Pose>& chain_;
  const ChainedLoop<Pose>& loop_;
  Pose T_to_;              ///< P_ja
  PoseMatrix<Pose> to_;    ///< B
  PoseMatrix<Pose> from_;  ///< A
};

}  // namespace swiftlet
