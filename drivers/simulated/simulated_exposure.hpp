#pragma once
// Light of the scene, and exposure and gain of both cameras, for the images of a flight.
//
// - kGain: fixed exposure; the gain follows at once (GainControl of image_sensor.hpp).
// - kOdometry: the control used on vehicles (estimator/camera/exposure_control.hpp), in a closed loop with
//   the rendered images; each request takes effect kActingDelay images later.
// - kFixed: both stay as they are right for the first image.

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/image_sensor.hpp"
#include "estimator/camera/exposure_control.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

enum class ExposureMode : std::uint8_t { kGain, kOdometry, kFixed };

/// From `begin` on, the scene's light changes to `level` times its first value within kLightRamp,
/// exponentially.
struct LightChange {
  double begin = 0;  ///< s
  double level = 1;
};
inline constexpr double kLightRamp = 2.0;  // s
/// Light at `seconds` relative to the flight's first light; `changes` are sorted by their start.
[[nodiscard]] double lightAt(const std::vector<LightChange>& changes, double seconds);

class SimulatedExposure {
 public:
  /// Longest exposure under kOdometry.
  static constexpr double kLongest = 0.020;  // s

  /// `exposure` [s]: exposure for which the sensor's settings are nominal; `focal` [px].
  SimulatedExposure(ExposureMode mode, const SensorSettings& sensor, double exposure, double rate,
                    double focal);

  [[nodiscard]] bool started() const { return started_; }
  /// Call before the first image, with the radiance that camera 0 sees in the first light.
  void start(double mean_radiance);
  /// Exposure and gain of the next image.
  [[nodiscard]] ExposureSetting now() const;
  /// Call after frame `frame` with camera 0's image, if it took one, and its mean grey value; 0: blackout.
  void update(std::uint64_t frame, const ImageView& image, double mean, double turn_rate);

 private:
  ExposureMode mode_;
  SensorSettings sensor_;
  double exposure_;
  double period_;
  double focal_;
  bool started_ = false;
  GainControl gain_;
  ExposureControl control_;
  std::array<ExposureSetting, ExposureControl::kActingDelay> coming_{};  ///< the first is for the next image
};

}  // namespace swiftlet
