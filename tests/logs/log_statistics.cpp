// Consistency and starts on logs with truth (rendered flights, recordings), stereo, default settings:
//   log_statistics LOG...
// Consistency: 6-dof pose NEES of the causal estimate, position and yaw relative to the first pose, at
// 10 s, 30 s and at the log's end. Starts: a new run every two seconds of the log, its tilt and velocity
// errors half a second after its first image, where the vehicle is in motion.
// docs/experiments/accuracy_flights.md quotes them.

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/schedule/lockstep.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet {
namespace {

using test::mean;
using test::quantile;

constexpr double kDegrees = 180.0 / 3.14159265358979323846;
constexpr double kNotAsked = std::numeric_limits<double>::infinity();
const Duration kLargestTruthGap = Duration::fromMilliseconds(20);

/// Keeps every causal state.
class StateKeeper : public RunListener {
 public:
  void onFrame(const TrackedFrame& /*tracked*/, const OdometryOutput& output) override {
    if (output.has_state) states.push_back(output.state);
  }
  void onImuState(const NavState& /*state*/) override {}
  void onFinish(const OdometryOutput& /*output*/) override {}
  void onRemark(Stamp /*stamp*/, const std::string& /*text*/) override {}
  std::vector<NavState> states;
};

struct Run {
  std::vector<NavState> states;
  Stamp first_image;  // that was fed
};

Run runLog(const std::string& log, double from, double until) {
  const std::unique_ptr<LogSource> source = openLog(log, LogOptions{});
  StateKeeper keeper;
  RunObserver run_observer(keeper);
  const Settings settings;
  const auto graph =
      std::make_unique<Graph>(source->rig(), source->imuNoise(), settings, run_observer, GraphOptions{});
  LogSection section;
  section.from = from;
  if (until < kNotAsked) section.until = until;
  LogFeed feed(*source, section, nullptr);
  runLockstep(feed, *graph, RunControl{});
  const auto first = run_observer.statistics().first_image;
  return {std::move(keeper.states), first ? *first : Stamp{}};
}

const NavState* stateAt(const Run& run, double seconds) {
  const Stamp stamp = run.first_image + Duration::fromSeconds(seconds);
  const auto found = std::ranges::find_if(run.states, [&](const NavState& s) { return s.stamp >= stamp; });
  return found == run.states.end() ? nullptr : &*found;
}

/// NEES of `state` with position and yaw relative to the first state.
double nees(const Run& run, const NavState& state, const Trajectory& truth) {
  std::array<ConsistencySample, 2> samples;
  const std::array<const NavState*, 2> states{&run.states.front(), &state};
  for (std::size_t k = 0; k < 2; ++k) {
    const auto true_pose = interpolate(truth, states[k]->stamp, kLargestTruthGap);
    if (!true_pose) return kNotAsked;
    samples[k] = {states[k]->T_world_body, *true_pose, states[k]->covariance.topLeftCorner<6, 6>()};
  }
  return consistency(samples).nees_pose;
}

struct StartError {
  double tilt_deg = kNotAsked;
  double velocity = kNotAsked;  // m/s
};

StartError startError(const NavState& state, const Trajectory& truth) {
  const Duration step = Duration::fromMilliseconds(5);
  const auto now = interpolate(truth, state.stamp, kLargestTruthGap);
  const auto before = interpolate(truth, state.stamp - step, kLargestTruthGap);
  const auto after = interpolate(truth, state.stamp + step, kLargestTruthGap);
  if (!now || !before || !after) return {};
  const Eigen::Vector3d velocity = (after->translation - before->translation) / (2 * step.seconds());
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d up = state.T_world_body.rotation.conjugate() * z;
  const Eigen::Vector3d true_up = now->rotation.conjugate() * z;
  return {
      std::atan2(up.cross(true_up).norm(), up.dot(true_up)) * kDegrees,
      (state.T_world_body.rotation.conjugate() * state.v_world_body - now->rotation.conjugate() * velocity)
          .norm()};
}

struct Totals {
  std::array<std::vector<double>, 3> nees;  // at 10 s, 30 s, the end
  std::vector<double> tilt;
  std::vector<double> velocity;
};

void addLog(const std::string& log, Totals& totals) {
  constexpr double kStartEvery = 2.0;  // s
  constexpr double kStartAfter = 0.5;  // s, when a start is judged
  constexpr double kMinSpeed = 0.05;   // m/s: at rest there is nothing to find
  const auto source = openLog(log, LogOptions{});
  const Trajectory truth = onImageClock(source->groundTruth(), source->rig().camera_to_imu_shift);
  const Run whole = runLog(log, 0, kNotAsked);
  if (truth.empty() || whole.states.empty()) {
    fmt::print("  {}: no truth, or no pose\n", log);
    return;
  }
  const double seconds = (whole.states.back().stamp - whole.first_image).seconds();
  const std::array<double, 3> times{10, 30, seconds};
  std::string line = fmt::format("  {} ({:.0f} s): NEES", log, seconds);
  for (std::size_t k = 0; k < times.size(); ++k) {
    const NavState* state = stateAt(whole, times[k]);
    const double value = state != nullptr ? nees(whole, *state, truth) : kNotAsked;
    if (std::isfinite(value)) totals.nees[k].push_back(value);
    line += fmt::format(" {:.2f}", value);
  }
  std::vector<double> tilt;
  std::vector<double> velocity;
  for (double from = kStartEvery; from + kStartAfter < seconds; from += kStartEvery) {
    const NavState* there = stateAt(whole, from);
    if (there == nullptr || there->v_world_body.norm() < kMinSpeed) continue;
    const Run start = runLog(log, from, from + kStartAfter + 0.1);
    const NavState* state = stateAt(start, kStartAfter);
    const StartError error = state != nullptr ? startError(*state, truth) : StartError{};
    tilt.push_back(error.tilt_deg);
    velocity.push_back(error.velocity);
  }
  fmt::print("{}; {} starts, tilt {:.2f} / {:.2f} deg, velocity {:.4f} / {:.4f} m/s (median / 90 %)\n", line,
             tilt.size(), quantile(tilt, 0.5), quantile(tilt, 0.9), quantile(velocity, 0.5),
             quantile(velocity, 0.9));
  std::fflush(stdout);
  totals.tilt.insert(totals.tilt.end(), tilt.begin(), tilt.end());
  totals.velocity.insert(totals.velocity.end(), velocity.begin(), velocity.end());
}

int run(const std::vector<std::string>& logs) {
  Totals totals;
  for (const std::string& log : logs) addLog(log, totals);
  fmt::print("mean pose NEES at 10 s {:.2f}, 30 s {:.2f}, the end {:.2f} (6; {} logs)\n",
             mean(totals.nees[0]), mean(totals.nees[1]), mean(totals.nees[2]), totals.nees[2].size());
  fmt::print(
      "{} starts in motion, 0.5 s after the first image: tilt {:.2f} / {:.2f} deg, velocity {:.4f} m/s\n",
      totals.tilt.size(), quantile(totals.tilt, 0.5), quantile(totals.tilt, 0.9),
      quantile(totals.velocity, 0.5));
  return 0;
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  try {
    return swiftlet::run(std::vector<std::string>(argv + 1, argv + argc));
  } catch (const swiftlet::InputError& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
