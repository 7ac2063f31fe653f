#pragma once
// Exposure and gain of one camera: set manually with automatic modes off, read back, or changed repeatedly in
// flight. Returned faults say what the camera lacks or clamps.
//
// - Exposure: EXPOSURE_ABSOLUTE in 100 us, or EXPOSURE in sensor lines of (width + HBLANK) / PIXEL_RATE each.
//   setExposure() lengthens the frame (VBLANK) if it is too short for the exposure; set() never does.
// - Gain: GAIN or ANALOGUE_GAIN. Gain as a factor of the smallest gain is available only if the relation to
//   the code is known: for the sensors listed in camera_controls.cpp, and for sensors whose smallest code is
//   above 0, which represents a gain of 1 (16 is 1: OV9281, OV7251, OV5647, ...).
//
// Memory: only the object. Cost: one system call per control, which waits for the camera's bus: up to some
// ms.
// Source: linux/v4l2-controls.h; the kernel's Documentation, media/v4l/ext-ctrls-image-source.rst and
// driver-api/media/camera-sensor.rst; gain models: the sensors' data sheets, as collected in libcamera
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
  /// Reads what `port` offers; it must outlive this. `width` [px]: of the sensor's image; `name`: of the
  /// sensor.
  CameraControls(const ControlPort& port, int width, std::string_view name);

  /// Whether an exposure in units of time can be set.
  [[nodiscard]] bool exposes() const { return exposure_id_ != 0; }

  /// Disables automatic exposure (and the reduction of the frame rate in the dark), then sets the time.
  /// kChanged: clamped or rounded by more than one step; kUnsupported: the exposure time cannot be set.
  DeviceFault setExposure(Duration exposure);
  /// Disables automatic gain, then sets the gain in the driver's own units.
  DeviceFault setGain(std::int32_t gain);

  /// Current values; empty: not available.
  [[nodiscard]] std::optional<Duration> exposure() const;
  [[nodiscard]] std::optional<std::int32_t> gain() const;

  /// What can be set in flight within the current frame rate, and the current values; empty if the exposure
  /// cannot be set.
  [[nodiscard]] std::optional<ExposureAbility> ability() const;
  /// Sets exposure and gain, clamped, in one call. kFailed: the kernel's error.
  DeviceFault set(const ExposureSetting& setting);

 private:
  struct Span {
    std::int32_t least = 0;
    std::int32_t most = 0;
  };
  /// Relation between gain and code.
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
  double step_ = 0;                ///< [s] per step of the exposure control
  std::uint32_t gain_id_ = 0;
  GainLaw gain_law_ = GainLaw::kUnknown;
  double gain_scale_ = 1;  ///< parameter of the gain law
  Span exposure_span_;
  Span gain_span_;
  bool manual_ = false;  ///< set() has disabled automatic modes
};

}  // namespace swiftlet
