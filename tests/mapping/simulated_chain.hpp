#pragma once
// Odometry chains with known errors for tests of loop selection: a way that turns, and measurements of it.

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <vector>

#include "estimator/core/random.hpp"
#include "mapping/pose_graph/loop_consistency.hpp"
#include "mapping/pose_graph/odometry_chain.hpp"

namespace swiftlet {

template <typename Pose>
PoseVector<Pose> normalVector(const PoseMatrix<Pose>& covariance, Random& random) {
  PoseVector<Pose> normal;
  for (int k = 0; k < normal.size(); ++k) {
    normal[k] = random.normal();
  }
  return covariance.llt().matrixL() * normal;
}

/// Standard deviations of rotation [rad] and translation [m], with a correlation between neighbours.
template <typename Pose>
PoseMatrix<Pose> testCovariance(double sigma_rotation, double sigma_translation) {
  constexpr int kTurns = PoseSpace<Pose>::kRotationDof;
  PoseVector<Pose> sigma;
  sigma.setConstant(sigma_translation);
  sigma.template head<kTurns>().setConstant(sigma_rotation);
  PoseMatrix<Pose> correlation = PoseMatrix<Pose>::Identity();
  for (int k = 0; k + 1 < sigma.size(); ++k) {
    correlation(k, k + 1) = correlation(k + 1, k) = 0.3;
  }
  return sigma.asDiagonal() * correlation * sigma.asDiagonal();
}

template <typename Pose>
Pose testStep(std::uint32_t k) {
  PoseVector<Pose> xi = PoseVector<Pose>::Zero();
  xi[PoseSpace<Pose>::kRotationDof - 1] = 0.2 * std::sin(0.05 * k) + 0.02;
  xi[PoseSpace<Pose>::kRotationDof] = 1.0;
  xi[xi.size() - 1] += 0.1 * std::cos(0.3 * k);
  return poseExp(xi);
}

/// True poses, and an odometry of them with `steps` errors of the given covariance.
template <typename Pose>
struct SimulatedChain {
  std::vector<Pose> truth;
  OdometryChain<Pose> odometry;
  PoseMatrix<Pose> covariance;

  SimulatedChain(std::uint32_t poses, const PoseMatrix<Pose>& step_covariance, Random& random)
      : odometry(poses), covariance(step_covariance) {
    truth.emplace_back();
    (void)odometry.beginComponent();
    for (std::uint32_t k = 1; k < poses; ++k) {
      const Pose step = testStep<Pose>(k);
      truth.push_back(truth.back() * step);
      // True = measured Exp(xi).
      const Pose error = poseExp(normalVector<Pose>(covariance, random));
      (void)odometry.append(step * error.inverse(), covariance);
    }
  }

  RelativePose<Pose> loop(std::uint32_t from, std::uint32_t to, const PoseMatrix<Pose>& noise,
                          Random& random) const {
    const Pose T = truth[from].inverse() * truth[to];
    return {from, to, T * poseExp(normalVector<Pose>(noise, random)).inverse(), noise.inverse()};
  }
};

}  // namespace swiftlet
