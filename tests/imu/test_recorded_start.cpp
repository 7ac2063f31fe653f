// Starts in motion cut from the real IMU logs: tilt, velocity and scale against truth.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/imu/mono_start.hpp"
#include "tests/imu/analytic_trajectory.hpp"
#include "tests/imu/recorded_imu.hpp"
#include "tests/support/long_run.hpp"
#include "tests/support/skip_case.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

constexpr double kDegrees = 180.0 / 3.14159265358979;

struct Start {
  std::size_t log;
  std::size_t truth;  // row of image 0
};

// Extrinsics like those of EuRoC's left camera.
SE3 cameraOnBody() {
  Eigen::Matrix3d R;
  R << 0.0149, -0.9999, 0.0041, 0.9996, 0.0150, 0.0257, -0.0258, 0.0037, 0.9997;
  return {R, Eigen::Vector3d(-0.0216, -0.0647, 0.0098)};
}

class Starts {
 public:
  Starts() {
    for (const std::string& name : logNames("euroc_imu_gt_all")) {
      // V1_01's truth has 20 Hz only: left out.
      if (name == "V1_01_easy") continue;
      logs_.push_back(readLog("euroc_imu_gt_all", name));
    }
    if (logs_.empty()) return;
    Random random(2024);
    for (int tries = 0; starts_.size() < 200 && tries < 20000; ++tries) {
      const auto l = static_cast<std::size_t>(random.below(static_cast<std::uint32_t>(logs_.size())));
      const auto& truth = logs_[l].truth;
      const auto row =
          static_cast<std::size_t>(200 + random.below(static_cast<std::uint32_t>(truth.size() - 600)));
      if (truth[row].v.norm() > 0.3) starts_.push_back({l, row});
    }
  }
  [[nodiscard]] const std::vector<Start>& starts() const { return starts_; }
  [[nodiscard]] const RecordedLog& log(const Start& s) const { return logs_[s.log]; }
  [[nodiscard]] const TruthRow& row(const Start& s, std::size_t offset) const {
    return logs_[s.log].truth[s.truth + offset];
  }
  // Samples from half a second before image 0 to `seconds` after it.
  [[nodiscard]] std::vector<ImuSample> imu(const Start& s, double seconds) const {
    const Stamp t0 = row(s, 0).stamp;
    std::vector<ImuSample> out;
    for (const ImuSample& sample : logs_[s.log].imu) {
      const double t = (sample.stamp - t0).seconds();
      if (t > -0.5 && t < seconds + 0.006) out.push_back(sample);
    }
    return out;
  }

 private:
  std::vector<RecordedLog> logs_;
  std::vector<Start> starts_;
};

double quantile(std::vector<double>& values, double q) {
  if (values.empty()) return -1;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(q * static_cast<double>(values.size())))];
}

double tiltError(const Eigen::Vector3d& up, const TruthRow& truth) {
  const Eigen::Vector3d true_up = truth.q.conjugate() * Eigen::Vector3d::UnitZ();
  return std::atan2(up.cross(true_up).norm(), up.dot(true_up));
}

const Starts& allStarts() {
  static const Starts starts;
  return starts;
}

}  // namespace

TEST_CASE("Tilt from the accelerometer before the first image, real starts in motion", "[figures]") {
  const Starts& all = allStarts();
  if (all.starts().empty()) {
    skipCase(noLogs("euroc_imu_gt_all"), kRunWithData);
    return;
  }
  const ImuNoise noise;
  const StartPrior prior;
  for (const double before : {0.005, 0.1, 0.5}) {
    std::vector<double> errors, whitened;
    for (const Start& s : all.starts()) {
      std::vector<ImuSample> samples = all.imu(s, 0);
      const Stamp t0 = all.row(s, 0).stamp;
      std::erase_if(samples, [&](const ImuSample& x) { return (t0 - x.stamp).seconds() > before; });
      TiltEstimate tilt;
      REQUIRE(estimateTilt(samples, t0, noise, prior, tilt).ok());
      errors.push_back(tiltError(tilt.up, all.row(s, 0)));
      whitened.push_back(errors.back() / tilt.sigma);
    }
    const double covered = static_cast<double>(std::count_if(whitened.begin(), whitened.end(),
                                                             [](double w) { return w < 2.45; })) /
                           static_cast<double>(whitened.size());
    std::printf(
        "tilt from %.3f s before image 0: median %.2f deg, 90 %% %.2f deg, within 95 %% ellipse %.1f %%\n",
        before, quantile(errors, 0.5) * kDegrees, quantile(errors, 0.9) * kDegrees, 100 * covered);
    CHECK(quantile(errors, 0.5) * kDegrees < 5.5);
    CHECK(covered > 0.8);
  }
}

