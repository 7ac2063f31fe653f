// Do starts with one camera judge themselves? Rendered flights in motion, three lenses (up to 180 degrees),
// room and hall, bright and dim, each started at 17 instants, with its own IMU and with one like that of the
// log imu_broad: 408 starts of 8 s.
//   start_statistics --images FOLDER [--frames FILE]
// Images are rendered into FOLDER, or found there. FILE: CSV, a line a frame. Exit code 1 when a figure
// misses.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "tests/odometry/health_verdict.hpp"
#include "tests/odometry/rendered_flight.hpp"
#include "tests/support/parallel.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::GivenFlight;
using test::RenderedFlight;
using test::RunFrame;

namespace {

constexpr double kDuration = 22;     // s
constexpr double kStartEvery = 0.8;  // s
constexpr int kStarts = 17;
constexpr double kRun = 8;          // s
constexpr double kJudgedAfter = 4;  // s after the first image

struct Start {
  RigKind rig = RigKind::kEuroc;
  bool hall = false;
  bool dim = false;
  bool broad = false;
  double good_after = -1;   ///< s; negative: never
  double worst_scale = 0;   ///< largest scale error while good, relative
  double worst_sigmas = 0;  ///< largest error of velocity or tilt while good, in its sigmas
  double scale = 1e9;       ///< error at kJudgedAfter; 1e9: no state, NaN: too little motion
};

/// Largest error of the velocity in body axes and of the vertical, over its sigma.
double errorInSigmas(const RunFrame& f) {
  const Eigen::Matrix3d R_body_world = f.state.T_world_body.rotation.conjugate().toRotationMatrix();
  const Eigen::Matrix3d R_body_truth = f.truth.T_world_body.rotation.conjugate().toRotationMatrix();
  // Errors of velocity and of the vertical in body axes by phi and v; R <- R Exp(phi).
  Eigen::Matrix<double, 6, 15> J = Eigen::Matrix<double, 6, 15>::Zero();
  const Eigen::Vector3d v_body = R_body_world * f.state.v_world_body;
  const Eigen::Vector3d up = R_body_world.col(2);
  J.block<3, 3>(0, 0) = hat(v_body);
  J.block<3, 3>(0, 6) = R_body_world;
  J.block<3, 3>(3, 0) = hat(up);
  Eigen::Matrix<double, 6, 1> error;
  error << v_body - R_body_truth * f.truth.v_world_body, up - R_body_truth.col(2);
  const Eigen::Matrix<double, 6, 6> P = J * f.state.covariance * J.transpose();
  // The vertical has two directions: an axis along it shows no error and no sigma.
  constexpr double kSmallestSigma = 1e-3;
  return (error.array().abs() / P.diagonal().array().sqrt().max(kSmallestSigma)).maxCoeff();
}

void judge(const std::vector<RunFrame>& frames, Start& start) {
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const RunFrame& f = frames[k];
    if (!f.has_state) continue;
    const double scale = std::abs(test::scaleError(frames, k));
    if (start.scale == 1e9 && f.seconds >= kJudgedAfter) start.scale = scale;
    if (f.state.health != Health::kGood) continue;
    if (start.good_after < 0) start.good_after = f.seconds;
    if (scale > start.worst_scale) start.worst_scale = scale;  // NaN is passed over
    start.worst_sigmas = std::max(start.worst_sigmas, errorInSigmas(f));
  }
}

SimulationSettings flightSettings(int index, Start& start) {
  constexpr std::array kRigs{RigKind::kEuroc, RigKind::kWide, RigKind::kFisheye};
  start.rig = kRigs[static_cast<std::size_t>(index) % kRigs.size()];
  start.hall = index / 3 % 2 == 1;
  start.dim = index / 6 % 2 == 1;
  SimulationSettings settings = test::roomFlight(kDuration, 900 + static_cast<std::uint64_t>(index));
  settings.rig = start.rig;
  settings.world.kind = start.hall ? WorldKind::kHall : WorldKind::kRoom;
  settings.flight.aggressiveness = 0.5 + 0.5 * (index % 4);
  settings.low_light = start.dim;
  settings.mono = true;
  settings.depth_every = 0;
  settings.threads = 1;
  return settings;
}

