#pragma once
// Patches for recognizing landmarks: their appearance in each camera at the first observation. Each tracked
// feature holds a slot. Lost ones keep theirs until the pool needs it; the one not seen for longest is
// dropped first. 1.9 KiB per patch, 3.8 MiB in all, reserved by the constructor.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/frontend/affine_alignment.hpp"
#include "estimator/frontend/pyramid.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// A landmark in one camera at levels 0 and 1, centred on the nearest whole pixel.
class AnchorPatch {
 public:
  static constexpr int kLevels = 2;

  /// Copies the surroundings of `pixel`; the warp becomes the identity.
  void take(const Pyramid& image, const Eigen::Vector2f& pixel);

  /// Refines a known position in `image` (level 0): aligns the patch there and updates the warp. `turn` is
  /// the warp that the frame's rotation adds (identity if unknown). False, without effect, if the patch does
  /// not fit.
  [[nodiscard]] bool refine(const ImageView& image, const Eigen::Matrix2f& turn, Eigen::Vector2f& pixel);

  [[nodiscard]] ImageView view(int level) const;
  /// Position of the landmark in the view of `level`.
  [[nodiscard]] Eigen::Vector2f centre(int level) const;

  bool valid = false;
  int failures = 0;  ///< consecutive frames in which refine() failed
  /// Offsets in the patch to offsets in the newest image, by the last estimate.
  Eigen::Matrix2f warp = Eigen::Matrix2f::Identity();

 private:
  static constexpr std::array<int, kLevels> kSide{32, 24};
  static constexpr int kSide0 = 32;
  static constexpr int kSide1 = 24;

  AffineTemplate template_;
  bool has_template_ = false;
  std::array<Eigen::Vector2f, kLevels> centre_{};
  /// Level 0, level 1, and the bytes after the last row that complete vectors read.
  std::array<std::uint8_t, kSide0 * kSide0 + kSide1 * kSide1 + 32> pixels_{};
};

struct Anchor {
  TrackId id = 0;  ///< 0: free
  bool tracked = false;
  std::uint64_t last_seen = 0;  ///< frame index
  std::array<AnchorPatch, kMaxCameras> patch;
};

class AnchorPool {
 public:
  static constexpr int kCapacity = 1024;
  static_assert(kCapacity > static_cast<int>(kMaxFeatures));

  AnchorPool() : anchors_(kCapacity) {}

  /// A slot for a new landmark: a free one, otherwise that of the lost landmark not seen for longest.
  [[nodiscard]] int acquire(TrackId id);
  /// The slot of a landmark; -1 if it was dropped.
  [[nodiscard]] int find(TrackId id) const;
  void clear();

  Anchor& operator[](int slot) { return anchors_[static_cast<std::size_t>(slot)]; }
  const Anchor& operator[](int slot) const { return anchors_[static_cast<std::size_t>(slot)]; }

 private:
  std::vector<Anchor> anchors_;
  std::array<TrackId, kCapacity> ids_{};  ///< separate from the patches, so that a search stays in cache
};

}  // namespace swiftlet
