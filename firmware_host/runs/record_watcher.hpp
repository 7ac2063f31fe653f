#pragma once
// Observes a running recording and may end it: guidance for calibration. It does not change what is recorded.

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

  /// Before the devices begin, of which the calibration tells the images' sizes.
  virtual void begin(const Calibration& calibration) = 0;
  /// The devices' threads, one of the IMU and one of each camera: must not wait, lock or allocate.
  virtual void takeImu(const ImuSample& sample) = 0;
  virtual void takeImage(const CameraFrame& image) = 0;
  /// Twenty times a second, of the thread that waits for the end. False: the recording is to end.
  [[nodiscard]] virtual bool goOn() = 0;
  /// Call after the devices' threads have ended.
  virtual void end() = 0;
};

}  // namespace swiftlet
