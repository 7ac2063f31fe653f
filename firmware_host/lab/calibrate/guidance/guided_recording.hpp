#pragma once
// Guidance during a recording for calibration (docs/calibration.md): takes some images per second of each
// camera and all IMU samples, finds the board, and reports what is missing on the console and in the live
// view. The recording ends when nothing is missing.
//
// Threads: the devices' threads copy an image into waiting memory and samples into a ring, and never wait; a
// low-priority thread finds corners and serves the view. Memory: an image per camera, and the board
// detector's. Cost: some 100 ms of the low-priority thread per pair, at most kLooks times a second.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "drivers/target/calibration_target.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "firmware_host/lab/calibrate/board/board_detector.hpp"
#include "firmware_host/lab/calibrate/guidance/calibration_guide.hpp"
#include "firmware_host/outputs/view/event_page.hpp"
#include "firmware_host/outputs/view/picture_coder.hpp"
#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/runs/record_watcher.hpp"

namespace swiftlet {

class GuidedRecording final : public RecordWatcher {
 public:
  static constexpr double kLooks = 4;        ///< Hz
  static constexpr int kPictureWidth = 480;  ///< px at most, of the view's pictures
  static constexpr double kLinePeriod = 2;   ///< s between lines on the console

  /// `say`: receives a line for the user, called from goOn(). `view`: empty: no live view.
  GuidedRecording(const CalibrationTarget& target, std::function<void(const std::string&)> say,
                  const std::optional<ViewAddress>& view = {});
  ~GuidedRecording() override;

  void begin(const Calibration& calibration) override;
  void takeImu(const ImuSample& sample) override;
  void takeImage(const CameraFrame& image) override;
  [[nodiscard]] bool goOn() override;
  void end() override;

  /// Any thread: what is missing now; empty: the recording is sufficient.
  [[nodiscard]] std::vector<std::string> missing() const;
  /// Samples lost because there was no room; number of image pairs processed.
  [[nodiscard]] std::uint64_t samplesLost() const { return samples_lost_.load(std::memory_order_relaxed); }
  [[nodiscard]] int looks() const { return looks_.load(std::memory_order_relaxed); }

 private:
  enum class Slot : std::uint8_t { kIdle, kWanted, kFilled };
  struct Picture {
    std::atomic<Slot> slot{Slot::kIdle};
    Stamp stamp;
    ImageView image;  ///< in `pixels`
    std::vector<std::uint8_t> pixels;
  };

  void run();
  void look();
  void drainSamples();
  void publish();

  CalibrationTarget target_;
  std::function<void(const std::string&)> say_;
  std::optional<EventPage> page_;
  std::array<Picture, kMaxCameras> picture_;
  std::size_t cameras_ = 0;
  SpscRing<ImuSample, 4096> samples_;  ///< 2 s at 2 kHz
  std::atomic<std::uint64_t> samples_lost_{0};
  std::atomic<int> looks_{0};
  std::atomic<bool> ending_{false};
  std::thread thread_;

  // For the low-priority thread.
  std::optional<CalibrationGuide> guide_;
  std::unique_ptr<BoardDetector> detector_;
  PictureCoder coder_;

  // Shared by the low-priority thread and the one that waits for the end.
  mutable std::mutex mutex_;
  std::vector<std::string> missing_;
  double progress_ = 0;

  double line_said_ = -1e9;
};

/// State of the guidance for the page: coverage, axes, what is missing. The caller adds pictures.
nlohmann::ordered_json toJson(const CalibrationGuide& guide);

/// The page that shows this state.
[[nodiscard]] std::string guidancePage();

}  // namespace swiftlet
