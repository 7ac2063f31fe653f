#pragma once
// Depth and label images of a log for the map, found by the stamp of camera 0's image.
//
// Host side: opening allocates and throws InputError (DepthImages, LabelImages). Unusable images give a
// warning and are skipped. Memory: kSlots decoded images of each kind.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/depth_images.hpp"
#include "drivers/recorded/label_images.hpp"
#include "drivers/recorded/log_source.hpp"
#include "estimator/messages/scene_images.hpp"

namespace swiftlet {

class SceneReader {
 public:
  /// Scenes stay valid for as many calls as the images of a LogSource that they belong to.
  static constexpr std::size_t kSlots = LogSource::kImageSlots;

  struct Wanted {
    bool depth = true;
    bool labels = true;
  };

  SceneReader(const std::string& log, const Calibration& calibration, const Wanted& wanted);

  /// Camera and extrinsics of the log's depth sensor, without an image; null if there is none or it is not
  /// used.
  [[nodiscard]] const DepthImageView* depthSensor() const { return sensor_ ? &*sensor_ : nullptr; }
  /// Depth and labels with exactly this stamp; empty if there are none. Valid for kSlots - 1 further calls.
  SceneImages at(Stamp stamp);

  /// Lines for the user; grows while images are read.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_.lines(); }

 private:
  struct Slot {
    std::vector<float> depth;
    std::vector<std::uint8_t> labels;
  };

  LogWarnings warnings_;
  std::optional<DepthImages> depth_;
  std::optional<LabelImages> labels_;
  std::optional<DepthImageView> sensor_;
  std::array<Slot, kSlots> slots_;
  std::size_t next_ = 0;
};

}  // namespace swiftlet
