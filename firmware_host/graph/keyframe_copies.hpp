#pragma once
// Copies of a frame's images for the nodes that process keyframes: they are slow and would otherwise hold the
// cameras' slots. Used by the thread of `track`. Memory: a pool of KeyframeImages once a reader is connected.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "estimator/messages/frames.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/node.hpp"

namespace swiftlet {

class KeyframeCopies {
 public:
  explicit KeyframeCopies(Node& track) : track_(track) {}

  /// `pixels`: size of each camera's image.
  void to(LoopImagesIn& in, const std::array<std::size_t, kMaxCameras>& pixels) { lend(in, loop_, pixels); }
  void to(MapImagesIn& in, const std::array<std::size_t, kMaxCameras>& pixels) { lend(in, map_, pixels); }
  /// Returns whether the map receives the images; does nothing if no reader is connected.
  bool send(const StereoFrame& frame, bool to_loop, bool to_map);
  /// Recorded schedule: images are available on request, so none are copied. `mapped`: whether the map
  /// receives those of the next frame.
  void tell(bool mapped) { told_ = mapped; }

 private:
  template <typename Reader>
  void lend(Reader& in, Reader*& kept, const std::array<std::size_t, kMaxCameras>& pixels) {
    reserve(pixels);
    in.lendFrom(*pool_);
    kept = &in;
    connect(track_, in);
  }
  void reserve(const std::array<std::size_t, kMaxCameras>& pixels);

  Node& track_;
  std::unique_ptr<KeyframePool> pool_;
  LoopImagesIn* loop_ = nullptr;
  MapImagesIn* map_ = nullptr;
  std::optional<bool> told_;
};

}  // namespace swiftlet
