// Figures over many simulated flights (feature tracks, no images), beside what is asked of them:
//   flight_statistics [nees|nees_mono|start|coast|calibration|vibration|camera|rest]...   default: all
// Same seeds, same figures. Exit code 1 when a figure misses.

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>

#include "tests/odometry/odometry_run.hpp"
#include "tests/support/parallel.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::ate;
using test::forEach;
using test::mean;
using test::OdometryRun;
using test::quantile;
using test::RunFrame;
using test::TrackFlight;

namespace {

constexpr int kFlights = 50;
constexpr double kDegrees = 180.0 / 3.14159265358979323846;

bool report(const char* what, double value, const char* unit, double low, double high) {
  const bool ok = value >= low && value <= high;
  std::printf("  %-58s %9.4f %-5s asked [%g, %g]%s\n", what, value, unit, low, high, ok ? "" : "  MISSED");
  return ok;
}

std::uint64_t seedOf(int flight) { return 100 + static_cast<std::uint64_t>(flight); }

const RunFrame* firstPose(const OdometryRun& run) {
  for (const RunFrame& f : run.frames) {
    if (f.has_state) return &f;
  }
  return nullptr;
}

const RunFrame& frameAt(const OdometryRun& run, double seconds) {
  const auto found = std::find_if(run.frames.begin(), run.frames.end(),
                                  [&](const RunFrame& f) { return f.seconds >= seconds - 1e-6; });
  return found == run.frames.end() ? run.frames.back() : *found;
}

bool consistency(bool stereo) {
  std::printf("consistency: %d flights of 60 s, %s\n", kFlights, stereo ? "stereo" : "one camera");
  constexpr std::array<double, 3> kTimes{10, 30, 59.9};
  std::array<std::vector<double>, 3> nees;
  std::array<std::vector<double>, 3> yaw;
  std::array<std::vector<double>, 3> position;
  for (auto* set : {&nees, &yaw, &position}) set->fill(std::vector<double>(kFlights, 1e9));
  forEach(kFlights, [&](int i) {
    const TrackFlight flight(test::roomFlight(60.2, seedOf(i)));
    const OdometryRun run = test::runOdometry(flight, test::settingsFor(flight, stereo));
    for (std::size_t k = 0; k < kTimes.size(); ++k) {
      const RunFrame& frame = frameAt(run, kTimes[k]);
      const auto T = test::worldFromTruth(run, frame);
      if (!T) return;
      const auto error = test::poseError(frame, *T);
      const Eigen::Matrix<double, 6, 6> P = frame.state.covariance.topLeftCorner<6, 6>();
      const auto at = static_cast<std::size_t>(i);
      nees[k][at] = error.dot(P.llt().solve(error));
      const Eigen::Vector3d up = frame.state.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      yaw[k][at] = std::pow(up.dot(error.head<3>()), 2) / up.dot(P.topLeftCorner<3, 3>() * up);
      position[k][at] =
          error.tail<3>().dot(P.bottomRightCorner<3, 3>().llt().solve(Eigen::Vector3d(error.tail<3>())));
    }
  });
  bool ok = true;
  for (std::size_t k = 0; k < kTimes.size(); ++k) {
    std::printf("  at %.0f s: yaw %.2f (1), position %.2f (3), median of the pose's %.2f (5.35)\n", kTimes[k],
                mean(yaw[k]), mean(position[k]), quantile(nees[k], 0.5));
    ok &= report("mean 6-dof pose NEES", mean(nees[k]), "", 5.1, 7.0);
  }
  return ok;
}

bool starts() {
  constexpr int kFlightsHere = 30;
  constexpr int kStarts = 4;  // in each
  std::printf("starts in motion: %d, stereo, 0.5 s after the first image\n", kFlightsHere * kStarts);
  std::vector<double> tilt(kFlightsHere * kStarts, 1e9);
  std::vector<double> velocity = tilt;
  forEach(kFlightsHere, [&](int i) {
    SimulationSettings settings = test::roomFlight(20, seedOf(i));
    settings.flight.aggressiveness = 0.5 + 0.25 * (i % 5);
    const TrackFlight flight(settings);
    // The default settings: nobody tells a start how good its sensors are.
    for (int s = 0; s < kStarts; ++s) {
      const auto first = static_cast<std::size_t>(20 + 90 * s);
      const OdometryRun run = test::runOdometry(flight, OdometrySettings{}, first, 0.1);
      const auto at = static_cast<std::size_t>(i * kStarts + s);
      const RunFrame& frame = frameAt(run, 0.5);
      if (!frame.has_state) continue;
      tilt[at] = test::tiltError(frame) * kDegrees;
      velocity[at] = test::velocityError(frame);
    }
  });
  bool ok = report("tilt error, median", quantile(tilt, 0.5), "deg", 0, 1);
  ok &= report("tilt error, 90 %", quantile(tilt, 0.9), "deg", 0, 2);
  ok &= report("velocity error, median", quantile(velocity, 0.5), "m/s", 0, 0.03);
  return ok;
}

bool coasting() {
  constexpr double kDark = 12;  // s, the estimate has converged
  std::printf("coasting: %d blackouts of 2 s on a converged state\n", kFlights);
  std::vector<double> inside(3 * kFlights, 0);
  std::vector<double> sigma(kFlights, 1e9);
  std::vector<double> error(kFlights, 1e9);
  std::atomic<int> failed = 0;
  std::atomic<int> claimed = 0;
  std::atomic<int> recovered = 0;
  forEach(kFlights, [&](int i) {
    SimulationSettings settings = test::roomFlight(17, seedOf(i));
    settings.faults.push_back({FaultKind::kBlackout, {kDark, kDark + 2}, -1});
    const TrackFlight flight(settings);
    const OdometryRun run = test::runOdometry(flight, test::settingsFor(flight));
    const SE3 T = test::worldFromTruth(*firstPose(run));
    const RunFrame* last_dark = nullptr;
    for (const RunFrame& f : run.frames) {
      const double t = flight.seconds(f.index);
      if (t < kDark || t >= kDark + 2) continue;
      last_dark = &f;
      if (f.state.health == Health::kFailed || !f.has_state) ++failed;
      if (t > kDark + 0.5 && f.state.health == Health::kGood) ++claimed;
    }
    const auto e = test::poseError(*last_dark, T);
    const Eigen::Vector3d s = last_dark->state.covariance.diagonal().segment<3>(3).cwiseSqrt();
    for (int axis = 0; axis < 3; ++axis) {
      inside[static_cast<std::size_t>(3 * i + axis)] = std::abs(e[3 + axis]) <= 3 * s[axis] ? 1 : 0;
    }
    sigma[static_cast<std::size_t>(i)] = 3 * s.maxCoeff();
    error[static_cast<std::size_t>(i)] = e.tail<3>().norm();
    recovered += run.frames.back().state.health == Health::kGood ? 1 : 0;
  });
  std::printf("  position error at 2 s: median %.3f m, largest %.3f m; good again at the end: %d of %d\n",
              quantile(error, 0.5), quantile(error, 1), recovered.load(), kFlights);
  bool ok = report("share of axes inside 3 sigma", mean(inside), "", 0.95, 1);
  ok &= report("3 sigma at 2 s, largest axis, largest of all", quantile(sigma, 1), "m", 0, 1);
  ok &= report("frames said failed before 2 s", failed.load(), "", 0, 0);
  ok &= report("frames said good without an image for 0.5 s", claimed.load(), "", 0, 0);
  return ok;
}

bool calibration() {
  constexpr int kFlightsHere = 6;
  std::printf("calibration: %d flights of 60 s, stamps off by 5 ms or cameras turned by 0.5 degrees\n",
              kFlightsHere);
  std::vector<double> offset(2 * kFlightsHere, 1e9);
  std::vector<double> turn = offset;
  std::vector<double> ratio_offset = offset;
  std::vector<double> ratio_turn = offset;
  forEach(2 * kFlightsHere, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    const double sign = i % 2 == 0 ? 1 : -1;
    SimulationSettings settings = test::roomFlight(60, seedOf(i / 2));
    settings.flight.aggressiveness = 1.5;
    const TrackFlight plain(settings);
    const double before = ate(test::runOdometry(plain, test::settingsFor(plain)).frames, 3);

    SimulationSettings late = settings;
    late.image_stamp_offset = Duration::fromSeconds(sign * 5e-3);
    const TrackFlight shifted(late);
    OdometrySettings with = test::settingsFor(shifted);
    with.estimate_time_offset = true;
    const OdometryRun run = test::runOdometry(shifted, with);
    const double found = run.frames.back().calibration.camera_to_imu_shift.seconds();
    offset[at] = std::abs(found + late.image_stamp_offset.seconds()) * 1e3;
    ratio_offset[at] = ate(run.frames, 3) / before;

    SimulationSettings bent = settings;
    bent.rig_turn_deg = sign * 0.5 * Eigen::Vector3d(1, -1, 1).normalized();
    const TrackFlight turned(bent);
    with = test::settingsFor(turned);
    with.estimate_extrinsics = true;
    const OdometryRun turned_run = test::runOdometry(turned, with);
    turn[at] = 0;
    for (std::size_t c = 0; c < 2; ++c) {
      const double angle = turned_run.frames.back().calibration.T_body_cam[c].rotation.angularDistance(
          turned.flight().trueRig().T_body_cam[c].rotation);
      turn[at] = std::max(turn[at], angle * kDegrees);
    }
    ratio_turn[at] = ate(turned_run.frames, 3) / before;
  });
  bool ok = report("time offset error, largest", quantile(offset, 1), "ms", 0, 0.3);
  std::printf("  median %.3f ms\n", quantile(offset, 0.5));
  ok &= report("ATE with the offset over without, mean", mean(ratio_offset), "", 0, 1.2);
  ok &= report("extrinsic rotation error, largest", quantile(turn, 1), "deg", 0, 0.05);
  std::printf("  median %.4f deg\n", quantile(turn, 0.5));
  ok &= report("ATE with the turn over without, mean", mean(ratio_turn), "", 0, 1.2);
  return ok;
}

