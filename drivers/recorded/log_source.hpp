#pragma once
// What a replay needs from a log of any format: calibration, one time-ordered stream of IMU samples and
// single-camera images, and the truth if the log has one.
// Order: by stamp; at equal stamps the IMU sample first, then camera 0, then camera 1. So every sample with a
// stamp not later than an image's comes before that image. The stream ends with the last image (in a log
// without images with the last sample) unless LogOptions::imu_after_last_image is set. Frames: samples are in
// body axes (those of an IMU that is rotated in the body are rotated), images are raw (distorted). Host side:
// opening allocates and throws InputError; next() reuses fixed buffers.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/log_warnings.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

using SensorMessage = std::variant<ImuSample, CameraFrame>;

struct LogOptions {
  /// Read this calibration instead of the log's own (file or folder, see readCalibration).
  std::string calibration;
  std::string imu_calibration;  ///< the Kalibr IMU file, if it is not beside the camchain
  CalibrationOptions calibration_options;
  /// For calibration: no calibration is read. The rig has as many cameras as the log, lenses have only a
  /// size, the body has the IMU's axes, and there may be no IMU. Numbered images are stamped a second apart;
  /// equal numbers of two cameras get the same stamp.
  bool uncalibrated = false;
  bool mono = false;                  ///< ignore camera 1
  bool without_images = false;        ///< neither search nor deliver images; tracks can replace them
  bool imu_after_last_image = false;  ///< also deliver samples after the last image
  Duration shift_margin;              ///< Rig::shift_margin
  /// Called for each image before it is decoded; false: the image is skipped. Empty: all are wanted.
  std::function<bool(Stamp stamp, std::uint32_t camera)> wants_image;
};

class LogSource {
 public:
  /// A delivered image's memory stays valid until this many further images of the same camera.
  static constexpr std::size_t kImageSlots = 6;

  LogSource() = default;
  LogSource(const LogSource&) = delete;
  LogSource& operator=(const LogSource&) = delete;
  virtual ~LogSource() = default;

  [[nodiscard]] virtual const Calibration& calibration() const = 0;
  /// The next message; false at the end. Images that cannot be used are skipped and counted.
  virtual bool next(SensorMessage& message) = 0;
  /// False only if the next message is certainly not an image.
  [[nodiscard]] virtual bool imageIsNext() const { return true; }
  /// The PNG or JPEG file of the image that next() returned last, valid until the next call; empty if the log
  /// holds raw pixels.
  [[nodiscard]] virtual std::span<const std::uint8_t> picture() const { return {}; }
  /// Number of images listed in the log, all cameras together, for progress.
  [[nodiscard]] virtual std::size_t imageCount() const = 0;
  /// Number of distinct image stamps in the log: the most poses that a replay can give.
  [[nodiscard]] virtual std::size_t frameCount() const = 0;
  /// Stamps of the first and the last IMU sample; empty if the log does not list them.
  [[nodiscard]] virtual std::optional<std::pair<Stamp, Stamp>> sampleSpan() const { return std::nullopt; }
  [[nodiscard]] virtual const LogCounters& counters() const = 0;
  /// Messages for the user; grows while the log is read.
  [[nodiscard]] virtual const std::vector<std::string>& warnings() const = 0;
  /// File of feature tracks (track_file.hpp) that the log holds instead of images; empty if it has images.
  [[nodiscard]] virtual std::string trackFile() const { return {}; }
  /// Truth of the estimator's body, in time order; empty if the log has none. Read on demand. `warnings`
  /// receives what was skipped.
  [[nodiscard]] virtual Trajectory groundTruth(LogWarnings& /*warnings*/) const { return {}; }
  [[nodiscard]] Trajectory groundTruth() const {
    LogWarnings unused;
    return groundTruth(unused);
  }
  /// Name of the truth's source for the summary; empty if there is none.
  [[nodiscard]] virtual std::string groundTruthName() const { return {}; }
  /// Makes next() continue with the first message not before `stamp`. Reads nothing.
  virtual void seek(Stamp stamp) = 0;

  [[nodiscard]] const Rig& rig() const { return calibration().rig; }
  [[nodiscard]] const ImuNoise& imuNoise() const { return calibration().noise; }
};

}  // namespace swiftlet
