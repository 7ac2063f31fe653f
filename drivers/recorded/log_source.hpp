#pragma once
// What a replay needs from a log of any format: calibration, one time-ordered stream of IMU samples and
// single-camera images, and the truth if the log has one.
//
// Order: by stamp; at equal stamps the IMU sample first, then camera 0, then camera 1. So every sample with a
// stamp not later than an image's comes before that image. The stream ends with the last image (in a log
// without images with the last sample) unless LogOptions::imu_after_last_image is set. Frames: samples in
// body axes (samples of an IMU that is rotated in the body are rotated to it), raw (distorted) images. Host
// side: opening allocates and throws InputError; next() reuses fixed buffers.

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
  /// For calibrating: no calibration is read. Lenses have the images' sizes alone, cameras are as many as the
  /// log has, the body has the IMU's own axes, and there may be no IMU. Numbered images are a second apart;
  /// equal numbers of two cameras are one moment.
  bool uncalibrated = false;
  bool mono = false;                  ///< leave camera 1 out
  bool without_images = false;        ///< neither look for images nor deliver any: tracks take their place
  bool imu_after_last_image = false;  ///< deliver the samples after the last image too
  Duration shift_margin;              ///< Rig::shift_margin
  /// Asked for each image in turn before it is decoded; false: it is passed over. Empty: all are wanted.
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
  /// False if the next message is certainly no image.
  [[nodiscard]] virtual bool imageIsNext() const { return true; }
  /// The file of the image that next() gave last, PNG or JPEG, until next() is called again; empty if the
  /// log holds pixels.
  [[nodiscard]] virtual std::span<const std::uint8_t> picture() const { return {}; }
  /// Images the log lists, all cameras together, for progress.
  [[nodiscard]] virtual std::size_t imageCount() const = 0;
  /// Distinct image stamps the log lists: the most poses a replay can give.
  [[nodiscard]] virtual std::size_t frameCount() const = 0;
  /// Stamps of the first and the last IMU sample; nothing where the log does not list them.
  [[nodiscard]] virtual std::optional<std::pair<Stamp, Stamp>> sampleSpan() const { return std::nullopt; }
  [[nodiscard]] virtual const LogCounters& counters() const = 0;
  /// Lines for the user; grows while the log is read.
  [[nodiscard]] virtual const std::vector<std::string>& warnings() const = 0;
  /// Feature tracks (track_file.hpp) that the log holds in place of images; empty when it has images.
  [[nodiscard]] virtual std::string trackFile() const { return {}; }
  /// The truth of the estimator's body, in time order; empty when the log has none. Read on demand.
  /// `warnings` receives what was left out.
  [[nodiscard]] virtual Trajectory groundTruth(LogWarnings& /*warnings*/) const { return {}; }
  [[nodiscard]] Trajectory groundTruth() const {
    LogWarnings unused;
    return groundTruth(unused);
  }
  /// Source of the truth, for the summary; empty without one.
  [[nodiscard]] virtual std::string groundTruthName() const { return {}; }
  /// next() goes on with the first message that is not before `stamp`. Reads nothing.
  virtual void seek(Stamp stamp) = 0;

  [[nodiscard]] const Rig& rig() const { return calibration().rig; }
  [[nodiscard]] const ImuNoise& imuNoise() const { return calibration().noise; }
};

}  // namespace swiftlet
