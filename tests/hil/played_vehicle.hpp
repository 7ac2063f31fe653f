#pragma once
// The devices of a vehicle, played from a log in real time: images through GStreamer pipelines with the log's
// times of capture, samples over a pseudo-terminal.

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/hil/log_reader.hpp"
#include "firmware_host/lab/hil/played_imu.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/settings/settings.hpp"
#include "tests/drivers/gstreamer/feed_element.hpp"

namespace swiftlet {

/// One camera of a log: black images at its pace before the first, then the log's when they are due.
class FedCamera : public test::Feed {
 public:
  /// From the exposure to the host: what a sensor's readout and a decoder take.
  static constexpr Duration kTransfer = Duration::fromMilliseconds(4);

  FedCamera(LogReader& reader, std::size_t camera, const FrameGrid& grid)
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
      feeds_[i] = std::make_unique<FedCamera>(*reader_, i, grid);
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
  [[nodiscard]] FedCamera& feed(std::size_t camera) { return *feeds_.at(camera); }
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
  std::array<std::unique_ptr<FedCamera>, 2> feeds_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::thread player_;
};

}  // namespace swiftlet
