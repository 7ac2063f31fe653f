// A rolling shutter: told of it, the odometry is as good as with a global one; the readout is found.

#include <catch2/catch.hpp>

#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::OdometryRun;
using test::TrackFlight;

namespace {

constexpr double kReadout = 0.02;  // s

TrackFlight flown(double readout, bool stereo) {
  SimulationSettings settings = test::roomFlight(20, 91);
  settings.flight.aggressiveness = 1.5;
  settings.mono = !stereo;
  settings.render.readout = readout;
  return TrackFlight(settings);
}

}  // namespace

TEST_CASE("Odometry: a rolling shutter costs no accuracy once it is told", "[odometry]") {
  for (const bool stereo : {true, false}) {
    CAPTURE(stereo);
    const double global =
        test::ate(test::runOdometry(flown(0, stereo), test::settingsFor(flown(0, stereo), stereo)).frames, 3);
    const TrackFlight flight = flown(kReadout, stereo);
    const OdometrySettings settings = test::settingsFor(flight, stereo);
    const OdometryRun told = test::runOdometry(flight, settings);
    CHECK(told.frames.back().state.health == Health::kGood);
    CHECK(test::ate(told.frames, 3) < 1.3 * global);
    Rig untold = flight.rig();
    untold.readout = Duration{};
    CHECK(test::ate(test::runOdometry(flight, settings, 0, 0.5, {}, untold).frames, 3) > 3 * global);
  }
}

TEST_CASE("Odometry: the readout is found with the time offset", "[odometry]") {
  const TrackFlight flight = flown(kReadout, true);
  OdometrySettings settings = test::settingsFor(flight);
  settings.estimate_time_offset = true;
  Rig given = flight.rig();
  given.readout = Duration::fromMilliseconds(17);
  const CalibrationEstimate found =
      test::runOdometry(flight, settings, 0, 0.5, {}, given).frames.back().calibration;
  const double error = found.readout.seconds() - kReadout;
  CHECK(std::abs(error) < 0.3e-3);
  CHECK(std::abs(error) < 4 * found.readout_sigma);
  CHECK(found.readout_sigma < 0.2e-3);
  CHECK(std::abs(found.camera_to_imu_shift.seconds()) < 0.3e-3);
}
