// Does health tell the truth? Simulated flights (feature tracks, no images), of which half are spoiled
// (faulty_flight.hpp), each with two cameras and with one:
//   health_statistics [--flights N] [--cameras 1|2] [--frames FILE]   default: 300 of each kind; FILE: CSV, a
//   line a frame
// Printed: seconds "good" with a velocity error above 1 m/s or, with one camera, a scale error above 20 %;
// how soon and for what share healthy flights are "good". Same seeds, same figures. Exit code 1 when a figure
// misses.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "estimator/geometry/alignment.hpp"
#include "tests/odometry/faulty_flight.hpp"
#include "tests/odometry/odometry_run.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::FaultyFlight;
using test::RigFault;
using test::RunFrame;

namespace {

constexpr double kDuration = 20;         // s
constexpr double kVelocityBound = 1.0;   // m/s
constexpr double kScaleBound = 0.2;      // relative
constexpr double kWrongTime = 1.0;       // s
constexpr double kScaleWindow = 3.0;     // s over which the scale is measured
constexpr double kScaleMinSpread = 0.3;  // m of true motion in it, RMS

struct Verdict {
  RigFault fault = RigFault::kNone;
  bool mono = false;
  double wrong = 0;        ///< s, longest time "good" and wrong
  double first_good = -1;  ///< s since the first image, one camera: since it moves; negative: never
  double good_after = 0;   ///< share of the images from then on
  double good = 0;         ///< share of all images
  double worst_good = 0;   ///< m/s, largest velocity error while good
};

/// Scale of the estimate over the last seconds, less one; NaN where the motion does not show it.
double scaleError(const std::vector<RunFrame>& frames, std::size_t last) {
  Eigen::Vector3d mean_estimate = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_truth = Eigen::Vector3d::Zero();
  std::size_t first = last;
  while (first > 0 && frames[first - 1].has_state &&
         frames[first - 1].state.epoch == frames[last].state.epoch &&
         frames[last].seconds - frames[first - 1].seconds <= kScaleWindow) {
    --first;
  }
  const auto count = static_cast<double>(last - first + 1);
  for (std::size_t k = first; k <= last; ++k) {
    mean_estimate += frames[k].state.T_world_body.translation / count;
    mean_truth += frames[k].truth.T_world_body.translation / count;
  }
  double estimate = 0;
  double truth = 0;
  for (std::size_t k = first; k <= last; ++k) {
    estimate += (frames[k].state.T_world_body.translation - mean_estimate).squaredNorm();
    truth += (frames[k].truth.T_world_body.translation - mean_truth).squaredNorm();
  }
  if (std::sqrt(truth / count) < kScaleMinSpread) return std::nan("");
  return std::sqrt(estimate / truth) - 1;
}

SimulationSettings flightSettings(int index) {
  constexpr std::array kRigs{RigKind::kEuroc, RigKind::kForward, RigKind::kWide, RigKind::kFisheye};
  constexpr std::array kWorlds{WorldKind::kRoom, WorldKind::kHall, WorldKind::kCluttered};
  SimulationSettings settings = test::roomFlight(kDuration, 500 + static_cast<std::uint64_t>(index));
  settings.rig = kRigs[static_cast<std::size_t>(index) % kRigs.size()];
  settings.world.kind = kWorlds[static_cast<std::size_t>(index / 4) % kWorlds.size()];
  settings.flight.aggressiveness = 0.5 + 0.5 * (index % 3);
  settings.flight.speed = 0.7 + 0.4 * (index % 5);
  settings.tracks.max_range = 25;
  settings.tracks.outlier_share = 0.02 * (index % 2);
  if (index % 4 == 3) settings.flight.rest_at_start = 3;
  return settings;
}

std::vector<RunFrame> fly(const FaultyFlight& flight, bool mono) {
  OdometrySettings settings;
  settings.use_stereo = !mono;
  Odometry odometry(flight.rig, flight.noise, settings);
  auto output = std::make_unique<OdometryOutput>();
  std::vector<RunFrame> frames;
  std::size_t next = 0;
  for (std::size_t k = 0; k < flight.frames.size(); ++k) {
    while (next < flight.samples.size() && flight.samples[next].stamp <= flight.frames[k].stamp) {
      static_cast<void>(odometry.addImu(flight.samples[next++]));
    }
    static_cast<void>(odometry.smooth(flight.frames[k], Effort{}, *output));
    RunFrame frame;
    frame.index = k;
    frame.seconds = flight.flight.seconds(k) - flight.flight.seconds(0);
    frame.has_state = output->has_state;
    frame.truth = flight.flight.truth(k);
    frame.state = output->state;
    frame.statistics = output->statistics;
    frame.doubt = output->doubt;
    frames.push_back(frame);
  }
  return frames;
}

Verdict judge(const std::vector<RunFrame>& frames, const FaultyFlight& flight, RigFault fault, bool mono,
              int index, std::FILE* csv) {
  Verdict verdict{fault, mono};
  double wrong_since = -1;
  int good = 0;
  int from_first = 0;
  bool was_good = false;
  std::string lines;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const RunFrame& f = frames[k];
    const bool is_good = f.has_state && f.state.health == Health::kGood;
    const double velocity = f.has_state ? test::velocityError(f) : 0;
    const double scale = f.has_state ? scaleError(frames, k) : std::nan("");
    const bool is_wrong = is_good && (velocity > kVelocityBound || (mono && std::abs(scale) > kScaleBound));
    if (!is_wrong) wrong_since = -1;
    if (is_wrong && wrong_since < 0) wrong_since = f.seconds;
    if (is_wrong) verdict.wrong = std::max(verdict.wrong, f.seconds - wrong_since);
    if (is_good) verdict.worst_good = std::max(verdict.worst_good, velocity);
    if (is_good && !was_good) {
      was_good = true;
      verdict.first_good =
          std::max(0.0, f.seconds - (mono ? flight.flight.flight().settings().flight.rest_at_start : 0));
    }
    if (was_good) ++from_first;
    good += is_good ? 1 : 0;
    if (csv == nullptr || !f.has_state) continue;
    const Matrix15d& P = f.state.covariance;
    const auto sigma = [&P](int at) { return std::sqrt(P.diagonal().segment<3>(at).maxCoeff()); };
    char line[400];
    std::snprintf(line, sizeof line,
                  "%d,%s,%d,%.2f,%u,%d,%.3f,%.3f,%.4f,%.4f,%.4f,%.5f,%.4f,%.4f,%d,%d,%d,%d,%.3f,%.2f,%.1f,%d,"
                  "%d,%.4f,%.4f,%d,%d,%.3f\n",
                  index, test::kRigFaultNames[static_cast<std::size_t>(fault)], mono, f.seconds,
                  f.state.epoch, static_cast<int>(f.state.health), velocity, scale, test::tiltError(f),
                  sigma(6), sigma(0), sigma(9), sigma(12), f.state.v_world_body.norm(), f.statistics.tracks,
                  f.statistics.landmarks, f.statistics.inliers_mono, f.statistics.inliers_stereo,
                  f.statistics.reprojection_rms, f.statistics.imu_residual, f.statistics.track_length,
                  f.statistics.at_rest, f.statistics.iterations, f.statistics.scale, f.statistics.scale_sigma,
                  static_cast<int>(f.doubt), f.statistics.known, f.statistics.pixel_sigma);
    lines += line;
  }
  if (csv != nullptr) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    std::fputs(lines.c_str(), csv);
  }
  verdict.good = good / static_cast<double>(frames.size());
  verdict.good_after = from_first > 0 ? good / static_cast<double>(from_first) : 0;
  return verdict;
}

