// Is a wrong calibration found in flight? Rendered flights with two cameras, two lenses, room and hall, of
// which the calibration given is off by half a degree (camera 1 against camera 0, the whole rig) or the
// stamps by 1 to 15 ms, with smoother.estimate_extrinsics or smoother.estimate_time_offset.
//   calibration_statistics --images FOLDER
// Images are rendered into FOLDER, or found there. Printed: what is left of the error at the end, its sigma,
// and ATE RMSE over that of the true calibration. Exit code 1 when a figure misses.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <numbers>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/odometry/rendered_flight.hpp"
#include "tests/support/parallel.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::GivenFlight;
using test::RenderedFlight;
using test::RunFrame;

namespace {

constexpr double kDuration = 40;  // s
constexpr int kFlights = 8;
constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kFrom = 3;                           // s, from which ATE is measured, as on the logs
constexpr double kTurn = 0.5 / kDegrees;              // rad
constexpr std::array kOffsets{1.0, 5.0, 10.0, 15.0};  // ms

enum class Wrong : std::uint8_t { kNothing, kCamera, kRig, kStamps };
constexpr std::array<const char*, 4> kWrongNames{"nothing", "camera 1", "rig", "stamps"};

struct Result {
  Wrong wrong = Wrong::kNothing;
  double camera = 0;  ///< rad, of camera 1 relative to camera 0
  double rig = 0;     ///< rad, of camera 0 in the body
  double shift = 0;   ///< s
  double camera_sigma = 0;
  double rig_sigma = 0;
  double shift_sigma = 0;
  double position = 0;  ///< m, of camera 0 in the body
  double ate_ratio = 1;
};

Result judge(const std::vector<RunFrame>& frames, const Rig& truth, Duration true_shift, Wrong wrong,
             const std::vector<RunFrame>& reference) {
  const CalibrationEstimate& end = frames.back().calibration;
  Result result{wrong};
  const auto relative = [](const auto& T) { return T[0].rotation.conjugate() * T[1].rotation; };
  result.camera = relative(truth.T_body_cam).angularDistance(relative(end.T_body_cam));
  result.rig = truth.T_body_cam[0].rotation.angularDistance(end.T_body_cam[0].rotation);
  result.shift = std::abs((end.camera_to_imu_shift - true_shift).seconds());
  result.camera_sigma = end.stereo_rotation_sigma;
  result.rig_sigma = end.rotation_sigma[0];
  result.shift_sigma = end.shift_sigma;
  result.position = (truth.T_body_cam[0].translation - end.T_body_cam[0].translation).norm();
  result.ate_ratio = test::ate(frames, kFrom) / test::ate(reference, kFrom);
  return result;
}

SimulationSettings flightSettings(int index) {
  SimulationSettings settings = test::roomFlight(kDuration, 700 + static_cast<std::uint64_t>(index));
  settings.rig = index % 2 == 0 ? RigKind::kEuroc : RigKind::kFisheye;
  settings.world.kind = index / 2 % 2 == 0 ? WorldKind::kRoom : WorldKind::kHall;
  settings.flight.aggressiveness = 1.5;
  settings.depth_every = 0;
  settings.threads = 1;
  return settings;
}

Eigen::Quaterniond halfDegree(Random& random) { return expSo3(kTurn * test::randomDirection(random)); }

std::vector<Result> flyAll(int index, const std::string& images) {
  const SimulationSettings settings = flightSettings(index);
  const RenderedFlight flight(settings, images + "/calibration_" + std::to_string(index));
  const Rig& rig = flight.flight().trueRig();
  Random random(settings.seed, 78);
  std::vector<Result> results;
  const std::vector<RunFrame> reference = flight.fly(flight.given(), {});
  std::printf("flight %d: ATE %.4f m with the true calibration\n", index, test::ate(reference, kFrom));
  const auto fly = [&](const GivenFlight& given, Duration shift, Wrong wrong) {
    OdometrySettings odometry;
    odometry.estimate_extrinsics = wrong != Wrong::kStamps;
    odometry.estimate_time_offset = wrong == Wrong::kStamps || wrong == Wrong::kNothing;
    const auto frames = flight.fly(given, odometry);
    results.push_back(judge(frames, rig, shift, wrong, reference));
    const Result& r = results.back();
    std::printf(
        "flight %d %-8s %5.1f ms: camera 1 %.4f (%.4f) deg, rig %.4f (%.4f) deg, %.2f mm, shift %.3f (%.3f) "
        "ms, "
        "ATE %.2f\n",
        index, kWrongNames[static_cast<std::size_t>(wrong)], -shift.seconds() * 1e3, r.camera * kDegrees,
        r.camera_sigma * kDegrees, r.rig * kDegrees, r.rig_sigma * kDegrees, r.position * 1e3, r.shift * 1e3,
        r.shift_sigma * 1e3, r.ate_ratio);
  };
  fly(flight.given(), {}, Wrong::kNothing);
  GivenFlight given = flight.given();
  given.rig.T_body_cam[1].rotation = given.rig.T_body_cam[1].rotation * halfDegree(random);
  fly(given, {}, Wrong::kCamera);
  given = flight.given();
  const Eigen::Quaterniond turn = halfDegree(random);
  for (SE3& T : given.rig.T_body_cam) T.rotation = turn * T.rotation;
  fly(given, {}, Wrong::kRig);
  for (const double ms : kOffsets) {
    const Duration offset = Duration::fromSeconds((index % 4 < 2 ? ms : -ms) * 1e-3);
    given = flight.given();
    for (Stamp& stamp : given.stamps) stamp = stamp + offset;
    fly(given, Duration{} - offset, Wrong::kStamps);
  }
  return results;
}

bool print(const std::vector<Result>& results) {
  std::printf("%-10s %5s   %-22s %-22s %-22s %-22s\n", "off", "runs", "camera 1 [deg]", "rig [deg]",
              "stamps [ms]", "ATE ratio");
  bool ok = true;
  for (std::size_t kind = 0; kind < kWrongNames.size(); ++kind) {
    std::array<std::vector<double>, 4> values;
    for (const Result& r : results) {
      if (static_cast<std::size_t>(r.wrong) != kind) continue;
      values[0].push_back(r.camera * kDegrees);
      values[1].push_back(r.rig * kDegrees);
      values[2].push_back(r.shift * 1e3);
      values[3].push_back(r.ate_ratio);
    }
    std::printf("%-10s %5zu", kWrongNames[kind], values[0].size());
    for (std::size_t v = 0; v < values.size(); ++v) {
      constexpr std::array kAsked{0.05, 0.05, 0.3, 1.2};
      // Each calibration is to be found; a single flight's ATE is luck.
      const double judged = v < 3 ? test::quantile(values[v], 1) : test::mean(values[v]);
      ok &= judged <= kAsked[v];
      std::printf("   %9.4f %9.4f%s", test::mean(values[v]), test::quantile(values[v], 1),
                  judged <= kAsked[v] ? " " : "!");
    }
    std::printf("\n");
  }
  std::printf("mean and largest; asked: largest 0.05 deg, 0.3 ms, mean ratio 1.2; ! where missed\n");
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 || std::strcmp(argv[1], "--images") != 0) {
    std::fputs("calibration_statistics --images FOLDER\n", stderr);
    return 2;
  }
  std::vector<Result> results;
  std::mutex mutex;
  test::forEach(kFlights, [&](int index) {
    const std::vector<Result> of_flight = flyAll(index, argv[2]);
    const std::lock_guard lock(mutex);
    results.insert(results.end(), of_flight.begin(), of_flight.end());
  });
  return print(results) ? 0 : 1;
}
