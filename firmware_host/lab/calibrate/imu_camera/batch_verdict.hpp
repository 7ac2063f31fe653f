#pragma once
// Results of the batch in users' units, and whether they can be trusted.

#include <array>

#include "firmware_host/lab/calibrate/imu_camera/batch_start.hpp"
#include "firmware_host/lab/calibrate/imu_camera/calibrate_imu_camera.hpp"

namespace swiftlet {

struct BatchVerdict {
  BatchVerdict(const ImuCameraInput& told, const BatchStart& begun) : input(told), start(begun) {}

  const ImuCameraInput& input;
  const BatchStart& start;
  bool rolling = false;
  bool settled = true;
  std::size_t outliers = 0;
  std::array<BatchState, 2> halves;
  std::array<Eigen::MatrixXd, 2> half_covariances;

  /// The solution without the reasons.
  [[nodiscard]] ImuCameraSolution solutionOf(const BatchProblem& problem) const;
  /// Adds the reasons.
  void judge(BatchProblem problem, ImuCameraSolution& solution) const;

 private:
  void judgeResiduals(const ImuCameraSolution& solution, std::vector<std::string>& reasons) const;
  /// `known`: whether the standard deviations are small enough.
  void judgeMotion(const BatchProblem& problem, bool known, std::vector<std::string>& reasons) const;
  void judgeMatrices(const ImuCameraSolution& solution, std::vector<std::string>& reasons) const;
  bool judgeSigmas(const ImuCameraSolution& solution, std::vector<std::string>& reasons) const;
  void judgeHalves(const BatchProblem& problem, std::vector<std::string>& reasons) const;
};

}  // namespace swiftlet
