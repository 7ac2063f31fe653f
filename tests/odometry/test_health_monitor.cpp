// Each doubt alone takes "good" away, and names itself; what a start and a loss cost.

#include "estimator/odometry/health_monitor.hpp"

#include <catch2/catch.hpp>
#include <memory>

using namespace swiftlet;

namespace {

struct Watched {
  explicit Watched(std::size_t cameras = 2) : monitor(OdometrySettings{}, cameras) {
    frame.camera_present = {true, cameras > 1};
    statistics.tracks = statistics.known = 100;
    statistics.inliers_stereo = 95;
    statistics.imu_residual = 0.3;
    statistics.noise.pixel_sigma = OdometrySettings{}.pixel_sigma;
    statistics.scale_sigma = cameras == 1 ? 0.02 : 0;
    state.covariance = 1e-4 * Matrix15d::Identity();
  }

  Health step(double seconds = 0.05) {
    frame.stamp = frame.stamp + Duration::fromSeconds(seconds);
    const bool first = steps++ == 0;
    return monitor.update({frame, statistics, state, false, first, scale_known});
  }
  Health steps_of(int count) {
    Health health = Health::kInitializing;
    for (int k = 0; k < count; ++k) health = step();
    return health;
  }

  HealthMonitor monitor;
  TrackedFrame frame;
  FrameStatistics statistics;
  NavState state;
  int steps = 0;
  bool scale_known = true;
};

}  // namespace

TEST_CASE("Health: good after ten images at 20 Hz, as soon at other rates", "[health]") {
  Watched watched;
  CHECK(watched.steps_of(9) == Health::kInitializing);
  CHECK(watched.step() == Health::kGood);
  CHECK(watched.monitor.doubt() == Doubt::kNone);
  for (const double rate : {10.0, 60.0, 120.0}) {
    Watched other;
    double seconds = 0;
    other.step();
    while (other.step(1 / rate) != Health::kGood) seconds += 1 / rate;
    INFO(rate << " Hz");
    CHECK(seconds == Approx(0.45).margin(1.01 / rate));
  }
}

TEST_CASE("Health: each doubt ends good by its name, and good comes back after it", "[health]") {
  const auto spoil = [](Watched& w, Doubt doubt) {
    if (doubt == Doubt::kImplausible) w.state.v_world_body = {31, 0, 0};
    if (doubt == Doubt::kTracksDisagree) w.statistics.inliers_stereo = 60;
    if (doubt == Doubt::kImuDisagrees) w.statistics.imu_residual = 3;
    if (doubt == Doubt::kUncertain) w.state.covariance.diagonal().segment<3>(6).setConstant(0.25 * 0.25);
    if (doubt == Doubt::kScaleDisagrees) w.statistics.scale = 1.16;
    if (doubt == Doubt::kCameraMissing) w.frame.camera_present[1] = false;
    if (doubt == Doubt::kFewSightings) {
      w.statistics.known = w.statistics.tracks = 20;
      w.statistics.inliers_stereo = 20;
    }
  };
  for (const Doubt doubt :
       {Doubt::kImplausible, Doubt::kTracksDisagree, Doubt::kImuDisagrees, Doubt::kUncertain,
        Doubt::kScaleDisagrees, Doubt::kCameraMissing, Doubt::kFewSightings}) {
    INFO("doubt " << static_cast<int>(doubt));
    const std::size_t cameras = doubt == Doubt::kScaleDisagrees ? 1 : 2;
    Watched watched(cameras);
    REQUIRE(watched.steps_of(20) == Health::kGood);
    const Watched before = watched;
    spoil(watched, doubt);
    CHECK(watched.steps_of(20) != Health::kGood);
    CHECK(watched.monitor.doubt() == doubt);
    watched.statistics = before.statistics;
    watched.state = before.state;
    watched.frame.camera_present = before.frame.camera_present;
    CHECK(watched.steps_of(60) == Health::kGood);
  }
}

TEST_CASE("Health: one camera is initializing until its scale is confirmed", "[health]") {
  Watched watched(1);
  watched.statistics.scale_sigma = 1;
  watched.scale_known = false;
  CHECK(watched.steps_of(100) == Health::kInitializing);
  CHECK(watched.monitor.doubt() == Doubt::kScaleUnknown);
  CHECK_FALSE(watched.monitor.lost());
  watched.statistics.scale_sigma = 0.05;
  watched.scale_known = true;
  CHECK(watched.steps_of(11) == Health::kGood);
  // Hovering, the filter forgets; the scale does not change by that.
  watched.statistics.scale_sigma = 0.4;
  CHECK(watched.steps_of(20) == Health::kGood);
}

