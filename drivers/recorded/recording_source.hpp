#pragma once
// A flight recording (recording_writer.hpp) as a log, and as what a threaded run took step by step.
//
// As a log: every IMU sample and image comes back with the bits that it had, repeated and reversed
//   stamps too, in the order in which they entered the estimator (RecordingHeader::order). So a lockstep
//   replay of it is the lockstep replay of what was recorded. The stream ends with what entered last,
//   samples behind the last image included. Samples are in body axes. There is no truth: it did not enter.
// Damage: the recording ends where it is damaged; warnings() name file, byte and how much is missing, and
//   what its writer had lost (see recording_index.hpp for what is refused instead).
// Memory: recording_index.hpp's per record, LogSource::kImageSlots pictures a camera, one depth image and
//   one label image.
// Cost: opening reads and checks the whole recording once; an image is read and checked again when wanted.
// While it lives no program can begin a new recording in the folder.
//
// LogOptions: `mono` leaves camera 1 out; `without_images` leaves images out; `calibration` takes the place
//   of the recorded one (same image sizes; the samples are in body axes already and are not turned).

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
  /// `files` are the segments, `folder` is locked against a new recording (empty: not).
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
  /// The end mark is there, nothing was cut and nothing was lost: a threaded run can be repeated to its end.
  [[nodiscard]] bool complete() const;
  /// The first place where records were lost while recording, with file, byte, kind and number: a threaded
  /// run cannot be repeated then. Nothing for a recording that is only cut off: it can, up to the cut, which
  /// warnings() names.
  [[nodiscard]] std::optional<InputError> firstLoss() const;

  /// IMU samples recorded, from 0; options make no difference.
  [[nodiscard]] std::size_t imuCount() const { return index_.imu.size(); }
  [[nodiscard]] const RecordedImu& imu(std::size_t i) const { return index_.imu[i]; }
  /// What the steps call it: from 1, lost samples counted.
  [[nodiscard]] std::uint64_t imuNumber(std::size_t i) const;
  /// Number of the camera's last recorded image; 0 without any.
  [[nodiscard]] std::uint64_t lastImage(std::size_t camera) const;
  /// Image `number` (from 1, as TrackStep::image) of a camera; false when the recording does not have it. Its
  /// pixels stay valid until kImageSlots further images of that camera, those of next() counted.
  bool image(std::size_t camera, std::uint64_t number, CameraFrame& frame);
  /// Depth and labels that steps().map[i] took; false if it took none. Valid until the next call.
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
  std::vector<float> scene_;  ///< depth, then labels; for the largest
  std::size_t image_count_ = 0;
  std::size_t frame_count_ = 0;
  std::size_t turn_ = 0;
  std::size_t next_imu_ = 0;
  std::array<std::size_t, kMaxCameras> next_image_{};
};

/// True when `path` is the folder of a recording, or a run's folder that holds one in `recording/`.
bool isRecording(const std::string& path);

/// Opens it. InputError if nothing can be replayed.
std::unique_ptr<RecordingSource> openRecording(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
