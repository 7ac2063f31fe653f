#pragma once
// An IMU behind ROS 2 topics: one sensor_msgs/Imu, or separate gyroscope and accelerometer topics
// (drivers/timesync/accel_at_gyro.hpp), as cameras with an IMU publish them.
//
// Stamps: the headers', CLOCK_REALTIME, converted to CLOCK_MONOTONIC (drivers/timesync/wall_stamps.hpp).
// Dropped and counted: samples that are not finite, of another clock, or not newer than the previous one.
// Losses: gaps of the stamps up to a second at `rate`. After kMostBad unusable samples in a row the link
// closes with the reason. open() waits for a sample: the first call for seconds, in flight for a tenth of
// one. It allocates and locks: not for a thread of the flight path.

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/dds/topic_reader.hpp"
#include "drivers/timesync/accel_at_gyro.hpp"
#include "drivers/timesync/wall_stamps.hpp"
#include "firmware_host/inputs/devices/imu_link.hpp"

namespace swiftlet {

struct TopicImuSettings {
  DdsNetwork network;
  std::string topic;        ///< of the IMU or the gyroscope
  std::string accel_topic;  ///< empty: `topic` carries both
  double rate = 0;          ///< samples per second; 0: losses are not counted
  /// Longest wait for the first sample. Discovery takes some tenths of a second; a driver's start takes
  /// longer.
  Duration patience = Duration::fromMilliseconds(3000);
  std::function<HostClocks()> read_clocks = readHostClocks;  ///< replaced in tests
};

class TopicImuLink : public ImuLink {
 public:
  static constexpr int kMostBad = 20;

  explicit TopicImuLink(TopicImuSettings settings);

  DeviceFault open() override;
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] bool allocates() const override { return true; }
  [[nodiscard]] int fd() const override { return bell_.fd(); }
  void discard() override;
  DeviceFault receive(Stamp now) override;
  bool next(ImuReading& reading) override;
  bool nextRemark(DeviceFault& remark) override;
  [[nodiscard]] std::uint64_t received() const override { return came_; }
  [[nodiscard]] std::string stream() const override;
  [[nodiscard]] nlohmann::ordered_json counters() const override;

 private:
  struct Stream {
    std::string topic;
    TopicReader reader;
    WallStamps stamps;
  };

  [[nodiscard]] bool apart() const { return !settings_.accel_topic.empty(); }
  DeviceFault prepare();
  /// Takes a message of one stream. A fault: the message is unusable.
  DeviceFault takeOne(Stream& stream, const TopicImu& message);
  [[nodiscard]] DeviceFault judge(const TopicImu& message) const;
  [[nodiscard]] DeviceFault silent() const;
  void countHole(Stamp stamp);

  TopicImuSettings settings_;
  std::shared_ptr<DdsDomain> domain_;
  TopicBell bell_;
  Stream imu_;    ///< the whole IMU, or the gyroscope
  Stream accel_;  ///< only if separate
  AccelAtGyro joined_;
  std::optional<DeviceFault> remark_;
  std::optional<Stamp> newest_;  ///< stamp of the newest gyroscope sample
  Stamp now_;
  int bad_ = 0;  ///< consecutive unusable samples
  bool open_ = false;
  bool opened_ = false;  // at least once
  std::uint64_t came_ = 0, samples_ = 0, missing_ = 0, damaged_ = 0, wrong_clock_ = 0, unsure_ = 0;
};

}  // namespace swiftlet
