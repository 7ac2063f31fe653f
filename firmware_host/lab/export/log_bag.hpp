#pragma once
// The messages of a log in a bag: what cameras and IMU sent, the calibration as CameraInfo and transforms,
// the truth. docs/export.md lists the topics.
//
// Images are the log's own files (CompressedImage) where it has files, pixels otherwise; or JPEG throughout.
// Samples are those of the sensor: a log that is turned into body axes is turned back. Memory: the truth, and
// an image.

#include <array>
#include <cstddef>
#include <vector>

#include "drivers/bag/message_bag.hpp"
#include "drivers/recorded/log_source.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

namespace swiftlet {

struct LogBagOptions {
  RosFrames frames;
  bool raw_images = false;  ///< pixels, also where the log has files
  int jpeg_quality = 0;     ///< 1 to 100: all images encoded as JPEG, in place of files and pixels; 0: not
  bool truth = true;
  bool transforms = true;  ///< from the body to the cameras; a run's bag has its own message of fixed ones
};

class LogBag {
 public:
  LogBag(LogSource& log, const LogBagOptions& options, MessageBag& bag);

  /// All messages up to this stamp.
  void writeUntil(Stamp stamp);
  void writeRest();
  /// From the body to each camera.
  [[nodiscard]] std::vector<rosmsg::TransformStamped> cameraTransforms(Stamp stamp) const;

 private:
  [[nodiscard]] Stamp stampOfNext() const;
  bool advance();
  void writeSample(const ImuSample& sample);
  void writeImage(const CameraFrame& frame);
  void writeTruth(const TrajectoryPoint& point);
  void check(Stamp stamp) const;

  LogSource& log_;
  const LogBagOptions options_;
  MessageBag& bag_;
  std::array<rosmsg::CameraInfo, kMaxCameras> info_;
  Trajectory truth_;
  std::size_t next_truth_ = 0;
  SensorMessage message_;
  bool pending_ = false;  ///< message_ is not written yet
  bool fixed_ = false;    ///< transforms are written
};

}  // namespace swiftlet
