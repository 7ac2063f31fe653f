#pragma once
// A flight recording (recording_writer.hpp) as a log, and as the inputs of each step of a threaded run.
//
// As a log: every IMU sample and image is returned bit for bit, including those with repeated or decreasing
// stamps, in the order in which they entered the estimator (RecordingHeader::order). So its lockstep replay
// equals the lockstep replay of the recorded input. The stream ends with the last input, samples after the
// last image included. Samples are in body axes. There is no truth.
// Damage: the recording ends where it is damaged. warnings() name file and byte, how much is missing, and
//   what the writer had lost (recording_index.hpp lists what is refused instead).
// Memory: that of recording_index.hpp per record, LogSource::kImageSlots images per camera, one depth image
//   and one label image.
// Cost: opening reads and checks the whole recording once; an image is read and checked again when needed.
// While this object exists no program can start a new recording in the folder.
//
// LogOptions: `mono` omits camera 1; `without_images` omits images; `calibration` replaces the recorded one
//   (same image sizes required; samples are already in body axes and are not rotated).

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/log_source.hpp"
#include "drivers/recorded/recording_index.hpp"
#include "estimator/messages/scene_images.hpp"

namespace swiftlet {

class RecordingSource final : public LogSource {
 public:
  /// `files`: the segments. `folder`: locked against a new recording; empty: no lock.
  RecordingSource(RecordingFiles files, const LogOptions& options, const std::string& folder = {});

  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  bool next(SensorMessage& message) override;
  void seek(Stamp stamp) override;
  [[nodiscard]] std::size_t imageCount() const override { return image_count_; }
  [[nodiscard]] std::size_t frameCount() const override { return frame_count_; }
  [[nodiscard]] const LogCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::vector<std::string>& warnings() const override { return warnings_.lines(); }

  [[nodiscard]] const RecordingHeader& header() const { return index_.header; }
  [[nodiscard]] const RecordedSteps& steps() const { return index_.steps; }
  [[nodiscard]] const std::vector<RecordingLoss>& losses() const { return index_.losses; }
  [[nodiscard]] const RecordingCut& cut() const { return index_.cut; }
  /// The end mark is present, nothing was cut and nothing was lost: a threaded run can be repeated to its
  /// end.
  [[nodiscard]] bool complete() const;
  /// The first records that were lost while recording, with file, byte, kind and number: a threaded run
  /// cannot be repeated then. Empty for a recording that was only cut, since that can be repeated up to the
  /// cut (see warnings()).
  [[nodiscard]] std::optional<InputError> firstLoss() const;

  /// Number of IMU samples recorded; independent of the options.
  [[nodiscard]] std::size_t imuCount() const { return index_.imu.size(); }
  [[nodiscard]] const RecordedImu& imu(std::size_t i) const { return index_.imu[i]; }
  /// The sample's number in the steps: from 1, lost samples included.
  [[nodiscard]] std::uint64_t imuNumber(std::size_t i) const;
  /// Number of the camera's last recorded image; 0 if there is none.
  [[nodiscard]] std::uint64_t lastImage(std::size_t camera) const;
  /// Image `number` (from 1, as TrackStep::image) of a camera; false if the recording does not have it. Its
  /// pixels stay valid until kImageSlots further images of that camera, including those of next().
  bool image(std::size_t camera, std::uint64_t number, CameraFrame& frame);
  /// Depth and labels used in steps().map[i]; false if it used none. Valid until the next call.
  bool mapScene(std::size_t i, SceneImages& scene);

 private:
  struct Pool {
    std::vector<std::uint8_t> memory;
    std::size_t slot_bytes = 0;
    std::size_t slot = 0;
  };

  void chooseCalibration(const LogOptions& options);
  void countImages();
  void reservePools();
  void warn();
  [[nodiscard]] bool delivers(RecordKind kind) const;
  void read(std::size_t camera, const RecordedImage& entry, CameraFrame& frame);
  template <typename Entry>
  void readSound(const Entry& entry, std::span<std::uint8_t> head, std::span<std::uint8_t> body) const;
  template <typename Entry>
  [[noreturn]] void refuseChanged(const Entry& entry) const;

  std::optional<RecordingReadLock> lock_;
  RecordingFiles files_;
  RecordingIndex index_;
  Calibration calibration_;
  bool without_images_ = false;
  std::function<bool(Stamp, std::uint32_t)> wants_image_;
  std::size_t cameras_ = kMaxCameras;  ///< number of cameras whose images are delivered
  LogCounters counters_;
  LogWarnings warnings_;
  std::array<Pool, kMaxCameras> pools_;
  std::vector<float> scene_;  ///< depth, then labels; large enough for all scenes
  std::size_t image_count_ = 0;
  std::size_t frame_count_ = 0;
  std::size_t turn_ = 0;
  std::size_t next_imu_ = 0;
  std::array<std::size_t, kMaxCameras> next_image_{};
};

/// Whether `path` is the folder of a recording, or a run's folder with one in `recording/`.
bool isRecording(const std::string& path);

/// Opens a recording. InputError if nothing can be replayed.
std::unique_ptr<RecordingSource> openRecording(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
