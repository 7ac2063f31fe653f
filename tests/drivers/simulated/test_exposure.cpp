// Light that changes in simulated flights, and exposure control in the loop with the images that it makes.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "drivers/simulated/simulated_flight.hpp"

namespace swiftlet {
namespace {

/// Light to a twentieth within 2 s, and back.
SimulationSettings darkFlight(ExposureMode mode) {
  SimulationSettings settings;
  settings.seed = 5;
  settings.flight.duration = 9;
  settings.camera_rate = 20;
  settings.rig = RigKind::kForward;
  settings.mono = true;
  settings.paint.texel = 0.02;
  settings.render.samples = 1;
  settings.exposure_mode = mode;
  settings.light_changes = {{2, 0.05}, {5.5, 1}};
  return settings;
}

struct Seen {
  std::vector<double> mean;
  std::vector<ExposureSetting> setting;
  std::vector<std::uint8_t> last;
};

Seen look(const SimulationSettings& settings) {
  const SimulatedFlight flight(settings);
  FlightCameras cameras(flight);
  const CameraModel& camera = flight.trueRig().camera[0];
  Seen seen;
  seen.last.resize(static_cast<std::size_t>(camera.width() * camera.height()));
  std::array<bool, kMaxCameras> present{};
  for (int k = 0; k < flight.imageCount(); ++k) {
    cameras.render(k, {seen.last.data(), nullptr}, present);
    const double sum = std::accumulate(seen.last.begin(), seen.last.end(), 0.0);
    seen.mean.push_back(sum / static_cast<double>(seen.last.size()));
    seen.setting.push_back(cameras.takenWith());
  }
  return seen;
}

}  // namespace

TEST_CASE("light goes from level to level by a constant ratio") {
  const std::vector<LightChange> changes = {{2, 0.05}, {10, 1}};
  CHECK(lightAt({}, 5) == 1);
  CHECK(lightAt(changes, 2) == 1);
  CHECK(lightAt(changes, 3) == Approx(std::sqrt(0.05)));
  CHECK(lightAt(changes, 4) == Approx(0.05));
  CHECK(lightAt(changes, 9) == Approx(0.05));
  CHECK(lightAt(changes, 11) == Approx(std::sqrt(0.05)));
  CHECK(lightAt(changes, 30) == Approx(1));
}

TEST_CASE("light changes that overlap or go to black are refused") {
  SimulationSettings settings = darkFlight(ExposureMode::kFixed);
  settings.light_changes = {{2, 0.05}, {3, 1}};
  CHECK_THROWS_AS(SimulatedFlight(settings), std::invalid_argument);
  settings.light_changes = {{2, 0}};
  CHECK_THROWS_AS(SimulatedFlight(settings), std::invalid_argument);
}

TEST_CASE("exposure control keeps images usable where a fixed exposure does not") {
  const Seen fixed = look(darkFlight(ExposureMode::kFixed));
  const Seen controlled = look(darkFlight(ExposureMode::kOdometry));
  REQUIRE(fixed.mean.size() == controlled.mean.size());
  const std::size_t dim = 20 * 5;
  CHECK(fixed.mean[dim] < 12);
  for (const ExposureSetting& setting : fixed.setting) CHECK(setting == fixed.setting[0]);
  // From the first second on, through both changes.
  for (std::size_t k = 20; k < controlled.mean.size(); ++k) {
    INFO("image " << k);
    CHECK(controlled.mean[k] > 50);
    CHECK(controlled.mean[k] < 180);
  }
  CHECK(controlled.setting[dim].gain > 4 * controlled.setting[30].gain);
  const auto longest =
      std::ranges::max_element(controlled.setting, {}, [](const ExposureSetting& s) { return s.exposure; });
  CHECK(longest->exposure.seconds() <= SimulatedExposure::kLongest);
}

TEST_CASE("the loop gives the same images on any number of threads") {
  SimulationSettings settings = darkFlight(ExposureMode::kOdometry);
  settings.flight.duration = 3;
  settings.threads = 1;
  const Seen one = look(settings);
  settings.threads = 3;
  const Seen three = look(settings);
  CHECK(one.last == three.last);
  CHECK(one.setting == three.setting);
}

}  // namespace swiftlet
