#pragma once
// Finds mistakes in units, axes, clocks and calibration by comparing samples and images.
//
// Takes the messages of a log or of devices in the order of their stamps and reports contradictions at the
// end. Nothing is reported if the motion does not allow a decision: at rest, or with too little rotation.
// Methods and thresholds: docs/inspection.md. Memory: 56 bytes per sample, 2 KB per image. Cost: some 3 ms
// per image used.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"
#include "firmware_host/inspection/finding.hpp"
#include "firmware_host/inspection/stereo_order.hpp"

namespace swiftlet {

struct InspectionReport {
  std::vector<Finding> findings;
  std::vector<Measured> measured;
  std::vector<std::string> warnings;  ///< from reading the log
  std::size_t images = 0;             ///< images of camera 0 that were used
};

class Inspection {
 public:
  /// `most_images`: most images of camera 0 to use. The calibration is copied.
  Inspection(const Calibration& calibration, std::size_t most_images);

  void add(const ImuSample& sample);
  /// Call once for each image before decoding it. Returns whether add() needs the image: images of camera 0
  /// in the first two seconds and while the gyro moves, images of camera 1 occasionally.
  bool wants(Stamp stamp, std::uint32_t camera);
  void add(const CameraFrame& frame);
  /// Whether nothing more is needed.
  [[nodiscard]] bool done() const;

  [[nodiscard]] InspectionReport report() const;

 private:
  [[nodiscard]] bool moves() const;

  Calibration calibration_;
  std::size_t most_images_;
  std::vector<ImuSample> samples_;
  Eigen::Vector3d gyro_sum_ = Eigen::Vector3d::Zero();  ///< over all samples
  std::vector<Stamp> stamps_;                           ///< of all images of camera 0
  std::vector<std::size_t> taken_;                      ///< indices in stamps_ of the images in tracks_
  CameraTracks tracks_;
  StereoOrder order_;
  std::optional<Stamp> moved_;  ///< stamp of the newest image in motion
};

}  // namespace swiftlet
