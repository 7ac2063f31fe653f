#pragma once
// A simulated flight as a stream: IMU samples and camera frames in time order, without files.
//
// Order: by stamp; an IMU sample comes before a frame with the same stamp, camera 0 before camera 1. Images
// are in kBuffersPerCamera buffers used in turn: a frame's view stays valid until that many further frames of
// its camera. After construction only the renderer allocates.

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/simulated_flight.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class SimulatedSource {
 public:
  static constexpr std::size_t kBuffersPerCamera = 6;
  enum class Item : std::uint8_t { kImu, kFrame, kEnd };

  /// Paints the world (seconds). Throws like SimulatedFlight.
  explicit SimulatedSource(const SimulationSettings& settings);
  SimulatedSource(const SimulatedSource&) = delete;
  SimulatedSource& operator=(const SimulatedSource&) = delete;

  [[nodiscard]] const SimulatedFlight& flight() const { return flight_; }

  /// The next item: fills `sample` or `frame`; the return value says which.
  Item next(ImuSample& sample, CameraFrame& frame);

 private:
  void renderNext();

  SimulatedFlight flight_;
  FlightCameras cameras_;
  std::array<std::vector<std::vector<std::uint8_t>>, kMaxCameras> buffers_;
  std::array<CameraFrame, kMaxCameras> waiting_{};
  std::array<bool, kMaxCameras> is_waiting_{};
  std::array<std::uint64_t, kMaxCameras> sequence_{};
  std::size_t next_sample_ = 0;
  int next_image_ = 0;
};

}  // namespace swiftlet
