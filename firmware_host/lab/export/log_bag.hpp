#pragma once
// Writes the messages of a log to a bag: images, samples, the calibration as CameraInfo and transforms, the
// truth. docs/export.md lists the topics.
//
// Images are the log's own files (CompressedImage) if it has files, otherwise pixels; or all as JPEG. Samples
// are in the sensor's axes: rotation to body axes is undone. Memory: the truth, and one image.

#include <array>
#include <cstddef>
#include <vector>

#include "drivers/bag/message_bag.hpp"
#include "drivers/recorded/log_source.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

namespace swiftlet {

struct LogBagOptions {
  RosFrames frames;
  bool raw_images = false;  ///< write pixels even if the log has files
  int jpeg_quality = 0;     ///< 1 to 100: all images as JPEG instead of files or pixels; 0: off
  bool truth = true;
  bool transforms = true;  ///< from the body to the cameras; a run's bag writes its own static transforms
};

class LogBag {
 public:
  LogBag(LogSource& log, const LogBagOptions& options, MessageBag& bag);

  /// Writes all messages up to this stamp.
  void writeUntil(Stamp stamp);
  void writeRest();
  /// Transforms from the body to each camera.
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
  bool pending_ = false;  ///< message_ has been read but not written
  bool fixed_ = false;    ///< transforms have been written
};

}  // namespace swiftlet
