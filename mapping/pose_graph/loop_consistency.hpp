#pragma once
// Two chi-squared tests of loop closures against the odometry chain: a loop alone, and a pair of loops.
//
// With P the chain's poses (odometry_chain.hpp) and Z a loop's T_from_to <- Z Exp(zeta), cov(zeta) = R:
// alone   The cycle from -> to by the loop and back along the chain, at `to`:
//           e = Log(Z^-1 T_from_to), C = R + cov(chain from..to).
// pair    The cycle of loops a and b with the chain between their ends, at `to` of a:
//           X = Log of P_ja^-1 P_jb Z_b^-1 P_ib^-1 P_ia Z_a = (P_ib Z_b P_jb^-1 P_ja)^-1 (P_ia Z_a), i from,
//           j to C = R_a + B (Ad(P_jb) R_b Ad(P_jb)^T + S_J) B^T + A S_I A^T + s (B S_JI A^T + A S_JI B^T)
//         with B = Ad(P_ja^-1), A = Ad((P_ia Z_a)^-1), S_J and S_I the chain's sums between the loops' two
//         ends, and S_JI the sum over the steps in both. The cycle uses these steps twice, so their error
//         counts twice; s = -1 if the directions are opposite (the error then cancels except for the loop's
//         own rotation).
// Both give e^T C^-1 e, chi-squared distributed with the degrees of freedom of a pose if all is true. Most
// false loops pass a test with a large C: agreement counts only if chance would be unlikely to agree.
//
// A loop between two components has no cycle of its own; two such loops have one if they join the same two
// components. Cost of a pair: 0.7 us (space), 0.2 us (plane) if one of the two stays the same; no allocation.
// Source: Mangelson, Dominic, Eustice, Vasudevan, "Pairwise Consistent Measurement Set Maximization for
// Robust Multi-robot Map Merging", ICRA 2018, equations 3 and 4; the sums and their overlap are this
// project's.

#include <Eigen/Cholesky>
#include <cstdint>
#include <limits>

#include "mapping/pose_graph/odometry_chain.hpp"

namespace swiftlet {

/// Result of a test.
struct CycleTest {
  /// Infinite if the test is impossible (singular covariance, another pair of components).
  double chi_squared = std::numeric_limits<double>::infinity();
  /// Half the logarithm of det C: how vague the test is, see logChance().
  double log_deviation = 0;
};

/// e^T C^-1 e, and half the logarithm of det C.
template <typename Pose>
CycleTest cycleTest(const PoseMatrix<Pose>& covariance, const PoseVector<Pose>& error);

/// Logarithm of the chance that a loop with a random relative pose agrees as well as this one: the volume of
/// the ellipsoid of chi-squared up to that found (at least its mean for true loops), over the volume of all
/// rotations and the box of the scene. `log_box`: OdometryChain::logBox. Above 0 the test proves nothing.
template <typename Pose>
double logChance(const CycleTest& test, double log_box);

/// A loop prepared for the tests by chainLoop(), with `from` before `to`.
template <typename Pose>
struct ChainedLoop {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  std::uint32_t from_component = 0;
  std::uint32_t to_component = 0;
  Pose T_chain_loop;     ///< P_from Z: pose of `to` in from's component according to the loop
  Pose T_from_to_chain;  ///< P_from Z P_to^-1: takes coordinates of to's component to those of from's
  PoseMatrix<Pose> covariance = PoseMatrix<Pose>::Identity();  ///< R, at `to`
  PoseMatrix<Pose> carried = PoseMatrix<Pose>::Identity();     ///< Ad(P_to) R Ad(P_to)^T

  [[nodiscard]] bool withinComponent() const { return from_component == to_component; }
  [[nodiscard]] bool joinsSame(const ChainedLoop& other) const {
    return from_component == other.from_component && to_component == other.to_component;
  }
};

/// Inverse of an information matrix. Directions without information (or with negative) get a variance much
/// larger than all others (kUnknownVarianceRatio times the least), so that the tests ignore them.
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

/// Tests a loop alone; both its ends are in one component.
template <typename Pose>
CycleTest odometryTest(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop);

/// Tests one loop against others.
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