bool report(const char* what, double value, const char* unit, double low, double high) {
  const bool ok = value >= low && value <= high;
  std::printf("  %-58s %9.4f %-5s asked [%g, %g]%s\n", what, value, unit, low, high, ok ? "" : "  MISSED");
  return ok;
}

bool print(const std::vector<Verdict>& verdicts) {
  bool ok = true;
  std::printf("%-10s %-6s %6s %9s %11s %11s %12s\n", "fault", "camera", "runs", "good [%]", "wrong runs",
              "wrong [s]", "dv good");
  for (std::size_t fault = 0; fault < test::kRigFaultNames.size(); ++fault) {
    for (const bool mono : {false, true}) {
      std::vector<double> good;
      std::vector<double> wrong;
      double worst = 0;
      int wrong_runs = 0;
      for (const Verdict& v : verdicts) {
        if (static_cast<std::size_t>(v.fault) != fault || v.mono != mono) continue;
        good.push_back(v.good);
        wrong.push_back(v.wrong);
        worst = std::max(worst, v.worst_good);
        wrong_runs += v.wrong > kWrongTime ? 1 : 0;
      }
      if (good.empty()) continue;
      std::printf("%-10s %-6s %6zu %9.1f %11d %11.2f %12.2f\n", test::kRigFaultNames[fault],
                  mono ? "one" : "two", good.size(), 100 * test::mean(good), wrong_runs,
                  test::quantile(wrong, 1), worst);
    }
  }
  for (const bool mono : {false, true}) {
    std::vector<double> first;
    std::vector<double> after;
    std::vector<double> wrong;
    for (const Verdict& v : verdicts) {
      if (v.mono != mono) continue;
      wrong.push_back(v.wrong);
      if (v.fault != RigFault::kNone) continue;
      first.push_back(v.first_good < 0 ? 1e9 : v.first_good);
      after.push_back(v.good_after);
    }
    if (wrong.empty()) continue;
    std::printf("%s\n", mono ? "one camera" : "two cameras");
    ok &= report("longest time good and wrong, all flights", test::quantile(wrong, 1), "s", 0, kWrongTime);
    if (first.empty()) continue;
    ok &= report("first good, healthy, 95 %", test::quantile(first, 0.95), "s", 0, mono ? 6 : 2);
    ok &= report("good from then on, healthy, mean", test::mean(after), "", 0.99, 1);
    std::printf("  good from then on, healthy, worst flight: %.3f\n", test::quantile(after, 0));
  }
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  int flights = 300;
  int cameras = 0;
  std::FILE* csv = nullptr;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--flights") == 0) flights = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--cameras") == 0) cameras = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--frames") == 0) csv = std::fopen(argv[i + 1], "w");
  }
  if (csv != nullptr) {
    std::fputs(
        "run,fault,mono,t,epoch,health,dv,dscale,dtilt,sv,sr,sbg,sba,speed,tracks,landmarks,mono_in,stereo_"
        "in,rms,"
        "imu,length,rest,iterations,fs,fss,doubt,known,pixel_sigma\n",
        csv);
  }
  // A flight without a fault and one with; every kind of fault in turn.
  std::vector<std::optional<Verdict>> verdicts(static_cast<std::size_t>(2 * flights));
  std::atomic<int> next = 0;
  const auto work = [&] {
    for (int i = next++; i < 2 * flights; i = next++) {
      const int index = i / 2;
      const int kinds = static_cast<int>(test::kRigFaultNames.size()) - 1;
      const RigFault fault = i % 2 == 0 ? RigFault::kNone : static_cast<RigFault>(1 + index / 2 % kinds);
      const bool mono = index % 2 == 1;
      if (cameras == (mono ? 2 : 1)) continue;
      SimulationSettings settings = flightSettings(index / 2);
      settings.mono = mono;
      const FaultyFlight flight(settings, fault, static_cast<std::uint64_t>(i));
      verdicts[static_cast<std::size_t>(i)] = judge(fly(flight, mono), flight, fault, mono, i, csv);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < std::max(1U, std::thread::hardware_concurrency()); ++t) threads.emplace_back(work);
  for (std::thread& t : threads) t.join();
  if (csv != nullptr) std::fclose(csv);
  std::vector<Verdict> done;
  for (const std::optional<Verdict>& v : verdicts) {
    if (v) done.push_back(*v);
  }
  return print(done) ? 0 : 1;
}