TEST_CASE("Mono start on real IMU: scale and tilt", "[figures][long]") {
  const Starts& all = allStarts();
  if (all.starts().empty()) {
    skipCase(noLogs("euroc_imu_gt_all"), kRunWithData);
    return;
  }
  const ImuNoise noise;
  const StartPrior prior;
  const SE3 T_body_cam = cameraOnBody();
  const double bearing_sigma = 0.6 / 458;
  for (const double seconds : {0.4, 0.7, 1.0, 1.5}) {
    Random random(17);
    std::vector<double> tilts, scales, sigmas, believed, bias_errors;
    int solved = 0, inside = 0, tried = 0, adopted = 0, adopted_bad = 0;
    const std::size_t step = longOr<std::size_t>(1, 3);  // of all starts, or of a third
    for (std::size_t i = 0; i < all.starts().size(); i += step) {
      const Start& s = all.starts()[i];
      if (s.truth + 320 >= all.log(s).truth.size()) continue;
      ++tried;
      const std::vector<ImuSample> samples = all.imu(s, seconds);
      const TruthRow& first = all.row(s, 0);
      TiltEstimate tilt;
      REQUIRE(estimateTilt(samples, first.stamp, noise, prior, tilt).ok());
      // Landmarks 2 to 8 m before the first camera; a frame each 0.1 s.
      const auto count = static_cast<std::size_t>(std::lround(seconds * 10));
      std::vector<Preintegration> imu;
      std::vector<SE3> T_world_cam{SE3(first.q, first.p) * T_body_cam};
      for (std::size_t k = 1; k <= count; ++k) {
        const TruthRow& row = all.row(s, 20 * k);
        imu.emplace_back(noise, prior.bias_gyro, prior.bias_accel);
        REQUIRE(imu.back().integrate(samples, first.stamp, row.stamp).ok());
        T_world_cam.push_back(SE3(row.q, row.p) * T_body_cam);
      }
      std::vector<BearingTrack> tracks(100);
      for (BearingTrack& track : tracks) {
        const double depth = random.uniform(2, 8);
        const Eigen::Vector3d in_first(depth * random.uniform(-0.7, 0.7), depth * random.uniform(-0.45, 0.45),
                                       depth);
        const Eigen::Vector3d world = T_world_cam[0] * in_first;
        for (std::size_t k = 0; k <= count; ++k) {
          const Eigen::Vector3d y = T_world_cam[k].inverse() * world;
          if (y.z() < 0.3 || std::abs(y.x() / y.z()) > 0.82 || std::abs(y.y() / y.z()) > 0.52) break;
          Eigen::Vector3d f = y / y.z();
          f.x() += bearing_sigma * random.normal();
          f.y() += bearing_sigma * random.normal();
          track.bearing[k] = f.normalized();
          track.seen |= 1U << k;
        }
        if (random.uniform() < 0.05) {  // a wrong track
          for (std::size_t k = 1; k <= count; ++k) {
            track.bearing[k] = (track.bearing[k] + 0.02 * normalVector(random)).normalized();
          }
        }
      }
      MonoStart start;
      const Status status = solveMonoStart(imu, tracks, T_body_cam, bearing_sigma, tilt, noise, prior, start);
      if (!status.ok()) continue;
      ++solved;
      // Scale: the estimated path against the true one, in the camera's positions at the end.
      const Eigen::Vector3d true_path = first.q.conjugate() * (all.row(s, 20 * count).p - first.p);
      const Preintegration& last = imu.back();
      const double T = last.duration();
      const Eigen::Vector3d path = start.motion.velocity * T - 0.5 * noise.gravity * T * T * start.motion.up +
                                   last.deltaPosition(start.motion.bias_gyro, start.motion.bias_accel);
      const double scale_error = std::abs(path.norm() / std::max(1e-3, true_path.norm()) - 1.0);
      scales.push_back(scale_error);
      sigmas.push_back(start.scale_sigma);
      inside += scale_error < 2.0 * start.scale_sigma ? 1 : 0;
      if (start.scale_sigma < 0.2) {
        ++adopted;
        believed.push_back(scale_error);
        adopted_bad += scale_error > 0.4 ? 1 : 0;
      }
      tilts.push_back(tiltError(start.motion.up, first));
      bias_errors.push_back((start.motion.bias_gyro - first.bias_gyro).norm());
    }
    std::printf(
        "mono start %.1f s: solved %d of %d, tilt median %.2f deg 90 %% %.2f deg, scale error median %.3f 90 "
        "%% %.3f, "
        "sigma median %.3f, inside 2 sigma %.1f %%; sigma < 0.2: %d, their error median %.3f, above 0.4: %d; "
        "gyro bias %.4f rad/s\n",
        seconds, solved, tried, quantile(tilts, 0.5) * kDegrees, quantile(tilts, 0.9) * kDegrees,
        quantile(scales, 0.5), quantile(scales, 0.9), quantile(sigmas, 0.5),
        100.0 * inside / std::max(1, solved), adopted, quantile(believed, 0.5), adopted_bad,
        quantile(bias_errors, 0.5));
    CHECK(solved >= tried * 3 / 4);  // the others were refused for want of parallax or agreement
    CHECK(inside >= solved * 80 / 100);
    CHECK(adopted_bad <= 1 + adopted / 20);
  }
}
