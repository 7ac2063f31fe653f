#include "firmware_host/commands/worst_case.hpp"

#include <algorithm>
#include <memory>

#include "drivers/simulated/simulated_source.hpp"
#include "drivers/simulated/track_simulator.hpp"
#include "estimator/odometry/pairing.hpp"
#include "estimator/odometry/propagation_stage.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "estimator/odometry/track_stage.hpp"

namespace swiftlet {
namespace {

constexpr int kFixes = 200;
constexpr double kRenderedSeconds = 6;
constexpr double kTracksSeconds = 12;
constexpr double kFastImu = 1000;  // Hz

OdometrySettings mostFeatures(const Settings& settings) {
  OdometrySettings most = settings.odometry;
  most.max_features = static_cast<int>(kMaxFeatures);
  most.use_stereo = true;
  return most;
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
  const auto stage = std::make_unique<TrackStage>(
      source.flight().givenRig(), source.flight().settings().imu.noise, mostFeatures(settings));
  Pairing pairing{PairingSettings{}};
  Effort effort = settings.effort;
  effort.features = static_cast<int>(kMaxFeatures);
  ImuSample sample;
  CameraFrame image;
  StereoFrame frame;
  TrackedFrame tracked;
  for (auto item = source.next(sample, image); item != SimulatedSource::Item::kEnd;
       item = source.next(sample, image)) {
    if (item == SimulatedSource::Item::kImu) {
      stage->addImu(sample);
    } else if (pairing.push(image, frame).ok()) {
      const Spent spent = measured([&] { static_cast<void>(stage->step(frame, effort, tracked)); });
      addTime(worst.times, StageId::kTrack, spent, tracked.keyframe);
      worst.features = std::max(worst.features, tracked.features.size());
    }
  }
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
  const auto stage =
      std::make_unique<SmoothStage>(flight.givenRig(), flight.settings().imu.noise, mostFeatures(settings));
  Effort effort = settings.effort;
  effort.features = static_cast<int>(kMaxFeatures);
  TrackedFrame tracked;
  const auto output = std::make_unique<OdometryOutput>();
  const auto window = std::make_unique<SmoothedWindow>();
  std::size_t next = 0;
  const auto& samples = flight.imu().samples;
  for (int k = 0; k < flight.imageCount(); ++k) {
    const Stamp stamp = flight.imageStamp(k);
    for (; next < samples.size() && samples[next].stamp <= stamp; ++next) stage->addImu(samples[next]);
    simulator.step(flight.imageTime(k), stamp, tracked);
    tracked.index = static_cast<std::uint64_t>(k);
    const Spent spent = measured([&] { static_cast<void>(stage->step(tracked, effort, *output)); });
    addTime(worst.times, StageId::kSmooth, spent, tracked.keyframe);
    addTime(worst.times, StageId::kTrim, measured([&] { stage->trim(); }), tracked.keyframe);
    stage->window(*window);
    worst.tracks = std::max(worst.tracks, tracked.features.size());
    worst.landmarks = std::max(worst.landmarks, window->landmarks.size());
  }
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
