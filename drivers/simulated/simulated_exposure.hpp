#pragma once
// What a flight's images are taken with: the light of the scene, and exposure and gain of both cameras.
//
// - kGain: the exposure stays, the gain follows at once (GainControl of image_sensor.hpp).
// - kOdometry: the control that flies on vehicles (estimator/camera/exposure_control.hpp), in the loop with
//   the images that it makes; each request acts kActingDelay images later.
// - kFixed: both as they are right for the first image.

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/image_sensor.hpp"
#include "estimator/camera/exposure_control.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

enum class ExposureMode : std::uint8_t { kGain, kOdometry, kFixed };

/// From `begin` on the scene's light changes to `level` times its first value within kLightRamp, at a
/// constant ratio.
struct LightChange {
  double begin = 0;  ///< s
  double level = 1;
};
inline constexpr double kLightRamp = 2.0;  // s
/// Light at `seconds` relative to the flight's first light, after changes in order of their start.
[[nodiscard]] double lightAt(const std::vector<LightChange>& changes, double seconds);

class SimulatedExposure {
 public:
  /// Under kOdometry no image is exposed longer.
  static constexpr double kLongest = 0.020;  // s

  /// `exposure` [s]: where the sensor's settings are nominal; `focal` [px].
  SimulatedExposure(ExposureMode mode, const SensorSettings& sensor, double exposure, double rate,
                    double focal);

  [[nodiscard]] bool started() const { return started_; }
  /// Before the first image, by what camera 0 sees of the first light.
  void start(double mean_radiance);
  /// Of the next image.
  [[nodiscard]] ExposureSetting now() const;
  /// After frame `frame`, with camera 0's image, if it took one, and its mean grey; 0: of a blackout.
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
  std::array<ExposureSetting, ExposureControl::kActingDelay> coming_{};  ///< the next image's first
};

}  // namespace swiftlet
