#pragma once
// Plays a log's messages at their arrival times, as sensors would deliver them. Two threads: `source` reads
// and decodes ahead (a vehicle has no such thread), `sensor` hands the messages over.

#include <atomic>
#include <exception>
#include <limits>
#include <optional>

#include "estimator/core/spsc_ring.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"

namespace swiftlet {

class LogPlayer : public SensorInput {
 public:
  /// `speed`: factor relative to the recorded time. The feed outlives the player.
  LogPlayer(LogFeed& feed, double speed) : feed_(feed), speed_(speed) {}

  std::vector<Thread> threads(SensorSink& sink, const RunControl& control) override;
  [[nodiscard]] std::uint64_t taken() const override { return taken_.load(std::memory_order_relaxed); }
  /// Rethrows an InputError of the log's reader.
  void finish() override;

  /// Any thread: offset from the log's stamps to CLOCK_MONOTONIC at speed 1; empty before the first message.
  [[nodiscard]] std::optional<Duration> toHost() const {
    const std::int64_t ns = to_host_ns_.load(std::memory_order_relaxed);
    return ns == kNotYet ? std::nullopt : std::optional(Duration{ns});
  }
  /// Lateness of the thread `sensor` against the log's times; after it has ended.
  [[nodiscard]] const LatencyHistogram& lateness() const { return lateness_; }

 private:
  enum class Kind : std::uint8_t { kSample, kImage };
  struct Ahead {
    Kind kind = Kind::kSample;
    ImuSample sample;
    CameraFrame image;
    SceneImages scene;
    std::uint64_t taken = 0;
  };
  /// Messages read ahead, and of these images of both cameras: the source owns the images' memory.
  static constexpr std::size_t kReadAhead = 256;
  static constexpr std::uint64_t kImagesAhead = LogSource::kImageSlots - 1;

  void read(const RunControl& control);
  void play(SensorSink& sink, const RunControl& control);
  void begin(Stamp first);
  [[nodiscard]] double hostTime(Stamp stamp) const { return zero_ + (stamp - first_).seconds() / speed_; }

  LogFeed& feed_;
  double speed_;
  SpscRing<Ahead, kReadAhead> ahead_;
  std::atomic<std::uint64_t> images_out_{0};  ///< images whose memory the source may reuse
  std::atomic<std::uint64_t> taken_{0};
  std::atomic<bool> read_done_{false};
  static constexpr std::int64_t kNotYet = std::numeric_limits<std::int64_t>::min();
  std::atomic<std::int64_t> to_host_ns_{kNotYet};
  std::exception_ptr read_error_;

  // For the thread `sensor`.
  bool begun_ = false;
  Stamp first_;
  double zero_ = 0;
  LatencyHistogram lateness_;
};

}  // namespace swiftlet
