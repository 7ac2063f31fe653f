#pragma once
// The front-end stage: images in, tracks out.
//
// Every frame: features are tracked in each camera from its previous image (predicted by landmark or by the
// body's rotation, pyramidal Lucas-Kanade with a backward check), then aligned with the patch of their first
// observation, which prevents drift of long tracks. Tracks that contradict the frame-to-frame motion (RANSAC)
// or the rig's epipolar geometry are dropped. Lost landmarks are searched at their predicted positions. The
// two cameras are independent: a feature may be seen by either or both, and losing it in one does not end it
// in the other. At keyframes, and if there are few features: new corners in empty cells (left image; right
// while the left is missing), and matching between the cameras.
//
// Full is normal: with `max_features` tracks nothing is detected, and the pool of stored patches drops the
// landmark not seen for longest.
//
// step() returns kInvalidInput, without effect, for a frame without images or with an image of a wrong size.
// A camera may be missing from a frame; its features are held for a short time and tracked when it returns.
// No allocation after construction; deterministic. Memory: 7.5 MiB for 752 x 480 stereo.

#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "estimator/camera/rig.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/status.hpp"
#include "estimator/frontend/frontend_prediction.hpp"
#include "estimator/frontend/frontend_settings.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// Figures of the last step, summed over the cameras.
struct FrontendStatistics {
  int tracked = 0;       ///< observations tracked from the previous frame
  int lost = 0;          ///< observations lost by Lucas-Kanade or its checks
  int refined = 0;       ///< observations corrected by their anchor patch
  int false_motion = 0;  ///< removed by the epipolar geometry of the motion
  int false_stereo = 0;  ///< removed by the epipolar geometry of the rig
  int found_again = 0;   ///< observations of landmarks found by projection
  int detected = 0;      ///< new features
  int matched = 0;       ///< observations added by matching between the cameras
  int match_failed = 0;  ///< matching attempts without an unambiguous result
};

enum class SightingLoss : std::uint8_t {
  kNotFound,  ///< lost by Lucas-Kanade or its checks
  kMotion,    ///< contradicts the camera's motion
  kStereo,    ///< contradicts the other camera
};

/// An observation that was lost in the last step.
struct LostSighting {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  ///< for kNotFound: in the previous image
  std::uint8_t camera = 0;
  SightingLoss loss = SightingLoss::kNotFound;
};
using LostSightings = FixedVector<LostSighting, kMaxCameras * kMaxFeatures>;

class Frontend {
 public:
  Frontend(const Rig& rig, const FrontendSettings& settings);
  ~Frontend();
  Frontend(Frontend&&) noexcept;
  Frontend& operator=(Frontend&&) noexcept;

  /// Tracks, verifies and replenishes features; overwrites `out`.
  Status step(const StereoFrame& frame, const FrontendPrediction& prediction, int max_features,
              TrackedFrame& out);

  [[nodiscard]] const FrontendStatistics& statistics() const;
  /// Observations lost in the last step.
  [[nodiscard]] const LostSightings& lost() const;

  /// Forgets all tracks and patches; ids continue.
  void reset();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace swiftlet
