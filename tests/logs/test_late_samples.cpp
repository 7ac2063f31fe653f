// Frames that wait for their IMU samples are not overload: less effort would not bring the samples sooner.

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/graph/run_observer.hpp"
#include "firmware_host/realtime/effort_governor.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/schedule/lockstep.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/logs/silent_listener.hpp"
#include "tests/sanitized.hpp"

namespace swiftlet {
namespace {

constexpr Duration kFramePeriod = Duration::fromMilliseconds(50);
constexpr int kSlower = kSanitized ? 10 : 1;
constexpr Duration kSamplePatience = Duration::fromMilliseconds(60 * kSlower);
/// No step takes as long; the governor's allowance for a frame's age is shorter than kSamplePatience.
constexpr double kStepBudget = 10, kAgeBudget = 0.05 * kSlower;  // s

/// Full effort, and what a stage said of its steps.
class NotedSteps : public EffortSource {
 public:
  explicit NotedSteps(const Effort& full) : full_(full) {}
  [[nodiscard]] Effort give() const override { return full_; }
  void took(const StepTiming& timing) override { steps.push_back(timing); }
  [[nodiscard]] int level() const override { return 0; }

  /// Whether a governor would have lowered the effort.
  [[nodiscard]] bool wouldFall() const {
    EffortGovernor governor(trackerLadder(full_), {kStepBudget, kAgeBudget});
    for (StepTiming step : steps) {
      step.wall = 0;
      if (governor.update(step)) return true;
    }
    return false;
  }
  std::vector<StepTiming> steps;

 private:
  Effort full_;
};

/// Black images and an IMU at rest, given by hand.
class LateSamples {
 public:
  void image() {
    const double host = wallSeconds();
    const CameraModel& camera = source_->rig().camera[0];
    const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(camera.width() * camera.height()));
    for (std::size_t c = 0; c < source_->rig().camera_count; ++c) {
      CameraFrame frame;
      frame.camera = static_cast<std::uint32_t>(c);
      frame.stamp = image_stamp_;
      frame.image = {pixels.data(), camera.width(), camera.height(), camera.width()};
      graph_.sensors().takeImage(frame, {host, host});
    }
    image_stamp_ = image_stamp_ + kFramePeriod;
  }
  /// Up to the newest image and beyond.
  void samples() {
    for (; sample_stamp_ < image_stamp_; sample_stamp_ = sample_stamp_ + kSamplePeriod) {
      ImuSample sample;
      sample.stamp = sample_stamp_;
      sample.accel = {0, 0, 9.81};
      const double host = wallSeconds();
      graph_.sensors().takeImu(sample, sample_stamp_, {host, host});
    }
  }
  void run() { runAll(graph_); }

  Settings settings;
  NotedSteps track{settings.effort}, smooth{settings.effort};

 private:
  static constexpr Duration kSamplePeriod = Duration::fromMilliseconds(5);

  std::unique_ptr<LogSource> source_ = openLog(shortLog());
  test::SilentListener listener_;
  RunObserver observer_{listener_};
  GraphOptions options_ = [this] {
    GraphOptions options;
    options.sample_patience = kSamplePatience;
    options.track_effort = &track;
    options.smooth_effort = &smooth;
    return options;
  }();
  Graph graph_{source_->rig(), source_->imuNoise(), settings, observer_, options_};
  Stamp image_stamp_{1'000'000'000}, sample_stamp_{900'000'000};
};

TEST_CASE("an IMU that has not begun does not lower the effort") {
  const auto flight = std::make_unique<LateSamples>();
  for (int i = 0; i < 5; ++i) {
    flight->image();
    flight->run();
    sleepFor(kSamplePatience + Duration::fromMilliseconds(5));
    flight->run();
  }
  CHECK(flight->track.steps.size() == 5);
  CHECK_FALSE(flight->track.wouldFall());
  CHECK_FALSE(flight->smooth.wouldFall());
}

TEST_CASE("frames that wait for a burst of samples are not a backlog") {
  const auto flight = std::make_unique<LateSamples>();
  for (int burst = 0; burst < 3; ++burst) {
    for (int i = 0; i < 3; ++i) {
      flight->image();
      flight->run();
    }
    flight->samples();
    flight->run();
  }
  REQUIRE(flight->track.steps.size() == 9);
  for (const StepTiming& step : flight->track.steps) CHECK(step.waiting == 0);
  CHECK_FALSE(flight->track.wouldFall());
}

TEST_CASE("frames that had their samples are a backlog") {
  const auto flight = std::make_unique<LateSamples>();
  flight->image();
  flight->run();  // waits
  flight->samples();
  flight->run();
  for (int i = 0; i < 3; ++i) flight->image();
  flight->samples();
  sleepFor(kSamplePatience);
  flight->run();
  REQUIRE(flight->track.steps.size() == 4);
  CHECK(flight->track.steps[0].waiting == 0);
  CHECK(flight->track.steps[1].waiting == 2);
  CHECK(flight->track.steps[1].age > kSamplePatience.seconds());
  CHECK(flight->track.wouldFall());
  CHECK(flight->smooth.wouldFall());
}

}  // namespace
}  // namespace swiftlet
