#pragma once
// Observes a running recording and may end it: used for guidance during calibration. It does not change what
// is recorded.

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class RecordWatcher {
 public:
  RecordWatcher() = default;
  RecordWatcher(const RecordWatcher&) = delete;
  RecordWatcher& operator=(const RecordWatcher&) = delete;
  virtual ~RecordWatcher() = default;

  /// Called before the devices start; the calibration gives the image sizes.
  virtual void begin(const Calibration& calibration) = 0;
  /// Called by the devices' threads, one for the IMU and one for each camera: must not wait, lock or
  /// allocate.
  virtual void takeImu(const ImuSample& sample) = 0;
  virtual void takeImage(const CameraFrame& image) = 0;
  /// Called twenty times a second by the thread that waits for the end. False: end the recording.
  [[nodiscard]] virtual bool goOn() = 0;
  /// Called after the devices' threads have ended.
  virtual void end() = 0;
};

}  // namespace swiftlet
