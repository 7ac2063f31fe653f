// Preintegration on the real logs, over 1 s, beside a fine-step reference integrator.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/preintegration.hpp"
#include "tests/imu/recorded_imu.hpp"
#include "tests/support/skip_case.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

struct Motion {
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
  Eigen::Vector3d v = Eigen::Vector3d::Zero(), p = Eigen::Vector3d::Zero();
};

// Catmull-Rom through four readings.
Eigen::Vector3d cubic(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                      const Eigen::Vector3d& d, double s) {
  return b + 0.5 * s * ((c - a) + s * ((2 * a - 5 * b + 4 * c - d) + s * (3 * (b - c) + d - a)));
}

// Classical RK4 with 20 steps between samples; rate and force from the cubic.
Motion reference(const std::vector<ImuSample>& s, std::size_t from, std::size_t to, const Eigen::Vector3d& bg,
                 const Eigen::Vector3d& ba) {
  constexpr int kFine = 20;
  Motion m;
  for (std::size_t i = from; i < to; ++i) {
    const double h = (s[i + 1].stamp - s[i].stamp).seconds() / kFine;
    const auto gyro = [&](double u) -> Eigen::Vector3d {
      return cubic(s[i - 1].gyro, s[i].gyro, s[i + 1].gyro, s[i + 2].gyro, u) - bg;
    };
    const auto accel = [&](double u) -> Eigen::Vector3d {
      return cubic(s[i - 1].accel, s[i].accel, s[i + 1].accel, s[i + 2].accel, u) - ba;
    };
    for (int k = 0; k < kFine; ++k) {
      const double u0 = static_cast<double>(k) / kFine, um = (k + 0.5) / kFine, u1 = (k + 1.0) / kFine;
      const Eigen::Quaterniond q0 = m.R;
      const auto rate = [](const Eigen::Quaterniond& q, const Eigen::Vector3d& w) {
        const Eigen::Quaterniond product = q * Eigen::Quaterniond(0, w.x(), w.y(), w.z());
        return Eigen::Vector4d(0.5 * product.coeffs());
      };
      const auto moved = [&](const Eigen::Vector4d& d, double t) {
        return Eigen::Quaterniond(Eigen::Vector4d(q0.coeffs() + t * d));
      };
      const Eigen::Vector4d k1 = rate(q0, gyro(u0)), k2 = rate(moved(k1, h / 2), gyro(um)),
                            k3 = rate(moved(k2, h / 2), gyro(um)), k4 = rate(moved(k3, h), gyro(u1));
      const Eigen::Quaterniond middle = moved(k2, h / 2).normalized();
      m.R =
          Eigen::Quaterniond(Eigen::Vector4d(q0.coeffs() + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))).normalized();
      const Eigen::Vector3d a0 = q0 * accel(u0), am = middle * accel(um), a1 = m.R * accel(u1);
      m.p += h * m.v + h * h / 6 * (a0 + 2 * am);
      m.v += h / 6 * (a0 + 4 * am + a1);
    }
  }
  return m;
}

double median(std::vector<double>& v) {
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

struct Errors {
  std::vector<double> rotation, velocity, position;

  void add(const Motion& m, const TruthRow& a, const TruthRow& b, double gravity) {
    const double T = (b.stamp - a.stamp).seconds();
    const Eigen::Vector3d g(0, 0, -gravity);
    const Eigen::Quaterniond Rt = a.q.conjugate();
    rotation.push_back(logSo3(m.R.conjugate() * Rt * b.q).norm());
    velocity.push_back((Rt * (b.v - a.v - g * T) - m.v).norm());
    position.push_back((Rt * (b.p - a.p - a.v * T - 0.5 * g * T * T) - m.p).norm());
  }
};

}  // namespace

TEST_CASE("Preintegration over 1 s of the real logs beside a fine-step reference", "[figures]") {
  const ImuNoise noise;
  int logs = 0;
  for (const std::string& name : logNames("euroc_imu_gt_all")) {
    const RecordedLog log = readLog("euroc_imu_gt_all", name);
    const double truth_rate = static_cast<double>(log.truth.size() - 1) /
                              (log.truth.back().stamp - log.truth.front().stamp).seconds();
    const auto span = static_cast<std::size_t>(std::lround(truth_rate));
    Errors ours, fine;
    std::vector<double> velocity_noise, rotation_noise;
    std::size_t i = 1;
    for (std::size_t row = 5; row + span + 5 < log.truth.size(); row += span / 2) {
      const TruthRow& a = log.truth[row];
      const TruthRow& b = log.truth[row + span];
      while (i + 1 < log.imu.size() && log.imu[i].stamp < a.stamp - Duration::fromMilliseconds(1)) ++i;
      std::size_t j = i;
      while (j + 3 < log.imu.size() && log.imu[j].stamp < b.stamp - Duration::fromMilliseconds(1)) ++j;
      // The truth's rows coincide with samples but for some 100 ns; windows with a lost row do not count.
      if (std::abs((log.imu[i].stamp - a.stamp).seconds()) > 1e-5 ||
          std::abs((log.imu[j].stamp - b.stamp).seconds()) > 1e-5 || j + 3 >= log.imu.size()) {
        continue;
      }
      Preintegration imu(noise, a.bias_gyro, a.bias_accel);
      REQUIRE(imu.integrate(log.imu, log.imu[i].stamp, log.imu[j].stamp).ok());
      ours.add({imu.deltaRotation(), imu.deltaVelocity(), imu.deltaPosition()}, a, b, noise.gravity);
      fine.add(reference(log.imu, i, j, a.bias_gyro, a.bias_accel), a, b, noise.gravity);
      // The truth's own noise: its velocity beside its positions' central difference, its rotation
      // beside the gyro over one row.
      const TruthRow& next = log.truth[row + 1];
      const TruthRow& last = log.truth[row - 1];
      velocity_noise.push_back(((next.p - last.p) / (next.stamp - last.stamp).seconds() - a.v).norm());
      Preintegration one(noise, a.bias_gyro, a.bias_accel);
      REQUIRE(one.integrate(log.imu, a.stamp, next.stamp).ok());
      rotation_noise.push_back(logSo3(one.deltaRotation().conjugate() * a.q.conjugate() * next.q).norm());
    }
    REQUIRE(ours.rotation.size() > 50);
    ++logs;
    const double rotation = median(ours.rotation), velocity = median(ours.velocity),
                 position = median(ours.position);
    const double fine_rotation = median(fine.rotation), fine_velocity = median(fine.velocity),
                 fine_position = median(fine.position);
    std::printf(
        "1 s, %-15s %3zu windows: rotation %.4f deg (fine %.4f), velocity %.4f m/s (%.4f), position %.4f m "
        "(%.4f); truth's own: %.4f deg a row, %.4f m/s\n",
        name.c_str(), ours.rotation.size(), rotation * 57.29578, fine_rotation * 57.29578, velocity,
        fine_velocity, position, fine_position, median(rotation_noise) * 57.29578, median(velocity_noise));
    // No worse than the reference, to 2 % (the median's own scatter): what is left is the sensor's and the
    // truth's.
    CHECK(rotation < 1.02 * fine_rotation);
    CHECK(velocity < 1.02 * fine_velocity);
    CHECK(position < 1.02 * fine_position);
  }
  if (logs == 0) skipCase(noLogs("euroc_imu_gt_all"), kRunWithData);
}
