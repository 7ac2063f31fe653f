#include "firmware_host/lab/calibrate/guidance/guided_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/outputs/view/low_threads.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

constexpr int kPictureQuality = 70;  // of JPEG

}  // namespace

GuidedRecording::GuidedRecording(const CalibrationTarget& target, std::function<void(const std::string&)> say,
                                 const std::optional<ViewAddress>& view)
    : target_(target), say_(std::move(say)) {
  missing_.emplace_back("No image yet.");
  if (view) {
    page_.emplace(*view, guidancePage());
    say_("live view at " + page_->url());
  }
}

GuidedRecording::~GuidedRecording() { end(); }

void GuidedRecording::begin(const Calibration& calibration) {
  cameras_ = calibration.rig.camera_count;
  for (std::size_t c = 0; c < cameras_; ++c) {
    const CameraModel& lens = calibration.rig.camera[c];
    picture_[c].pixels.resize(static_cast<std::size_t>(lens.width()) *
                              static_cast<std::size_t>(lens.height()));
  }
  guide_.emplace(target_, cameras_);
  detector_ = std::make_unique<BoardDetector>(target_, BoardDetector::Effort::kQuick);
  thread_ = std::thread([this] { run(); });
}

void GuidedRecording::takeImu(const ImuSample& sample) {
  if (!samples_.tryPush(sample)) samples_lost_.fetch_add(1, std::memory_order_relaxed);
}

void GuidedRecording::takeImage(const CameraFrame& image) {
  if (image.camera >= cameras_) return;
  Picture& picture = picture_[image.camera];
  if (picture.slot.load(std::memory_order_acquire) != Slot::kWanted) return;
  const auto size =
      static_cast<std::size_t>(image.image.width) * static_cast<std::size_t>(image.image.height);
  if (image.image.empty() || size > picture.pixels.size()) return;
  picture.image = packedCopy(image.image, picture.pixels.data());
  picture.stamp = image.stamp;
  picture.slot.store(Slot::kFilled, std::memory_order_release);
}

void GuidedRecording::run() {
  yieldToOthers();
  constexpr Duration kTurn = Duration::fromMilliseconds(20);
  constexpr double kLookPeriod = 1 / kLooks;
  constexpr double kPatience = 0.5;  // s for the second camera's image
  double asked = -1e9;
  while (!ending_.load(std::memory_order_relaxed)) {
    drainSamples();
    const double now = wallSeconds();
    const auto count = [this](Slot slot) {
      return std::count_if(
          picture_.begin(), picture_.begin() + static_cast<std::ptrdiff_t>(cameras_),
          [slot](const Picture& p) { return p.slot.load(std::memory_order_acquire) == slot; });
    };
    const auto filled = static_cast<std::size_t>(count(Slot::kFilled));
    if (filled == cameras_ || (filled > 0 && now - asked > kPatience)) {
      look();
    } else if (count(Slot::kIdle) > 0 && filled == 0 && now - asked >= kLookPeriod) {
      // Both at once, so that both cameras deliver the same pair.
      for (std::size_t c = 0; c < cameras_; ++c)
        picture_[c].slot.store(Slot::kWanted, std::memory_order_release);
      asked = now;
    }
    sleepFor(kTurn);
  }
  drainSamples();
}

void GuidedRecording::drainSamples() {
  ImuSample sample;
  while (samples_.tryPop(sample)) guide_->addImu(sample);
}

void GuidedRecording::look() {
  for (std::size_t c = 0; c < cameras_; ++c) {
    Picture& picture = picture_[c];
    if (picture.slot.load(std::memory_order_acquire) != Slot::kFilled) continue;
    BoardView view;
    view.stamp = picture.stamp;
    view.camera = c;
    view.corners = detector_->detect(picture.image);
    guide_->addView(view, picture.image.width, picture.image.height, edgeWidth(picture.image, view.corners));
  }
  publish();
  // The request to a camera that delivered nothing stays.
  for (std::size_t c = 0; c < cameras_; ++c) {
    Slot filled = Slot::kFilled;
    picture_[c].slot.compare_exchange_strong(filled, Slot::kIdle, std::memory_order_acq_rel);
  }
  looks_.fetch_add(1, std::memory_order_relaxed);
}

void GuidedRecording::publish() {
  std::vector<std::string> missing = guide_->missing();
  if (page_ && page_->watched()) {
    nlohmann::ordered_json state = toJson(*guide_);
    for (std::size_t c = 0; c < cameras_; ++c) {
      if (picture_[c].slot.load(std::memory_order_acquire) == Slot::kFilled) {
        state["cameras"][c]["picture"] = coder_.encode(picture_[c].image, {kPictureWidth, kPictureQuality});
      }
    }
    page_->publish(state, missing.empty() ? "enough\n" : missing.front() + "\n");
  }
  const std::lock_guard lock(mutex_);
  missing_ = std::move(missing);
  progress_ = guide_->progress();
}

std::vector<std::string> GuidedRecording::missing() const {
  const std::lock_guard lock(mutex_);
  return missing_;
}

bool GuidedRecording::goOn() {
  std::string line;
  bool enough = false;
  {
    const std::lock_guard lock(mutex_);
    enough = missing_.empty();
    line = enough ? "recording complete: enough data for a calibration"
                  : fmt::format("{:3.0f} %  {}", 100 * progress_, missing_.front());
  }
  if (samplesLost() > 0) {
    line += fmt::format(" (the guidance missed {} IMU samples: close other programs)", samplesLost());
  }
  const double now = wallSeconds();
  if (enough || now - line_said_ >= kLinePeriod) {
    line_said_ = now;
    say_(line);
  }
  return !enough;
}

void GuidedRecording::end() {
  ending_.store(true);
  if (thread_.joinable()) thread_.join();
}

nlohmann::ordered_json toJson(const CalibrationGuide& guide) {
  nlohmann::ordered_json json;
  json["progress"] = guide.progress();
  json["missing"] = guide.missing();
  json["columns"] = CalibrationGuide::kColumns;
  json["rows"] = CalibrationGuide::kRows;
  json["cell_corners"] = CalibrationGuide::kCellCorners;
  json["cameras"] = nlohmann::ordered_json::array();
  for (std::size_t c = 0; c < guide.cameras(); ++c) {
    const CalibrationGuide::Camera& camera = guide.camera(c);
    nlohmann::ordered_json corners = nlohmann::ordered_json::array();
    for (const BoardCorner& corner : camera.corners) {
      // A tenth of a pixel is enough for display.
      corners.push_back(std::round(10 * corner.pixel.x()) / 10);
      corners.push_back(std::round(10 * corner.pixel.y()) / 10);
    }
    json["cameras"].push_back({{"width", camera.width},
                               {"height", camera.height},
                               {"images", camera.images},
                               {"with_board", camera.with_board},
                               {"blurred", camera.blurred},
                               {"edge_width", camera.edge_width},
                               {"cells", camera.cells},
                               {"tilted", camera.tilted},
                               {"corners", corners}});
  }
  const auto axes = [](const Eigen::Vector3d& v, double wanted) {
    return nlohmann::ordered_json::array({v.x() / wanted, v.y() / wanted, v.z() / wanted});
  };
  json["turned"] = axes(guide.turnedSeconds(), CalibrationGuide::kTurnedSeconds);
  json["pushed"] = axes(guide.pushedSeconds(), CalibrationGuide::kPushedSeconds);
  return json;
}

}  // namespace swiftlet
