#include "firmware_host/graph/keyframe_copies.hpp"

#include "firmware_host/interfaces/packed_copy.hpp"

namespace swiftlet {

void KeyframeCopies::reserve(const std::array<std::size_t, kMaxCameras>& pixels) {
  if (pool_) return;
  pool_ = std::make_unique<KeyframePool>(KeyframePool::Quotas{kLoopQuota, kMapQuota});
  for (std::size_t i = 0; i < KeyframePool::capacity(); ++i) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) pool_->slot(i).pixels[c].resize(pixels[c]);
  }
}

bool KeyframeCopies::send(const StereoFrame& frame, bool to_loop, bool to_map) {
  if (told_) return *told_;
  to_loop = to_loop && loop_ != nullptr;
  to_map = to_map && map_ != nullptr;
  if (!to_loop && !to_map) return false;
  const SlotHandle handle = pool_->tryAcquire();
  if (!handle.valid()) {
    if (to_loop) loop_->miss();
    if (to_map) map_->miss();
    return false;
  }
  KeyframeImages& images = pool_->fill(handle);
  images.frame = frame.index;
  images.number = frame.number;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    images.image[c] = packedCopy(frame.image[c], images.pixels[c].data());
  }
  if (to_loop) loop_->hand(handle);
  const bool mapped = to_map && map_->hand(handle);
  pool_->finish(handle);
  return mapped;
}

}  // namespace swiftlet
