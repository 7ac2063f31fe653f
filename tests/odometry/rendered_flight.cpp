#include "tests/odometry/rendered_flight.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <variant>

#include "drivers/recorded/open_log.hpp"
#include "drivers/simulated/folder_writer.hpp"

namespace swiftlet::test {
namespace {

void render(const SimulationSettings& settings, const std::string& folder) {
  if (std::filesystem::is_directory(folder)) return;
  const std::string unfinished = folder + ".unfinished";
  std::filesystem::remove_all(unfinished);
  std::string message;
  if (!simulateToFolder(settings, unfinished, {}, &message).ok()) throw std::runtime_error(message);
  std::filesystem::rename(unfinished, folder);
}

}  // namespace

ImuNoise broadImu() {
  ImuNoise noise;
  noise.rate_hz = 285.7;
  noise.gyro_density = 1.0e-4;
  noise.accel_density = 2.9e-3;
  return noise;
}

RenderedFlight::RenderedFlight(const SimulationSettings& settings, const std::string& folder)
    : flight_(settings) {
  render(settings, folder);
  const std::unique_ptr<LogSource> log = openLog(folder, {});
  frames_.resize(static_cast<std::size_t>(flight_.imageCount()));
  for (std::size_t k = 0; k < frames_.size(); ++k) {
    frames_[k].index = k;
    frames_[k].stamp = flight_.imageStamp(static_cast<int>(k));
  }
  SensorMessage message;
  while (log->next(message)) {
    const auto* image = std::get_if<CameraFrame>(&message);
    if (image == nullptr) continue;
    const auto frame = std::ranges::find(frames_, image->stamp, &StereoFrame::stamp);
    if (frame == frames_.end()) throw std::runtime_error(folder + " holds another flight: remove it");
    const ImageView& view = image->image;
    std::vector<std::uint8_t>& copy = pixels_.emplace_back();
    for (int row = 0; row < view.height; ++row) {
      copy.insert(copy.end(), view.row(row), view.row(row) + view.width);
    }
    frame->image[image->camera] = {copy.data(), view.width, view.height, view.width};
  }
}

GivenFlight RenderedFlight::given() const {
  GivenFlight given{flight_.givenRig(), flight_.settings().imu.noise, flight_.imu().samples, {}};
  for (const StereoFrame& frame : frames_) given.stamps.push_back(frame.stamp);
  return given;
}

GivenFlight RenderedFlight::givenWithImu(const ImuNoise& noise, std::uint64_t seed) const {
  GivenFlight given = this->given();
  ImuSimulationSettings imu = flight_.settings().imu;
  imu.noise = noise;
  imu.seed = seed;
  given.noise = noise;
  given.samples =
      simulateImu(flight_.trajectory(), imu, flight_.settings().start, flight_.duration()).samples;
  return given;
}

BodyState RenderedFlight::truth(std::size_t k) const {
  const MotionState motion = flight_.trajectory().at(seconds(k));
  BodyState truth;
  truth.T_world_body = motion.T_world_body;
  truth.v_world_body = motion.v_world_body;
  return truth;
}

std::vector<RunFrame> RenderedFlight::fly(const GivenFlight& given, const OdometrySettings& settings,
                                          std::size_t first, std::size_t last) const {
  Odometry odometry(given.rig, given.noise, settings);
  const auto tracked = std::make_unique<TrackedFrame>();
  const auto output = std::make_unique<OdometryOutput>();
  std::vector<RunFrame> run;
  const Stamp begin = given.stamps[first] - Duration::fromMilliseconds(500);
  std::size_t next = 0;
  while (next < given.samples.size() && given.samples[next].stamp < begin) ++next;
  for (std::size_t k = first; k < std::min(last, frames_.size()); ++k) {
    while (next < given.samples.size() && given.samples[next].stamp <= given.stamps[k]) {
      static_cast<void>(odometry.addImu(given.samples[next++]));
    }
    StereoFrame frame = frames_[k];
    frame.stamp = given.stamps[k];
    if (!settings.use_stereo) frame.image[1] = {};
    RunFrame& result = run.emplace_back();
    result.index = k;
    result.seconds = seconds(k) - seconds(first);
    result.truth = truth(k);
    if (!odometry.track(frame, Effort{}, *tracked).ok()) continue;
    static_cast<void>(odometry.smooth(*tracked, Effort{}, *output));
    take(*output, result);
  }
  return run;
}

}  // namespace swiftlet::test