bool print(const std::vector<Start>& starts) {
  std::printf("%-8s %-5s %-6s %-5s %6s %9s %12s %11s %9s %12s\n", "lens", "world", "light", "IMU", "starts",
              "never", "to good [s]", "within 5 %", "scale", "sigmas");
  const auto line = [](const char* lens, const char* world, const char* light, const char* imu,
                       const std::vector<Start>& group) {
    std::vector<double> good;
    double scale = 0;
    double sigmas = 0;
    int within = 0;
    int judged = 0;
    for (const Start& s : group) {
      good.push_back(s.good_after < 0 ? 1e9 : s.good_after);
      scale = std::max(scale, s.worst_scale);
      sigmas = std::max(sigmas, s.worst_sigmas);
      within += s.scale <= 0.05 ? 1 : 0;
      judged += std::isnan(s.scale) ? 0 : 1;
    }
    const auto never = std::ranges::count_if(group, [](const Start& s) { return s.good_after < 0; });
    std::printf("%-8s %-5s %-6s %-5s %6zu %9td %12.2f %11.3f %9.3f %12.1f\n", lens, world, light, imu,
                group.size(), never, test::quantile(good, 0.5), within / static_cast<double>(judged), scale,
                sigmas);
    return scale <= 0.15 && sigmas <= 5 && within >= 0.95 * judged;
  };
  for (const RigKind rig : {RigKind::kEuroc, RigKind::kWide, RigKind::kFisheye}) {
    for (int kind = 0; kind < 8; ++kind) {
      std::vector<Start> group;
      for (const Start& s : starts) {
        if (s.rig == rig && s.hall == (kind & 1) && s.dim == (kind >> 1 & 1) && s.broad == (kind >> 2))
          group.push_back(s);
      }
      line(rigName(rig), (kind & 1) != 0 ? "hall" : "room", (kind & 2) != 0 ? "dim" : "bright",
           (kind & 4) != 0 ? "broad" : "own", group);
    }
  }
  const bool ok = line("all", "", "", "", starts);
  std::printf("asked: scale at most 0.15 while good, at most 5 sigmas, within 5 %% after 4 s: 0.95%s\n",
              ok ? "" : "  MISSED");
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  std::string images;
  std::FILE* csv = nullptr;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--images") == 0) images = argv[i + 1];
    if (std::strcmp(argv[i], "--frames") == 0) csv = std::fopen(argv[i + 1], "w");
  }
  if (images.empty()) {
    std::fputs("start_statistics --images FOLDER [--frames FILE]\n", stderr);
    return 2;
  }
  if (csv != nullptr) test::writeFramesHeader(csv);
  std::vector<Start> starts;
  std::mutex mutex;
  test::forEach(12, [&](int index) {
    Start kind;
    const SimulationSettings settings = flightSettings(index, kind);
    const RenderedFlight flight(settings, images + "/start_" + std::to_string(index));
    OdometrySettings odometry;
    odometry.use_stereo = false;
    for (int i = 0; i < 2 * kStarts; ++i) {
      Start start = kind;
      start.broad = i >= kStarts;
      const std::uint64_t seed = settings.seed + 100 * static_cast<std::uint64_t>(i);
      const ImuNoise noise = start.broad ? test::broadImu() : flight.given().noise;
      const auto first = static_cast<std::size_t>(kStartEvery * (i % kStarts) * settings.camera_rate);
      const auto last = first + static_cast<std::size_t>(kRun * settings.camera_rate);
      const auto frames = flight.fly(flight.givenWithImu(noise, seed), odometry, first, last);
      judge(frames, start);
      if (csv != nullptr)
        test::writeFrames(csv, index * 2 * kStarts + i, frames, test::RigFault::kNone, true);
      const std::lock_guard lock(mutex);
      starts.push_back(start);
    }
  });
  if (csv != nullptr) std::fclose(csv);
  return print(starts) ? 0 : 1;
}
