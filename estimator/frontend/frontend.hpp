#pragma once
// The front-end stage: images in, tracks out.
//
// Every frame: each camera's features are followed in that camera from its previous image
// (prediction by landmark or by the body's rotation, pyramidal Lucas-Kanade with a check back), then
// aligned with the patch of their first sighting, which keeps long tracks from drifting; tracks that
// contradict the frame-to-frame motion (RANSAC) or the rig's epipolar geometry are dropped; lost
// landmarks are looked for where they are predicted. The two cameras are independent: a feature may
// be seen by either or both, and losing one side does not end the other. At keyframes, and when
// features are few: new corners in empty cells (left image; right while the left is missing), and
// matching between the cameras.
//
// Full is normal: with `max_features` tracks nothing is detected; the pool of remembered patches
// gives up the landmark not seen for longest.
//
// step() returns kInvalidInput, with nothing changed, for a frame without images or with an image
// of the wrong size. A camera may be missing from a frame; its features are held for a short time
// and followed when it returns. Nothing is allocated after construction; deterministic. For
// 752 x 480 stereo the object holds 6.5 MiB.

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

/// What became of the tracks in the last step, summed over the cameras.
struct FrontendStatistics {
  int tracked = 0;       ///< sightings followed from the previous frame
  int lost = 0;          ///< sightings lost by Lucas-Kanade or its checks
  int refined = 0;       ///< sightings corrected by their anchor patch
  int false_motion = 0;  ///< removed by the motion's epipolar geometry
  int false_stereo = 0;  ///< removed by the rig's epipolar geometry
  int found_again = 0;   ///< sightings of landmarks found by projection
  int detected = 0;      ///< new features
  int matched = 0;       ///< sightings added by matching between the cameras
  int match_failed = 0;  ///< attempts at that without a safe answer
};

enum class SightingLoss : std::uint8_t {
  kNotFound,  ///< by Lucas-Kanade and its checks
  kMotion,    ///< contradicts the camera's motion
  kStereo,    ///< contradicts the other camera
};

/// A sighting that the last step gave up.
struct LostSighting {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  ///< where not found: in the image before
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

  /// Follows, verifies and replenishes; `out` is overwritten.
  Status step(const StereoFrame& frame, const FrontendPrediction& prediction, int max_features,
              TrackedFrame& out);

  [[nodiscard]] const FrontendStatistics& statistics() const;
  /// Of the last step.
  [[nodiscard]] const LostSightings& lost() const;

  /// Forgets all tracks and patches; ids go on rising.
  void reset();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace swiftlet
