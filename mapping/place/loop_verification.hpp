#pragma once
// Geometric verification of a candidate of place recognition: whether two keyframes show the same place, and
// their relative pose.
//
// Descriptor matches -> consensus (loop_consensus.hpp) -> refinement on its inliers (relative_pose.hpp) ->
// matching again, guided by that pose -> refinement -> gates. Every candidate ends in one LoopFate; the
// results of the stages that it reached are reported with it.
//
// Frames: T_old_new takes coordinates of the body at the new keyframe to the body at the old one. Covariance
// in the tangent T_old_new <- T_old_new (Exp(phi), delta), rotation first [rad], translation [m] in the axes
// of the new body: that of an edge in mapping/pose_graph.
//
// At least one keyframe needs inverse depths (feature_depth.hpp); matches without any still count in the
// refinement. Errors: only kInvalidInput (settings out of range, NaN); a rejected candidate is no error.
// Deterministic: the seed is made of the keyframes' indices. Bounded: `effort` scales the samples.
// No allocation; the object holds 243 KiB. Cost: docs/place.md.

#include <array>
#include <cstdint>
#include <optional>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "mapping/place/descriptor_matching.hpp"
#include "mapping/place/loop_consensus.hpp"
#include "mapping/place/place_keyframe.hpp"
#include "mapping/place/place_pyramid.hpp"
#include "mapping/place/relative_pose.hpp"

namespace swiftlet {

enum class LoopFate : std::uint8_t {
  kAccepted,
  kInvalidInput,    ///< a keyframe holds values that are not finite
  kTooFewMatches,   ///< fewer than min_matches by descriptor
  kTooFewDepths,    ///< fewer than min_depths of these have a depth
  kNoConsensus,     ///< no motion explains min_consensus of them
  kTooFewInliers,   ///< after refinement and guided matching
  kLowShare,        ///< most matches by descriptor contradict the pose: repeated structure or chance
  kPoorSpread,      ///< inliers cover a small part of an image, or lie on a line
  kPoorFit,         ///< residuals far above their noise
  kIllConditioned,  ///< rotation or translation poorly determined
  kTooFar,          ///< keyframes farther apart than max_distance
  kFragile,         ///< the pose depends on a few neighbouring matches
};
inline constexpr std::size_t kLoopFates = 12;

/// A few words for logs and tables.
const char* describe(LoopFate fate);

struct LoopVerificationSettings {
  DescriptorMatchSettings matching;
  ConsensusSettings consensus;
  RelativePoseSettings refinement;
  double pixel_sigma = 0.8;            ///< px at octave 0, of a corner seen again from another pose
  double octave_scale = kOctaveRatio;  ///< of the features' pyramid; noise grows with it per octave
  int guided_distance = 64;            ///< bits
  float guided_ratio = 0.9F;           ///< best / next, among the features near the predicted position
  double guided_reach = 60;            ///< px, largest search radius
  std::size_t min_matches = 12;
  std::size_t min_depths = 8;
  std::size_t min_consensus = 10;
  std::size_t min_inliers = 15;
  std::size_t min_kept = 15;          ///< matches by descriptor alone that agree with the final pose
  double min_kept_share = 0.3;        ///< the same, as a share of all matches by descriptor
  double min_spread = 0.1;            ///< rad, of the inliers' bearings across their narrowest direction
  double min_spread_of_many = 0.085;  ///< rad, the same if at least many_kept matches agree
  std::size_t many_kept = 30;
  double max_chi_squared_per_dof = 4;
  double max_rotation_sigma = 0.03;     ///< rad, largest axis
  double max_translation_sigma = 0.15;  ///< m, largest axis; the larger of this and max_relative_sigma counts
  double max_relative_sigma = 0.1;      ///< share of the median distance of the inliers
  double support_reach = 0.1;           ///< rad: matches closer than this may be wrong together
  double max_rotation_shift = 0.03;     ///< rad, if one such group is left out
  double max_distance = 10;             ///< m between the two bodies
  bool five_point = true;               ///< used if three points found nothing and most matches have no depth

  [[nodiscard]] bool valid() const;
};

/// Prior from the odometry. Used as initial guess, never as a measurement.
struct LoopPrior {
  std::optional<Eigen::Quaterniond> R_old_new;  ///< bodies
};

struct LoopVerification {
  LoopFate fate = LoopFate::kInvalidInput;
  std::uint64_t old_index = 0, new_index = 0;
  SE3 T_old_new;                           ///< bodies; of the last stage reached, identity before consensus
  Matrix6d covariance = Matrix6d::Zero();  ///< tangent as above; zero before refinement
  std::size_t matches = 0;
  std::size_t matches_with_depth = 0;
  std::size_t consensus = 0;  ///< matches that agreed before refinement
  int samples = 0;
  std::size_t kept = 0;  ///< matches by descriptor alone that agree with the final pose
  double chi_squared_per_dof = 0;
  double spread = 0;  ///< rad, the smaller of both keyframes
  RelativePoseSupport support;
  DescriptorMatches inliers;  ///< features that agree with the refined pose

  [[nodiscard]] bool accepted() const { return fate == LoopFate::kAccepted; }
};

class LoopVerifier {
 public:
  /// Uses camera 0 of `rig` and its pose on the body.
  explicit LoopVerifier(const Rig& rig, const LoopVerificationSettings& settings = {});

  /// `effort` in (0, 1]: share of the settings' samples that may be drawn.
  Status verify(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe, const LoopPrior& prior,
                double effort, LoopVerification& result);

 private:
  [[nodiscard]] PointView viewOf(const PlaceFeature& feature) const;
  void loadPoints();
  LoopFate consent(const LoopPrior& prior, LoopVerification& result);
  Status refine(LoopVerification& result);
  void matchGuided(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe);
  void offerGuided(std::size_t i, std::size_t j, int distance, const PlaceKeyframe& new_keyframe);
  LoopFate judge(LoopVerification& result);
  [[nodiscard]] std::size_t countKept() const;
  LoopFate run(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe, const LoopPrior& prior,
               LoopVerification& result);

  LoopVerificationSettings settings_;
  CameraModel camera_;
  SE3 T_body_cam_;
  DescriptorMatcher matcher_;
  LoopConsensus consensus_;
  DescriptorMatches first_matches_;  ///< by descriptor alone
  DescriptorMatches matches_;
  MatchedPoints points_;  ///< beside matches_
  SE3 T_cam_;             ///< T_old_new of the cameras
  RelativePoseFit fit_;
  double noise_scale_ = 1;  ///< variance of the matches over the configured one

  struct Guided {
    std::uint16_t distance = 0, next = 0, partner = 0;
  };
  std::array<PointView, kMaxPlaceFeatures> old_views_{}, new_views_{};
  std::array<Guided, kMaxPlaceFeatures> guided_old_{}, guided_new_{};
};

}  // namespace swiftlet