bool vibration() {
  constexpr int kFlightsHere = 10;
  std::printf("vibration of 2 m/s^2 at 80 to 150 Hz: %d flights of 30 s\n", kFlightsHere);
  std::vector<double> with(kFlightsHere, 1e9);
  std::vector<double> without = with;
  forEach(2 * kFlightsHere, [&](int i) {
    SimulationSettings settings = test::roomFlight(30, seedOf(i / 2));
    if (i % 2 == 1) settings.imu.vibration.accel_amplitude = 2;
    const TrackFlight flight(settings);
    const double error = ate(test::runOdometry(flight, OdometrySettings{}).frames);
    (i % 2 == 1 ? with : without)[static_cast<std::size_t>(i / 2)] = error;
  });
  std::printf("  ATE %.4f m with, %.4f m without, default settings\n", mean(with), mean(without));
  return report("mean ATE with over without", mean(with) / mean(without), "", 0, 1.5);
}

bool cameraLost() {
  constexpr int kFlightsHere = 10;
  std::printf("one camera removed for 5 s: %d flights of 25 s\n", kFlightsHere);
  std::vector<double> errors(2 * kFlightsHere, 1e9);
  std::atomic<int> resets = 0;
  std::atomic<int> silent = 0;
  std::atomic<int> late = 0;
  forEach(2 * kFlightsHere, [&](int i) {
    SimulationSettings settings = test::roomFlight(25, seedOf(i / 2));
    settings.faults.push_back({FaultKind::kCameraMissing, {10, 15}, i % 2});
    const TrackFlight flight(settings);
    const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
    errors[static_cast<std::size_t>(i)] = ate(run.frames);
    for (const RunFrame& f : run.frames) {
      const double t = flight.seconds(f.index);
      if (f.state.epoch != 0) ++resets;
      if (t > 10 && t < 15 && f.state.health == Health::kGood) ++silent;
      if (t > 15.5 && f.state.health != Health::kGood) ++late;
    }
  });
  std::printf("  ATE: median %.4f m, largest %.4f m\n", quantile(errors, 0.5), quantile(errors, 1));
  bool ok = report("frames in a later epoch", resets.load(), "", 0, 0);
  ok &= report("frames with one camera said good", silent.load(), "", 0, 0);
  ok &= report("frames not good 0.5 s after its return", late.load(), "", 0, 0);
  return ok;
}

