// Peak memory of a long flight on threads: a log flown again and again with later stamps. Prints the peak
// after one minute and at the end, which are to be equal within 1 %; minutes of work, run by hand:
//
//   swiftlet simulate --duration 60 --out minute
//   build/release/tests/logs/long_flight minute 10 2
//
// Arguments: log, minutes of flight, speed. Where the log does not end as it began, the seam is a jump once a
// pass, which the estimator has to live with.

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/inputs/log/log_player.hpp"
#include "firmware_host/outputs/run_folder/run_recorder.hpp"
#include "firmware_host/realtime/memory_use.hpp"
#include "firmware_host/runs/fly_threaded.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

/// A log flown `passes` times, one after the other.
class RepeatedLog : public LogSource {
 public:
  RepeatedLog(std::string path, int passes) : path_(std::move(path)), left_(passes), log_(openLog(path_)) {}

  [[nodiscard]] const Calibration& calibration() const override { return log_->calibration(); }
  [[nodiscard]] std::size_t imageCount() const override { return log_->imageCount(); }
  [[nodiscard]] std::size_t frameCount() const override { return log_->frameCount(); }
  [[nodiscard]] const LogCounters& counters() const override { return log_->counters(); }
  [[nodiscard]] const std::vector<std::string>& warnings() const override { return log_->warnings(); }

  bool next(SensorMessage& message) override {
    while (!log_->next(message)) {
      if (--left_ <= 0) return false;
      // One frame's pause at the seam. The estimator keeps no reference to the log that goes.
      constexpr Duration kPause = Duration::fromMilliseconds(50);
      offset_ = offset_ + (last_ - first_) + kPause;
      log_.reset();  // two logs at a time would be counted as the flight's growth
      log_ = openLog(path_);
      any_ = false;
    }
    Stamp& stamp = std::holds_alternative<ImuSample>(message) ? std::get<ImuSample>(message).stamp
                                                              : std::get<CameraFrame>(message).stamp;
    if (!any_) first_ = stamp;
    any_ = true;
    last_ = stamp;
    stamp = stamp + offset_;
    if (auto* image = std::get_if<CameraFrame>(&message)) image->arrival = image->arrival + offset_;
    return true;
  }
  void seek(Stamp stamp) override { log_->seek(stamp - offset_); }

 private:
  std::string path_;
  int left_;
  std::unique_ptr<LogSource> log_;
  Duration offset_;
  bool any_ = false;
  Stamp first_, last_;
};

int run(const std::string& path, double minutes, double speed) {
  const ScratchFolder folder("long_flight");
  const auto images_a_minute = static_cast<std::uint64_t>(openLog(path)->imageCount());
  RepeatedLog log(path, static_cast<int>(std::lround(minutes)));
  LostFiles lost;
  RunRecorder recorder(folder.path(), {.imu_rate = true}, lost);
  RunObserver run_observer(recorder);
  Settings settings;
  run_observer.keepForMap(
      std::make_unique<MapKeeper>(folder.path(), log.rig(), log.imuNoise(), settings.odometry, lost));
  LogFeed feed(log, {}, nullptr);
  GraphOptions wanted;
  wanted.imu_states = true;
  FlightRequest flight;
  flight.speed = speed;
  std::int64_t after_a_minute = 0;
  RunControl control;
  control.progress = [&](std::uint64_t images) {
    if (after_a_minute == 0 && images >= images_a_minute) {
      after_a_minute = peakResidentBytes();
      fmt::print("after a minute: {} bytes\n", after_a_minute);
    }
  };
  nlohmann::ordered_json report;
  LogPlayer player(feed, speed);
  const FlightEnd flown =
      flyThreaded(log.calibration(), player, settings, run_observer, wanted, flight, control, report);
  const std::int64_t at_end = peakResidentBytes();
  const RunStatistics& s = run_observer.statistics();
  fmt::print("at the end:     {} bytes ({:+.2f} %)\n{} frames, {} poses, dropped {}, epochs {}\n", at_end,
             100.0 * (static_cast<double>(at_end) / static_cast<double>(after_a_minute) - 1), s.frames,
             s.poses, s.frames_dropped, s.health.empty() ? 0U : s.health.back().epoch + 1);
  for (const auto& [arrow, count] : s.losses) fmt::print("lost: {} {}\n", arrow, count);
  return flown.finished && flown.faultless ? 0 : 1;
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  if (argc != 4) {
    fmt::print(stderr, "usage: {} LOG MINUTES SPEED (a log of one minute)\n", argv[0]);
    return 2;
  }
  return swiftlet::run(argv[1], std::atof(argv[2]), std::atof(argv[3]));
}
