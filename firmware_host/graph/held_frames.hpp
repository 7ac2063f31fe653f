#pragma once
// Frames that the map holds until their labels arrive over a LabelExchange, in order. The oldest is mapped
// when its labels arrive, when they are late, when no labeller is connected, or when there is no room to
// wait. Used by the map's thread only; images, depth and labels are copies, so no memory of the flight path
// is held. Memory: LabelExchange::kPlaces images of camera 1, labels and depth images.

#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/interfaces/label_exchange.hpp"
#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet {

class HeldFrames {
 public:
  struct Frame {
    MapMessage message;
    bool has_images = false;
    std::array<std::uint64_t, kMaxCameras> number{};  ///< number of each camera's image
    std::array<ImageView, kMaxCameras> image;
    SceneImages scene;  ///< empty if there is none

    // Used by HeldFrames.
    int place = -1;    ///< in the exchange; -1: waits for no labels
    double since = 0;  ///< host time at which it was held [s]
    std::array<std::vector<std::uint8_t>, kMaxCameras> pixels;
    std::vector<float> depth;
    std::vector<std::uint8_t> labels;
  };

  /// `depth_pixels`: size of the depth sensor's image; 0: no sensor. The exchange outlives this object.
  HeldFrames(LabelExchange& exchange, const std::array<std::size_t, kMaxCameras>& pixels,
             std::size_t depth_pixels);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] bool full() const { return count_ == frames_.size(); }
  [[nodiscard]] std::int64_t bytes() const;

  /// Adds a frame; not when full. `images` null: they are no longer available.
  void hold(const MapMessage& message, const KeyframeImages* images, const SceneImages& scene, double now);
  /// The oldest frame, if it is due for mapping; call drop() after mapping it.
  [[nodiscard]] const Frame* due(double now);
  void drop();

  [[nodiscard]] const HeldFrameCounters& counters() const { return counters_; }

 private:
  LabelExchange& exchange_;
  std::array<Frame, LabelExchange::kPlaces> frames_;
  std::size_t first_ = 0, count_ = 0;
  bool taken_ = false;  ///< due() has returned the oldest
  HeldFrameCounters counters_;
};

}  // namespace swiftlet
