#pragma once
// Keeps what devices deliver for some seconds, to inspect it for mistakes afterwards.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/inputs/devices/counting_sink.hpp"
#include "firmware_host/inspection/inspection.hpp"

namespace swiftlet {

class KeepingSink final : public CountingSink {
 public:
  /// Keeps at most `most` stamps of each stream and `most` samples, and at most kMostBytes of images per
  /// camera.
  explicit KeepingSink(std::size_t most);

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override;
  void takeImage(const CameraFrame& image, const HostTimes& host) override;

  /// Call after the devices' threads have ended.
  [[nodiscard]] InspectionReport inspect(const Calibration& calibration) const;

 private:
  static constexpr std::size_t kMostBytes = 128U << 20U;  // 18 s of 752 x 480 at 20 Hz
  struct Kept {
    CameraFrame frame;  ///< its image points into `pixels`
    std::vector<std::uint8_t> pixels;
  };

  std::size_t most_;
  std::vector<ImuSample> samples_;
  std::array<std::vector<Kept>, kMaxCameras> images_;
  std::array<std::size_t, kMaxCameras> bytes_{};
};

}  // namespace swiftlet
