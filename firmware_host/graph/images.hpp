#pragma once
// Images passed between nodes, lent by handle. The cameras' own: firmware_host/interfaces/image_pool.hpp.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/scene_images.hpp"
#include "firmware_host/graph/port.hpp"
#include "firmware_host/interfaces/image_pool.hpp"

namespace swiftlet {

/// Images of a keyframe, copied by `track`: threads that process keyframes are slow and would otherwise hold
/// the cameras' slots. `image` shows `pixels`; empty if missing.
struct KeyframeImages {
  std::uint64_t frame = 0;  ///< StereoFrame::index
  std::array<std::uint64_t, kMaxCameras> number{};
  std::array<ImageView, kMaxCameras> image;
  std::array<std::vector<std::uint8_t>, kMaxCameras> pixels;
};

enum KeyframeImageReader : std::size_t { kLoopReads, kMapReads, kKeyframeReaders };

/// Frames that wait for the map; as many as kLoopKeyframes.
inline constexpr std::size_t kMapFrames = 4;
/// Composed like kMeshQuota.
inline constexpr std::uint32_t kLoopQuota = kLoopKeyframes + 2;
inline constexpr std::uint32_t kMapQuota = kMapFrames + 2;
using KeyframePool = SlotPool<KeyframeImages, 1 + kLoopQuota + kMapQuota, kKeyframeReaders>;

/// Slot with depth and labels; `images` shows `depth` and `labels`.
struct SceneSlot {
  SceneImages images;
  std::vector<float> depth;
  std::vector<std::uint8_t> labels;
};
using ScenePool = SlotPool<SceneSlot, 1 + kMapQuota, 1>;

/// Number of pixels of each camera's image; 0 for a camera that is not in use.
inline std::array<std::size_t, kMaxCameras> pixelsOf(const Rig& rig) {
  std::array<std::size_t, kMaxCameras> pixels{};
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    pixels[c] = static_cast<std::size_t>(rig.camera[c].width() * rig.camera[c].height());
  }
  return pixels;
}

using ImageIn = SlotIn<ImagePool, kTrackReads, kImageRing>;      ///< for `track`
using MeshImageIn = SlotIn<ImagePool, kMeshReads, kMeshImages>;  ///< for `mesh`
using RecordedImageIn = SlotIn<ImagePool, kRecordReads, kRecordQuota>;
using LoopImagesIn = SlotIn<KeyframePool, kLoopReads, kLoopKeyframes>;
using MapImagesIn = SlotIn<KeyframePool, kMapReads, kMapFrames>;
using SceneIn = SlotIn<ScenePool, 0, kMapFrames>;

}  // namespace swiftlet
