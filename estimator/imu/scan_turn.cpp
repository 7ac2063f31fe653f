#include "estimator/imu/scan_turn.hpp"

#include "estimator/imu/preintegration.hpp"

namespace swiftlet {

ScanTurn scanTurn(std::span<const ImuSample> samples, Stamp middle, Duration readout,
                  const Eigen::Vector3d& bias_gyro, const GyroIntrinsics& intrinsics) {
  if (samples.empty() || readout.ns == 0) return {};
  const auto meanRate = [&](Stamp from, Stamp to) {
    Preintegration span;
    static_cast<void>(span.integrate(samples, from, to));  // fails without samples only
    return Eigen::Vector3d(intrinsics.rate(span.meanGyro()) - bias_gyro);
  };
  const Duration half{readout.ns / 2};
  ScanTurn turn;
  turn.before = meanRate(middle - half, middle);
  turn.after = samples.back().stamp >= middle + half
                   ? meanRate(middle, middle + half)
                   : Eigen::Vector3d(2 * turn.before - meanRate(middle - half - half, middle - half));
  return turn;
}

}  // namespace swiftlet
