// The noise of tracks is found from their residuals, and how long their errors last.

#include <algorithm>
#include <catch2/catch.hpp>

#include "estimator/smoother/pixel_noise.hpp"
#include "estimator/smoother/track_correlation.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::OdometryRun;
using test::RunFrame;
using test::TrackFlight;

namespace {

OdometryRun noisyRun(double pixel_sigma, bool stereo) {
  SimulationSettings settings = test::roomFlight(12, 77);
  settings.tracks.pixel_sigma = pixel_sigma;
  const TrackFlight flight(settings);
  OdometrySettings odometry = test::settingsFor(flight, stereo);
  odometry.pixel_sigma = OdometrySettings{}.pixel_sigma;
  return test::runOdometry(flight, odometry);
}

double worstVelocity(const OdometryRun& run, double from) {
  double worst = 0;
  for (const RunFrame& f : run.frames) {
    if (f.has_state && f.seconds >= from) worst = std::max(worst, test::velocityError(f));
  }
  return worst;
}

}  // namespace

TEST_CASE("Pixel noise: follows residuals, between 0.55 and fifteen times what is set", "[odometry]") {
  PixelNoise noise(0.5);
  CHECK(noise.sigma() == 0.5);
  const auto after = [&noise](double sigma) {  // residuals of tracks with that noise, for 20 s
    for (int k = 0; k < 400; ++k) {
      noise.update(1.3863 * (sigma / noise.sigma()) * (sigma / noise.sigma()), 0.05);
    }
    return noise.sigma();
  };
  CHECK(after(0.1) == Approx(0.5 / 1.8));
  CHECK(after(0.4) == Approx(0.4).epsilon(0.01));
  CHECK(after(2.0) == Approx(2.0).epsilon(0.01));
  CHECK(after(50.0) == Approx(7.5).epsilon(0.01));
  CHECK(after(0.6) == Approx(0.6).epsilon(0.01));
}

TEST_CASE("Odometry: tracks four times as noisy as set are weighted as they are", "[odometry]") {
  for (const bool stereo : {true, false}) {
    CAPTURE(stereo);
    const OdometryRun run = noisyRun(2.0, stereo);
    CHECK(run.frames.back().statistics.noise.pixel_sigma == Approx(2.0).epsilon(0.15));
    CHECK(run.frames.back().state.epoch == 0);
    CHECK(worstVelocity(run, 6) < 0.25);
  }
}

TEST_CASE("Track correlation: a pose's variance grows with what lasts", "[odometry]") {
  TrackCorrelation tracks;
  CHECK(tracks.varianceFactor() == 1);
  for (int k = 0; k < 100; ++k) tracks.update(-7, 100, 0.25);
  CHECK(tracks.varianceFactor() == 1);
  for (int k = 0; k < 200; ++k) tracks.update(50, 100, 0.25);
  CHECK(tracks.varianceFactor() == Approx(2).epsilon(0.01));
  for (int k = 0; k < 200; ++k) tracks.update(99, 100, 0.25);
  CHECK(tracks.varianceFactor() == Approx(4));
}

TEST_CASE("Odometry: independent errors of tracks leave the covariance as it is", "[odometry]") {
  const OdometryRun run = noisyRun(0.5, true);
  CHECK(run.frames.back().statistics.pose_variance_factor < 1.1);
}

TEST_CASE("Odometry: tracks as noisy as set leave the noise as it is", "[odometry]") {
  const OdometryRun run = noisyRun(OdometrySettings{}.pixel_sigma, true);
  for (const RunFrame& f : run.frames) {
    if (f.has_state) CHECK(f.statistics.noise.pixel_sigma < 1.1 * OdometrySettings{}.pixel_sigma);
  }
}
