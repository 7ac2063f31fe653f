#pragma once
// Exposure and gain of one camera: set by hand with its automatics off, read back, or set again and again in
// flight. What the camera lacks or clamps comes back in words.
//
// - Exposure: EXPOSURE_ABSOLUTE in 100 us, or EXPOSURE in the sensor's lines, of which one takes
//   (width + HBLANK) / PIXEL_RATE. A frame that is too short for it is made longer (VBLANK) by setExposure(),
//   never by set().
// - Gain: GAIN, or ANALOGUE_GAIN. In times of the least only where the code's law is known: of the sensors
//   listed in camera_controls.cpp, and of those whose least code is above 0, which count in its multiples
//   (16 is 1: OV9281, OV7251, OV5647, ...).
//
// Memory: none but the object's. Cost: a call of the kernel for each control, which waits for the camera's
// bus: up to some ms.
// Source: linux/v4l2-controls.h; the kernel's Documentation, media/v4l/ext-ctrls-image-source.rst and
// driver-api/media/camera-sensor.rst; the laws of gains: the sensors' data sheets, as libcamera has them
// (src/ipa/libipa/camera_sensor_helper.cpp).

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/device/device_fault.hpp"
#include "drivers/image/camera_source.hpp"
#include "drivers/v4l2/control_port.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class CameraControls {
 public:
  CameraControls() = default;
  /// What `port` offers, which must outlive this. `width` [px] of the sensor's image; `name`: the sensor's.
  CameraControls(const ControlPort& port, int width, std::string_view name);

  /// An exposure in units of time can be set.
  [[nodiscard]] bool exposes() const { return exposure_id_ != 0; }

  /// Automatic exposure off (and with it the habit of lowering the frame rate in the dark), then the time.
  /// kChanged: clamped or rounded by more than one step; kUnsupported: no exposure time to set.
  DeviceFault setExposure(Duration exposure);
  /// Automatic gain off, then the gain in the driver's own units.
  DeviceFault setGain(std::int32_t gain);

  /// Empty: unknown to the camera.
  [[nodiscard]] std::optional<Duration> exposure() const;
  [[nodiscard]] std::optional<std::int32_t> gain() const;

  /// What can be set in flight within the current frame rate, and the current values; empty without
  /// exposures.
  [[nodiscard]] std::optional<ExposureAbility> ability() const;
  /// Sets exposure and gain, clamped, in one call. kFailed: the kernel's error.
  DeviceFault set(const ExposureSetting& setting);

 private:
  struct Span {
    std::int32_t least = 0;
    std::int32_t most = 0;
  };
  /// How a gain grows with its code.
  enum class GainLaw : std::uint8_t { kUnknown, kMultiple, kInverse, kDecibel };

  [[nodiscard]] std::optional<Span> spanOf(std::uint32_t id) const;
  [[nodiscard]] std::optional<std::int32_t> read(std::uint32_t id) const;
  int write(std::uint32_t id, std::int64_t value) const;
  void writeIfThere(std::uint32_t id, std::int32_t value) const;
  void findLineTime(int width);
  void findGain(std::string_view name);
  void automaticExposureOff();
  void automaticGainOff();
  [[nodiscard]] std::int64_t stepsOf(Duration exposure) const;
  [[nodiscard]] Duration timeOf(std::int64_t steps) const;
  void lengthenFrame(std::int64_t lines);
  [[nodiscard]] double timesOf(std::int32_t code) const;
  [[nodiscard]] std::int32_t codeOf(double times) const;

  const ControlPort* port_ = nullptr;
  std::uint32_t exposure_id_ = 0;  ///< 0: none
  double step_ = 0;                ///< s, of the exposure's control
  std::uint32_t gain_id_ = 0;
  GainLaw gain_law_ = GainLaw::kUnknown;
  double gain_scale_ = 1;  ///< of the law
  Span exposure_span_;
  Span gain_span_;
  bool manual_ = false;  ///< set() has turned automatics off
};

}  // namespace swiftlet
