#pragma once
// Keeps the stamps of what devices deliver, to compute rates, gaps, jitter, latency and the distance between
// two cameras afterwards. Memory: fixed at construction; further messages are only counted.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/limits.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"

namespace swiftlet {

class CountingSink : public SensorSink {
 public:
  struct Stream {
    std::vector<Stamp> stamps;
    std::vector<Duration> latencies;  ///< of images: from stamp to arrival
    std::uint64_t beyond = 0;         ///< messages that came after `stamps` was full

    /// Messages per second, from the stamps kept; 0 for fewer than two.
    [[nodiscard]] double rate() const;
    /// Largest step between consecutive stamps.
    [[nodiscard]] Duration largestStep() const;
    /// Median of the steps.
    [[nodiscard]] Duration medianStep() const;
    /// `share` of the steps are within this distance of a whole multiple of their median.
    [[nodiscard]] Duration jitter(double share) const;
    /// `share` of the latencies do not exceed this.
    [[nodiscard]] Duration latency(double share) const;
  };

  explicit CountingSink(std::size_t most);

  void takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) override {
    keep(imu_, sample.stamp);
  }
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& /*host*/) override {
    Stream& stream = camera_.at(image.camera);
    if (stream.latencies.size() < stream.latencies.capacity()) {
      stream.latencies.push_back(image.arrival - image.stamp);
    }
    keep(stream, image.stamp);
  }

  // Call only after the devices' threads have ended.
  [[nodiscard]] const Stream& imu() const { return imu_; }
  [[nodiscard]] const Stream& camera(std::size_t index) const { return camera_.at(index); }
  /// Distance from each image of camera 1 to the nearest of camera 0, ascending; empty if either camera has
  /// none.
  [[nodiscard]] std::vector<Duration> pairDistances() const;

 private:
  static void keep(Stream& stream, Stamp stamp);

  Stream imu_;
  std::array<Stream, kMaxCameras> camera_;
};

}  // namespace swiftlet
