// What is known of a calibration beforehand.

#include "estimator/smoother/calibration_state.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "drivers/simulated/rig_presets.hpp"
#include "estimator/messages/calibration_estimate.hpp"

using namespace swiftlet;

TEST_CASE("Calibration prior: the baseline keeps its length, whatever else moves", "[calibration]") {
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  CalibrationState state(rig, false, true);
  alignas(32) std::array<double, 12 * 12> memory{};
  MatrixMap H(memory.data(), 12, 12, Eigen::OuterStride<>(12));
  state.hold(H);
  const Eigen::Vector3d baseline = rig.T_body_cam[1].translation - rig.T_body_cam[0].translation;
  const Eigen::Vector3d along = baseline.normalized();
  const Eigen::Vector3d across = along.unitOrthogonal();
  const auto sigmas = [&](const Eigen::Vector3d& of_0, const Eigen::Vector3d& of_1) {
    Eigen::Matrix<double, 12, 1> d = Eigen::Matrix<double, 12, 1>::Zero();
    d.segment<3>(3) = of_0;
    d.segment<3>(9) = of_1;
    return std::sqrt(d.dot(H * d));
  };
  constexpr double kMillimetre = 1e-3;
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  const double lengthened = kMillimetre / (kBaselinePriorSigma * baseline.norm());  // 9 on EuRoC's rig
  CHECK(sigmas(none, kMillimetre * along) == Approx(std::hypot(lengthened, 0.5)));
  CHECK(sigmas(kMillimetre * along, kMillimetre * along) == Approx(0.5 * std::sqrt(2)));
  CHECK(sigmas(none, kMillimetre * across) == Approx(0.5));
}
