// Recorded flights played out in real time, images through GStreamer pipelines with the log's times of
// capture, samples over a serial port: what `fly` makes of them beside a plain replay, and what `doctor`
// says.

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/hil/log_reader.hpp"
#include "firmware_host/lab/hil/played_imu.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/runs/doctor_run.hpp"
#include "firmware_host/runs/fly_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/drivers/gstreamer/feed_element.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

/// One camera of a log: black images at its pace before the first, then the log's when they are due.
class LogFeed : public test::Feed {
 public:
  /// From the exposure to the host: what a sensor's readout and a decoder take.
  static constexpr Duration kTransfer = Duration::fromMilliseconds(4);

  LogFeed(LogReader& reader, std::size_t camera, const FrameGrid& grid)
      : reader_(reader), camera_(camera), grid_(grid), next_(reader.image(camera)) {
    slot_ = (monotonicNow() - grid.first).ns / grid.period.ns;
  }

  Next next(test::FedImage& image) override {
    const Stamp now = monotonicNow();
    if (die_.exchange(false)) return Next::kError;
    if (!next_) {
      ended_.store(true);
      return Next::kWait;
    }
    const Stamp capture = slot_ < 0 ? grid_.instant(slot_) : grid_.toHost(next_->stamp);
    if (now < capture + kTransfer) return Next::kWait;
    image.capture = capture;
    image.number = number_++;
    if (slot_++ < 0) {
      image.bytes.assign(next_->pixels.size(), 0);
    } else {
      image.bytes = std::move(next_->pixels);
      next_ = reader_.image(camera_);
    }
    return Next::kImage;
  }

  void die() { die_.store(true); }
  [[nodiscard]] bool ended() const { return ended_.load(); }

 private:
  LogReader& reader_;
  const std::size_t camera_;
  const FrameGrid grid_;
  std::optional<LogReader::Image> next_;
  std::int64_t slot_ = 0;
  std::uint64_t number_ = 0;
  std::atomic<bool> die_{false};
  std::atomic<bool> ended_{false};
};

/// A log's devices, at work from construction on; its first image is taken `lead` later.
class PlayedVehicle {
 public:
  PlayedVehicle(const std::string& log, const std::string& port, Duration lead) {
    LogOptions options;
    options.imu_after_last_image = true;
    source_ = openLog(log, options);
    reader_ = std::make_unique<LogReader>(*source_);
    settings.vehicle.calibration = log;
    settings.imu_link.device = port;
    const CameraModel& camera = source_->rig().camera[0];
    const auto pipeline = [&](int feed, const std::string& size) {
      return "feedsrc feed=" + std::to_string(feed) + " ! video/x-raw,format=GRAY8," + size +
             ",framerate=20/1 ! queue max-size-buffers=2";
    };
    const std::string size =
        "width=" + std::to_string(camera.width()) + ",height=" + std::to_string(camera.height());
    settings.cameras.pipeline0 = pipeline(0, size);
    settings.cameras.pipeline1 = pipeline(1, size);
    settings.mesh.enabled = false;
    settings.realtime.lock_memory = false;
    imu_ = std::make_unique<PlayedImu>(makeImuWire(settings.imu_link), *reader_, faults_,
                                       source_->calibration().imuCorrection(), 30);
    REQUIRE(imu_->open().ok());
    grid.period = Duration::fromMilliseconds(50);
    grid.first = monotonicNow() + lead;
    grid.first_log = firstImage();
    for (std::size_t i = 0; i < feeds_.size(); ++i) {
      feeds_[i] = std::make_unique<LogFeed>(*reader_, i, grid);
      test::setFeed(static_cast<int>(i), feeds_[i].get());
    }
    const Duration all = Duration{static_cast<std::int64_t>(source_->frameCount()) * grid.period.ns};
    imu_->begin(grid, grid.first_log + all);
    player_ = std::thread([this] { play(); });
  }
  ~PlayedVehicle() {
    stop_.store(true);
    player_.join();
    for (int i = 0; i < 2; ++i) test::setFeed(i, nullptr);
  }
  PlayedVehicle(const PlayedVehicle&) = delete;
  PlayedVehicle& operator=(const PlayedVehicle&) = delete;

  /// Set when all has been played.
  [[nodiscard]] const std::atomic<bool>& ended() const { return ended_; }
  [[nodiscard]] LogFeed& feed(std::size_t camera) { return *feeds_.at(camera); }
  /// The log's truth on the host's clock.
  [[nodiscard]] Trajectory truth() const {
    Trajectory moved = source_->groundTruth();
    for (TrajectoryPoint& point : moved) point.stamp = grid.toHost(point.stamp);
    return moved;
  }
  [[nodiscard]] Trajectory truthOfLog() const { return source_->groundTruth(); }

  Settings settings;
  FrameGrid grid;

 private:
  [[nodiscard]] Stamp firstImage() {
    // A reader of its own: that of the feeds loses nothing.
    const std::unique_ptr<LogSource> source = openLog(settings.vehicle.calibration);
    SensorMessage message;
    while (source->next(message)) {
      if (const auto* image = std::get_if<CameraFrame>(&message)) return image->stamp;
    }
    return {};
  }

