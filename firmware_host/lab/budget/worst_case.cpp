#include "firmware_host/lab/budget/worst_case.hpp"

#include <algorithm>
#include <memory>

#include "drivers/simulated/simulated_source.hpp"
#include "drivers/simulated/track_simulator.hpp"
#include "estimator/odometry/propagation_stage.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/schedule/lockstep.hpp"

namespace swiftlet {
namespace {

constexpr int kFixes = 200;
constexpr double kRenderedSeconds = 6;
constexpr double kTracksSeconds = 12;
constexpr double kFastImu = 1000;  // Hz

/// Tracking and smoothing at their limits, everything else disabled.
Settings fullStages(const Settings& settings) {
  Settings most = settings;
  most.odometry.max_features = static_cast<int>(kMaxFeatures);
  most.odometry.use_stereo = true;
  most.effort.features = static_cast<int>(kMaxFeatures);
  most.mesh.enabled = most.loop.enabled = most.map.enabled = false;
  return most;
}

/// A graph on simulated input, in lockstep.
class Run : private RunListener {
 public:
  Run(const SimulatedFlight& flight, const Settings& settings)
      : settings_(fullStages(settings)),
        graph_(flight.givenRig(), flight.settings().imu.noise, settings_, observer_, GraphOptions{}) {}

  void take(const ImuSample& sample) { graph_.sensors().takeImu(sample, sample.stamp, now()); }
  void take(const CameraFrame& image) {
    graph_.sensors().takeImage(image, now());
    runAll(graph_);
  }
  void take(const TrackedFrame& tracked) {
    static_cast<void>(graph_.track().takeTracks(tracked, graph_.sensors().timeline()));
    runAll(graph_);
  }
  /// Call once; returns the stages' times.
  const StageTable& end() {
    graph_.sensors().endInput();
    runAll(graph_);
    graph_.report(observer_);
    return observer_.statistics().times;
  }

  std::size_t features = 0;   ///< largest number in a frame
  std::size_t landmarks = 0;  ///< largest number in the window

 private:
  static HostTimes now() { return {wallSeconds(), wallSeconds()}; }
  void onFrame(const TrackedFrame& tracked, const OdometryOutput& output) override {
    features = std::max(features, tracked.features.size());
    landmarks = std::max(landmarks, static_cast<std::size_t>(output.statistics.landmarks));
  }
  void onImuState(const NavState& /*state*/) override {}
  void onFinish(const OdometryOutput& /*output*/) override {}
  void onRemark(Stamp /*stamp*/, const std::string& /*text*/) override {}

  const Settings settings_;
  RunObserver observer_{*this};
  Graph graph_;
};

void copyTimes(const StageTable& from, StageId stage, StageTable& to) {
  to[static_cast<std::size_t>(stage)] = from[static_cast<std::size_t>(stage)];
}

void propagateWorst(const Settings& settings, StageTable& times) {
  SimulationSettings simulation;
  simulation.flight.duration = 20;
  const SimulatedFlight flight(simulation);
  const auto& samples = flight.imu().samples;
  PropagationStage stage(flight.settings().imu.noise, settings.odometry);
  StateFix fix;
  fix.has_state = true;
  fix.state.stamp = samples.front().stamp;
  fix.state.covariance.diagonal().setConstant(1e-4);
  stage.take(fix);
  NavState state;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    addTime(times, StageId::kImu, measured([&] {
              if (i + kFixes >= samples.size()) stage.take(fix);
              static_cast<void>(stage.step(samples[i], &state));
            }));
  }
}

void trackWorst(const Settings& settings, WorstCase& worst) {
  SimulationSettings simulation;
  simulation.world.kind = WorldKind::kCluttered;
  simulation.flight.duration = kRenderedSeconds;
  simulation.flight.aggressiveness = 2;
  for (const double start : {1.5, 3.0, 4.5}) {
    simulation.faults.push_back({FaultKind::kBlackout, {start, start + 0.6}, -1});
  }
  SimulatedSource source(simulation);
  const auto run = std::make_unique<Run>(source.flight(), settings);
  ImuSample sample;
  CameraFrame image;
  for (auto item = source.next(sample, image); item != SimulatedSource::Item::kEnd;
       item = source.next(sample, image)) {
    if (item == SimulatedSource::Item::kImu) {
      run->take(sample);
    } else {
      run->take(image);
    }
  }
  copyTimes(run->end(), StageId::kTrack, worst.times);
  worst.features = run->features;
}

void smoothWorst(const Settings& settings, WorstCase& worst) {
  SimulationSettings simulation;
  simulation.flight.duration = kTracksSeconds;
  simulation.imu.noise.rate_hz = kFastImu;
  simulation.tracks.max_tracks = static_cast<int>(kMaxFeatures);
  simulation.tracks.landmarks = 20'000;
  simulation.tracks.mean_lifetime = 1;
  simulation.tracks.dropout = 0;
  simulation.tracks.right_share = 1;
  const SimulatedFlight flight(simulation);
  TrackSimulator simulator(flight.world(), flight.trueRig(), flight.trajectory(), flight.settings().tracks);
  const auto run = std::make_unique<Run>(flight, settings);
  TrackedFrame tracked;
  std::size_t next = 0;
  const auto& samples = flight.imu().samples;
  for (int k = 0; k < flight.imageCount(); ++k) {
    const Stamp stamp = flight.imageStamp(k);
    for (; next < samples.size() && samples[next].stamp <= stamp; ++next) run->take(samples[next]);
    simulator.step(flight.imageTime(k), stamp, tracked);
    tracked.index = static_cast<std::uint64_t>(k);
    run->take(tracked);
  }
  const StageTable& times = run->end();
  copyTimes(times, StageId::kSmooth, worst.times);
  copyTimes(times, StageId::kTrim, worst.times);
  worst.tracks = run->features;
  worst.landmarks = run->landmarks;
}

}  // namespace

WorstCase measureWorstCase(const Settings& settings, const std::function<void(const char*)>& progress) {
  WorstCase worst;
  const auto say = [&](const char* what) {
    if (progress) progress(what);
  };
  say("propagating");
  propagateWorst(settings, worst.times);
  say("rendering and tracking");
  trackWorst(settings, worst);
  say("smoothing");
  smoothWorst(settings, worst);
  return worst;
}

}  // namespace swiftlet
