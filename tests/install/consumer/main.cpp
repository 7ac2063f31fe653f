// Uses one compiled function and one type whose layout depends on the instruction set.
#include <cmath>
#include <cstdio>

#include "estimator/camera/rig.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/imu/preintegration.hpp"

int main() {
  const Eigen::Vector3d phi(0.1, -0.2, 0.3);
  const double error = (swiftlet::logSo3(swiftlet::expSo3(phi)) - phi).norm();

  // Half a second at 1 rad/s about z: the increment is a half radian, through the library's code.
  swiftlet::Preintegration increment({}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  for (int i = 0; i < 100; ++i) increment.integrate(0.005, Eigen::Vector3d(0, 0, 1), Eigen::Vector3d::Zero());
  const double turn = swiftlet::logSo3(increment.deltaRotation()).z();

  std::printf("round trip %.1e rad, half a second's turn %.6f rad\n", error, turn);
  return error < 1e-12 && std::abs(turn - 0.5) < 1e-9 ? 0 : 1;
}
