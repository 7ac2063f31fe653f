#include "tests/odometry/health_verdict.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>

#include "tests/support/statistics.hpp"

namespace swiftlet::test {
namespace {

constexpr double kVelocityBound = 1.0;   // m/s
constexpr double kScaleBound = 0.2;      // relative
constexpr double kWrongTime = 1.0;       // s
constexpr double kScaleWindow = 3.0;     // s over which the scale is measured
constexpr double kScaleMinSpread = 0.3;  // m of true motion in it, RMS

bool report(const char* what, double value, const char* unit, double low, double high) {
  const bool ok = value >= low && value <= high;
  std::printf("  %-58s %9.4f %-5s asked [%g, %g]%s\n", what, value, unit, low, high, ok ? "" : "  MISSED");
  return ok;
}

}  // namespace

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

HealthVerdict judgeHealth(const std::vector<RunFrame>& frames, double rest, RigFault fault, bool mono) {
  HealthVerdict verdict{fault, mono};
  double wrong_since = -1;
  int good = 0;
  int from_first = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const RunFrame& f = frames[k];
    const bool is_good = f.has_state && f.state.health == Health::kGood;
    const double velocity = f.has_state ? velocityError(f) : 0;
    const double scale = f.has_state ? scaleError(frames, k) : std::nan("");
    const bool is_wrong = is_good && (velocity > kVelocityBound || (mono && std::abs(scale) > kScaleBound));
    if (!is_wrong) wrong_since = -1;
    if (is_wrong && wrong_since < 0) wrong_since = f.seconds;
    if (is_wrong) verdict.wrong = std::max(verdict.wrong, f.seconds - wrong_since);
    if (is_good) verdict.worst_good = std::max(verdict.worst_good, velocity);
    if (is_good && good == 0) verdict.first_good = std::max(0.0, f.seconds - (mono ? rest : 0));
    good += is_good ? 1 : 0;
    from_first += good > 0 ? 1 : 0;
  }
  verdict.good = good / static_cast<double>(frames.size());
  verdict.good_after = from_first > 0 ? good / static_cast<double>(from_first) : 0;
  return verdict;
}

void writeFramesHeader(std::FILE* csv) {
  std::fputs(
      "run,fault,mono,t,epoch,health,dv,dscale,dtilt,sv,sr,sbg,sba,speed,tracks,landmarks,mono_in,stereo_in,"
      "rms,imu,length,rest,iterations,fs,fss,doubt,known,pixel_sigma,gyro_factor,accel_factor\n",
      csv);
}

void writeFrames(std::FILE* csv, int run, const std::vector<RunFrame>& frames, RigFault fault, bool mono) {
  std::string lines;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const RunFrame& f = frames[k];
    if (!f.has_state) continue;
    const auto sigma = [&f](int at) {
      return std::sqrt(f.state.covariance.diagonal().segment<3>(at).maxCoeff());
    };
    char line[400];
    std::snprintf(line, sizeof line,
                  "%d,%s,%d,%.2f,%u,%d,%.3f,%.3f,%.4f,%.4f,%.4f,%.5f,%.4f,%.4f,%d,%d,%d,%d,%.3f,%.2f,%.1f,%d,"
                  "%d,%.4f,%.4f,%d,%d,%.3f,%.2f,%.2f\n",
                  run, kRigFaultNames[static_cast<std::size_t>(fault)], mono, f.seconds, f.state.epoch,
                  static_cast<int>(f.state.health), velocityError(f), scaleError(frames, k), tiltError(f),
                  sigma(6), sigma(0), sigma(9), sigma(12), f.state.v_world_body.norm(), f.statistics.tracks,
                  f.statistics.landmarks, f.statistics.inliers_mono, f.statistics.inliers_stereo,
                  f.statistics.reprojection_rms, f.statistics.imu_residual, f.statistics.track_length,
                  f.statistics.at_rest, f.statistics.iterations, f.statistics.scale, f.statistics.scale_sigma,
                  static_cast<int>(f.doubt), f.statistics.known, f.statistics.noise.pixel_sigma,
                  f.statistics.noise.imu.gyro, f.statistics.noise.imu.accel);
    lines += line;
  }
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::fputs(lines.c_str(), csv);
}

bool printHealth(const std::vector<HealthVerdict>& verdicts) {
  bool ok = true;
  std::printf("%-10s %-6s %6s %9s %11s %11s %12s\n", "fault", "camera", "runs", "good [%]", "wrong runs",
              "wrong [s]", "dv good");
  for (std::size_t fault = 0; fault < kRigFaultNames.size(); ++fault) {
    for (const bool mono : {false, true}) {
      std::vector<double> good;
      std::vector<double> wrong;
      double worst = 0;
      int wrong_runs = 0;
      for (const HealthVerdict& v : verdicts) {
        if (static_cast<std::size_t>(v.fault) != fault || v.mono != mono) continue;
        good.push_back(v.good);
        wrong.push_back(v.wrong);
        worst = std::max(worst, v.worst_good);
        wrong_runs += v.wrong > kWrongTime ? 1 : 0;
      }
      if (good.empty()) continue;
      std::printf("%-10s %-6s %6zu %9.1f %11d %11.2f %12.2f\n", kRigFaultNames[fault], mono ? "one" : "two",
                  good.size(), 100 * mean(good), wrong_runs, quantile(wrong, 1), worst);
    }
  }
  for (const bool mono : {false, true}) {
    std::vector<double> first;
    std::vector<double> after;
    std::vector<double> wrong;
    for (const HealthVerdict& v : verdicts) {
      if (v.mono != mono) continue;
      wrong.push_back(v.wrong);
      if (v.fault != RigFault::kNone) continue;
      first.push_back(v.first_good < 0 ? 1e9 : v.first_good);
      after.push_back(v.good_after);
    }
    if (wrong.empty()) continue;
    std::printf("%s\n", mono ? "one camera" : "two cameras");
    ok &= report("longest time good and wrong, all flights", quantile(wrong, 1), "s", 0, kWrongTime);
    if (first.empty()) continue;
    ok &= report("first good, healthy, 95 %", quantile(first, 0.95), "s", 0, mono ? 6 : 2);
    ok &= report("good from then on, healthy, mean", mean(after), "", 0.99, 1);
    std::printf("  good from then on, healthy, worst flight: %.3f\n", quantile(after, 0));
  }
  return ok;
}

}  // namespace swiftlet::test