bool rest() {
  constexpr int kFlightsHere = 10;
  std::printf("60 s at rest: %d flights\n", kFlightsHere);
  std::vector<double> drift(2 * kFlightsHere, 1e9);
  std::vector<double> speed = drift;
  std::atomic<int> outside = 0;
  forEach(2 * kFlightsHere, [&](int i) {
    SimulationSettings settings = test::roomFlight(60, seedOf(i / 2));
    settings.flight.rest_at_start = 60;
    const bool stereo = i % 2 == 0;
    settings.mono = !stereo;
    const TrackFlight flight(settings);
    OdometrySettings given;
    given.use_stereo = stereo;
    const OdometryRun run = test::runOdometry(flight, given);
    const RunFrame* first = firstPose(run);
    double square = 0;
    int count = 0;
    double farthest = 0;
    for (const RunFrame& f : run.frames) {
      if (!f.has_state) continue;
      farthest = std::max(farthest,
                          (f.state.T_world_body.translation - first->state.T_world_body.translation).norm());
      square += f.state.v_world_body.squaredNorm();
      ++count;
    }
    const auto at = static_cast<std::size_t>(i);
    drift[at] = farthest * 1e3;
    speed[at] = std::sqrt(square / count) * 1e3;
    const RunFrame& last = run.frames.back();
    const Eigen::Vector3d error = last.truth.bias_gyro - last.state.bias_gyro;
    const Eigen::Vector3d sigma = last.state.covariance.diagonal().segment<3>(9).cwiseSqrt();
    outside += (error.cwiseAbs().array() > 3 * sigma.array()).any() ? 1 : 0;
  });
  std::vector<double> by_camera[2];
  for (std::size_t i = 0; i < drift.size(); ++i) by_camera[i % 2].push_back(drift[i]);
  std::printf("  drift: stereo median %.2f mm, largest %.2f mm; one camera median %.2f mm, largest %.2f mm\n",
              quantile(by_camera[0], 0.5), quantile(by_camera[0], 1), quantile(by_camera[1], 0.5),
              quantile(by_camera[1], 1));
  bool ok = report("drift, largest of stereo and one camera", quantile(drift, 1), "mm", 0, 5);
  ok &= report("speed RMSE, largest", quantile(speed, 1), "mm/s", 0, 5);
  ok &= report("runs with a gyro bias outside 3 sigma", outside.load(), "", 0, 0);
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  const std::map<std::string, std::function<bool()>> sections{
      {"nees", [] { return consistency(true); }},
      {"nees_mono", [] { return consistency(false); }},
      {"start", starts},
      {"coast", coasting},
      {"calibration", calibration},
      {"vibration", vibration},
      {"camera", cameraLost},
      {"rest", rest}};
  std::vector<std::string> wanted(argv + 1, argv + argc);
  if (wanted.empty()) {
    for (const auto& [name, run] : sections) wanted.push_back(name);
  }
  bool ok = true;
  for (const std::string& name : wanted) {
    const auto found = sections.find(name);
    if (found == sections.end()) {
      std::fprintf(stderr, "flight_statistics: no section '%s'\n", name.c_str());
      return 2;
    }
    ok &= found->second();
  }
  return ok ? 0 : 1;
}
