#include "firmware_host/lab/calibrate/board/log_views.hpp"

#include <algorithm>
#include <memory>
#include <thread>
#include <variant>

#include "drivers/recorded/open_log.hpp"
#include "estimator/core/median.hpp"
#include "firmware_host/lab/calibrate/board/board_detector.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {
namespace {

/// An image waiting to be searched.
struct WaitingImage {
  std::vector<std::uint8_t> pixels;
  ImageView view;
  std::size_t index = 0;  ///< of its BoardView

  void take(const CameraFrame& frame, std::size_t view_index) {
    const auto width = static_cast<std::size_t>(frame.image.width);
    pixels.resize(width * static_cast<std::size_t>(frame.image.height));
    for (int y = 0; y < frame.image.height; ++y) {
      std::copy_n(frame.image.row(y), width, pixels.data() + static_cast<std::size_t>(y) * width);
    }
    view = {pixels.data(), frame.image.width, frame.image.height, frame.image.width};
    index = view_index;
  }
};

/// Searches a batch with all detectors; the result for an image does not depend on which detector takes it.
void search(const std::vector<WaitingImage>& batch, std::size_t count,
            const std::vector<std::unique_ptr<BoardDetector>>& detectors, std::vector<BoardView>& views) {
  std::atomic<std::size_t> next{0};
  const auto work = [&](BoardDetector& detector) {
    for (std::size_t i = next++; i < count; i = next++) {
      views[batch[i].index].corners = detector.detect(batch[i].view);
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t t = 1; t < detectors.size(); ++t) threads.emplace_back(work, std::ref(*detectors[t]));
  work(*detectors[0]);
  for (std::thread& thread : threads) thread.join();
}

}  // namespace

double imageRate(const std::vector<BoardView>& views, std::size_t camera) {
  std::vector<double> intervals;
  const BoardView* last = nullptr;
  for (const BoardView& view : views) {
    if (view.camera != camera) continue;
    if (last != nullptr) intervals.push_back((view.stamp - last->stamp).seconds());
    last = &view;
  }
  if (intervals.empty()) return 0;
  const double middle = medianOf(intervals);
  return middle > 0 ? 1 / middle : 0;
}

LogViews readLogViews(const LogViewsRequest& request) {
  constexpr std::size_t kBatch = 16;
  constexpr unsigned kMostThreads = 8;
  LogOptions options;
  options.uncalibrated = true;
  options.mono = request.mono;
  options.imu_after_last_image = true;
  const std::unique_ptr<LogSource> source = openLog(request.log, options);
  LogViews found;
  found.camera_count = source->rig().camera_count;
  for (std::size_t c = 0; c < found.camera_count; ++c) {
    found.image_size[c] = {source->rig().camera[c].width(), source->rig().camera[c].height()};
  }
  std::vector<std::unique_ptr<BoardDetector>> detectors;
  for (unsigned t = 0; t < std::clamp(std::thread::hardware_concurrency(), 1U, kMostThreads); ++t) {
    detectors.push_back(std::make_unique<BoardDetector>(request.target));
  }
  Progress progress("searching images", request.show_progress ? source->imageCount() : 0);
  std::vector<WaitingImage> batch(kBatch);
  std::size_t waiting = 0;
  SensorMessage message;
  while (source->next(message)) {
    if (request.stop != nullptr && request.stop->load(std::memory_order_relaxed)) break;
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      found.samples.push_back(*sample);
      continue;
    }
    const auto& frame = std::get<CameraFrame>(message);
    batch[waiting++].take(frame, found.views.size());
    found.views.push_back({frame.stamp, frame.camera, {}});
    if (waiting < kBatch) continue;
    search(batch, waiting, detectors, found.views);
    waiting = 0;
    progress.update(found.views.size());
  }
  search(batch, waiting, detectors, found.views);
  progress.update(found.views.size());
  progress.finish();
  for (const BoardView& view : found.views) {
    ++found.images[view.camera];
    if (!view.corners.empty()) ++found.with_board[view.camera];
  }
  found.warnings = source->warnings();
  return found;
}

}  // namespace swiftlet
