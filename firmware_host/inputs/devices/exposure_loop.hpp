#pragma once
// Exposure control of one camera in flight (estimator/camera/exposure_control.hpp): meters its images, sets
// its source, and knows the exposure of each image.
//
// Two cameras get the same setting: camera 0's loop decides and publishes, camera 1's follows. If camera 0 is
// silent for kLeaderSilence, camera 1 decides from its own images, starting at the last request. Threads:
// each loop on its camera's thread; SharedExposure and the rotation rate between them. Memory: only the
// object. Cost per image: 10 us, and some ms of the camera's bus when the setting changes.

#include <cstdint>

#include "drivers/image/camera_source.hpp"
#include "estimator/camera/exposure_control.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/newest_shared.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Angular rate of the vehicle, from the IMU's thread.
struct TurnRate {
  double rate = 0;  ///< rad/s
  Stamp arrival;
};

/// The exposure that camera 0 requested after each of its images.
struct AskedExposure {
  ExposureSetting setting;
  Stamp arrival;
};
using SharedExposure = NewestShared<AskedExposure>;

class ExposureLoop {
 public:
  /// Silence of camera 0's requests after which camera 1 continues alone.
  static constexpr Duration kLeaderSilence = Duration::fromMilliseconds(500);

  struct Setup {
    bool leads = true;  ///< camera 0
    double focal = 1;   ///< px
    Duration period;    ///< image period
    SharedExposure* asked = nullptr;
    const NewestShared<TurnRate>* turn_rate = nullptr;
  };
  explicit ExposureLoop(const Setup& setup) : setup_(setup) {}

  /// Call after the source is opened or reopened; a reopened source starts with the newest request.
  /// kUnsupported: the source's exposure cannot be set.
  DeviceFault begin(CameraSource& source);
  /// Call after image `frame`, whose view is still valid; `now`: its arrival.
  DeviceFault step(std::uint64_t frame, const ImageView& image, Stamp now, CameraSource& source);

  /// Exposure and gain of image `frame`.
  [[nodiscard]] ExposureSetting inForce(std::uint64_t frame) const { return control_.inForce(frame); }
  [[nodiscard]] const ExposureSetting& asked() const { return control_.asked(); }

 private:
  [[nodiscard]] double turnRate(Stamp now) const;

  Setup setup_;
  bool begun_ = false;
  ExposureControl control_;
};

}  // namespace swiftlet