TEST_CASE("Health: a contradicted start is lost after a second, a contradicted scale after three",
          "[health]") {
  Watched start(1);
  start.statistics.scale = 1.5;
  start.steps_of(19);
  CHECK_FALSE(start.monitor.lost());
  start.steps_of(3);
  CHECK(start.monitor.lost());
  // After the loss it takes twice as long to be good.
  start.monitor.reset();
  start.steps = 0;
  start.statistics.scale = 1;
  CHECK(start.steps_of(18) == Health::kInitializing);
  CHECK(start.steps_of(3) == Health::kGood);

  Watched later(1);
  REQUIRE(later.steps_of(20) == Health::kGood);
  later.statistics.scale = 1.5;
  CHECK(later.steps_of(59) == Health::kDegraded);
  CHECK_FALSE(later.monitor.lost());
  later.steps_of(3);
  CHECK(later.monitor.lost());
}

TEST_CASE("Health: figures far outside the limits are failed, then lost", "[health]") {
  Watched watched;
  REQUIRE(watched.steps_of(20) == Health::kGood);
  watched.state.covariance.diagonal().segment<3>(6).setConstant(4);
  CHECK(watched.steps_of(20) == Health::kFailed);
  CHECK_FALSE(watched.monitor.lost());
  watched.steps_of(25);
  CHECK(watched.monitor.lost());
}

TEST_CASE("Health: after a disagreement it takes two seconds to be good again", "[health]") {
  Watched watched;
  REQUIRE(watched.steps_of(20) == Health::kGood);
  const FrameStatistics sound = watched.statistics;
  watched.statistics.imu_residual = 3;
  REQUIRE(watched.steps_of(20) == Health::kDegraded);
  watched.statistics = sound;
  double seconds = 0;
  while (watched.step() != Health::kGood && seconds < 10) {
    seconds = watched.monitor.doubt() == Doubt::kSettling ? seconds + 0.05 : 0;
  }
  CHECK(seconds == Approx(2).margin(0.11));
}

TEST_CASE("Health: raised pixel noise does not excuse the IMU's residuals", "[health]") {
  Watched watched;
  watched.statistics.noise.pixel_sigma *= 5;  // noise of the tracks alone
  REQUIRE(watched.steps_of(20) == Health::kGood);
  watched.statistics.imu_residual = 0.6;
  CHECK(watched.steps_of(20) == Health::kDegraded);
  CHECK(watched.monitor.doubt() == Doubt::kImuDisagrees);
}

TEST_CASE("Health: a speed that no vehicle has is lost without accepted images too", "[health]") {
  Watched watched;
  REQUIRE(watched.steps_of(20) == Health::kGood);
  CHECK(watched.monitor.useful());
  watched.statistics.inliers_stereo = 0;
  watched.state.v_world_body = {1000, 0, 0};
  watched.step();
  CHECK_FALSE(watched.monitor.useful());
  watched.steps_of(45);
  CHECK(watched.monitor.lost());
}

TEST_CASE("Health: a slow camera's usual interval is not counted against it", "[health]") {
  for (const double interval : {0.25, 0.32, 0.5}) {
    CAPTURE(interval);
    Watched watched;
    for (int k = 0; k < 10; ++k) watched.step(interval);
    REQUIRE(watched.monitor.health() == Health::kGood);
    CHECK(watched.monitor.at(watched.frame.stamp + Duration::fromSeconds(interval + 0.2)) == Health::kGood);
    CHECK(watched.monitor.at(watched.frame.stamp + Duration::fromSeconds(interval + 0.3)) ==
          Health::kDegraded);
    CHECK(HealthMonitor::aged(Health::kGood, watched.frame.stamp, watched.monitor.goodAge(),
                              watched.frame.stamp + Duration::fromSeconds(interval + 0.2)) == Health::kGood);
  }
  // At 20 Hz a silence says as much as ever, also after an earlier one.
  Watched fast;
  REQUIRE(fast.steps_of(20) == Health::kGood);
  CHECK(fast.monitor.goodAge() == Approx(HealthMonitor::kGoodAge));
  fast.step(0.9);
  fast.step();
  CHECK(fast.monitor.goodAge() == Approx(HealthMonitor::kGoodAge));
}