  void play() {
    constexpr Duration kLook = Duration{500'000};
    while (!stop_.load()) {
      static_cast<void>(imu_->step(monotonicNow()));
      const bool images_ended = std::ranges::all_of(feeds_, [](const auto& feed) { return feed->ended(); });
      if (images_ended && !imu_->due()) break;
      sleepFor(kLook);
    }
    // What was played last is still on its way.
    sleepFor(Duration::fromMilliseconds(300));
    ended_.store(true);
  }

  FaultTimeline faults_;
  std::unique_ptr<LogSource> source_;
  std::unique_ptr<LogReader> reader_;
  std::unique_ptr<PlayedImu> imu_;
  std::array<std::unique_ptr<LogFeed>, 2> feeds_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::thread player_;
};

double ate(const std::string& folder, const Trajectory& truth, const Settings& settings, std::size_t& poses) {
  const Trajectory estimate = readWholeTrajectory(folder + "/odometry.tum", "");
  poses = estimate.size();
  return accuracyOf(estimate, truth, accuracyOptions(settings.evaluation, AlignKind::kSe3))
      .absolute.translation.rmse;
}

TEST_CASE("a flight on pipelines is as accurate as a replay of its log") {
  const std::optional<std::string> log = findLog("euroc_mh01_20s");
  if (!log) {
    skipCase("no euroc_mh01_20s", "SWIFTLET_DATA=FOLDER toolchain/test.sh");
    return;
  }
  const ScratchFolder folder("pipeline_flight");
  Trajectory truth, truth_of_log;
  Settings settings;
  FlyResult flown;
  {
    PlayedVehicle vehicle(*log, folder.file("imu"), Duration::fromMilliseconds(4000));
    settings = vehicle.settings;
    FlyRequest request;
    request.out = folder.file("flight");
    request.stop = &vehicle.ended();
    flown = runFlight(request, settings);
    truth = vehicle.truth();
    truth_of_log = vehicle.truthOfLog();
  }
  for (const std::string& line : flown.missing) std::cout << line << '\n';
  REQUIRE(flown.missing.empty());
  CHECK(flown.faultless);
  REQUIRE(flown.has_pose);
  ReplayRequest replay;
  replay.log = *log;
  replay.out = folder.file("replay");
  static_cast<void>(runReplay(replay, settings));
  std::size_t poses_flown = 0;
  std::size_t poses_replayed = 0;
  const double in_flight = ate(folder.file("flight"), truth, settings, poses_flown);
  const double replayed = ate(folder.file("replay"), truth_of_log, settings, poses_replayed);
  const auto& devices = flown.summary.at("counters").at("devices");
  std::cout << "pipeline_flight: ATE " << in_flight << " m of " << poses_flown << " poses in flight, "
            << replayed << " m of " << poses_replayed << " in a plain replay\n"
            << "pipeline_flight: camera 0 " << devices.at("camera0").dump() << '\n';
  // Differences below a millimetre mean nothing on this log.
  CHECK(std::abs(in_flight - replayed) <= std::max(0.1 * replayed, 0.001));
  CHECK(poses_flown + 10 >= poses_replayed);
  // Below the flight path, whose sensors stand at 45.
  for (const auto& thread : flown.summary.at("executor").at("threads")) {
    const auto name = thread.at("name").get<std::string>();
    if (name == "imu") CHECK(thread.at("wanted_priority") == settings.realtime.sensor_priority);
    if (name.starts_with("camera")) CHECK(thread.at("wanted_priority") == settings.realtime.low_priority);
  }
}

TEST_CASE("doctor shows what a pipeline gives, and when it goes and returns") {
  const ScratchFolder folder("pipeline_doctor");
  PlayedVehicle vehicle(shortLog(), folder.file("imu"), Duration::fromMilliseconds(1500));
  DoctorRequest request;
  request.seconds = 4;
  std::thread breaker([&] {
    sleepFor(Duration::fromMilliseconds(3500));
    vehicle.feed(1).die();
  });
  const DoctorReport report = examine(request, vehicle.settings);
  breaker.join();
  std::cout << report.vehicle.text("this vehicle");
  const auto found = [&](const std::string& what) {
    std::string all;
    for (const MachineLine& line : report.vehicle.lines) {
      if (line.what == what) all += line.found + '\n';
    }
    return all;
  };
  CHECK_THAT(found("camera 0 images"), Catch::Contains("752x480 GREY") && Catch::Contains("20 Hz") &&
                                           Catch::Contains("feedsrc (GStreamer)"));
  CHECK_THAT(found("camera 0 stamps"), Catch::Contains("of the start of exposure"));
  CHECK_THAT(found("camera 0 timing"), Catch::Contains("99 %") && Catch::Contains("from stamp to arrival"));
  CHECK_THAT(found("camera 0 frames"), Catch::Contains("taken"));
  CHECK_THAT(found("in this time"), Catch::Contains("camera 1 (feedsrc feed=1") && Catch::Contains("gone") &&
                                        Catch::Contains("works again"));
}

}  // namespace
}  // namespace swiftlet
