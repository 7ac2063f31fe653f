#pragma once
// Geometric verification of tracks between two frames by RANSAC: four methods, one result type.
//
//   method             motion known before    sample   gives
//   MonoRansac::fivePoint        nothing      5 tracks rotation, direction of translation
//   MonoRansac::twoPoint         rotation     2 tracks direction of translation
//   StereoRansac::threePoint     nothing      3 tracks rotation, translation in metres
//   StereoRansac::onePoint       rotation     1 track  translation in metres
//
// All work on unit bearings, so any lens will do and angles beyond 90 degrees are ordinary; the
// frames are `prev` and `cur` of cam0: p_cur = T_cur_prev * p_prev.
//
// Gates. Set the noise from the tracker's real errors, tails included: with noise 1.6 times the set
// one the stereo gates lose a fifth of the good tracks, the mono gates 7 %. `bearing_sigma` is the noise of
// one bearing [rad, 1 sigma per axis] = pixel sigma / focal.
//  - Mono: a track is an inlier when its spherical Sampson error is below 3 sigma, its depth is
//    positive in both frames (a parallax against the direction of motion is allowed up to 3 sigma,
//    so far points stay), and it is not nearer than `min_depth_over_baseline` allows.
//  - Stereo: a track is direction and inverse depth from the previous pair, tested against the
//    current pair: chi-square of the residual with the inverse depth marginalized. Nothing is
//    singular at zero disparity, so points without parallax are kept, and used for rotation.
//
// Status of the four: kOk; kInvalidInput (sizes differ or above kMaxFeatures, settings not
// positive); kDegenerate (too few tracks, no consensus, or no parallax to determine the motion).
// When parallax lacks, `no_parallax` is set and the mask is still valid: mono, that of a rotation
// alone, with zero translation; stereo (fewer than 5 near inliers), that of a rotation and an arbitrary
// small translation. Otherwise kDegenerate leaves every track an outlier. Non-finite bearings are
// outliers.
//
// Deterministic for a given seed (use the frame's index). No allocation: the scratch is a member
// (mono 22 KiB, stereo 92 KiB). One call costs O(iterations * tracks); figures: docs/geometry.md.
//
// Sources: Nister, PAMI 2004 (5-point); Arun et al., PAMI 1987 (3-point); Troiani et al., ICRA 2014
// (2-point); Rosinol et al., ICRA 2020 (1-point with Mahalanobis votes); Fischler, Bolles 1981;
// Chum et al., DAGM 2003 (local optimization).

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/status.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct RansacSettings {
  /// Noise of one bearing [rad, 1 sigma per axis]: pixel sigma / CameraModel::focal().
  double bearing_sigma = 0.5 / 450.0;
  /// Probability that at least one sample is free of false tracks.
  double confidence = 0.9999;
  int max_iterations = 300;
  /// 1 sigma per axis [rad] of the given rotation (twoPoint, onePoint): the refinement may turn it
  /// within this. Zero keeps the rotation as given.
  double rotation_sigma = 1e-3;
  /// Mono: smallest believable depth over the distance flown between the frames.
  double min_depth_over_baseline = 0.5;
  /// Fewer inliers than this are no consensus.
  std::size_t min_inliers = 8;

  [[nodiscard]] bool valid() const {
    return bearing_sigma > 0 && confidence > 0 && confidence < 1 && max_iterations > 0 &&
           rotation_sigma >= 0 && min_depth_over_baseline >= 0;
  }
};

struct RansacResult {
  /// Mono: unit translation (or zero, see `no_parallax`). Stereo: metres.
  SE3 T_cur_prev;
  /// One per track, in the order of the input.
  FixedVector<bool, kMaxFeatures> inlier;
  std::size_t inlier_count = 0;
  int iterations = 0;
  /// Mono: a rotation alone explains the tracks. Stereo: fewer than 5
  /// inliers are near enough to have a depth.
  bool no_parallax = false;
};

/// Where one track was seen by both cameras at one time: unit bearings, each in its own camera.
struct StereoBearings {
  Eigen::Vector3d left = Eigen::Vector3d::UnitZ();   ///< in cam0
  Eigen::Vector3d right = Eigen::Vector3d::UnitZ();  ///< in cam1
  /// False: `right` is not used. Such a track of the previous frame is always an outlier here (its
  /// depth is unknown: use `monoInliers` on it); of the current frame it is tested by cam0 alone.
  bool has_right = true;
};

/// A track as unit bearings in the two frames of one camera.
using Bearings = std::span<const Eigen::Vector3d>;

/// Scratch of MonoRansac: the finite tracks by coordinate, and where they stand in the input.
struct MonoTracks {
  struct Coordinates {
    alignas(64) std::array<double, kMaxFeatures> x, y, z;
  };
  Coordinates prev{}, cur{};
  std::array<std::size_t, kMaxFeatures> index{};
  std::size_t count = 0;

  [[nodiscard]] Eigen::Vector3d prevAt(std::size_t i) const { return {prev.x[i], prev.y[i], prev.z[i]}; }
  [[nodiscard]] Eigen::Vector3d curAt(std::size_t i) const { return {cur.x[i], cur.y[i], cur.z[i]}; }
};

/// Scratch of StereoRansac: a track in frames of cam0's orientation whose origin is the middle of
/// the baseline. A point is direction / inverse_depth; the two have uncorrelated noise there.
struct StereoTrack {
  std::size_t index = 0;                                 ///< in the input
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< previous frame, unit
  double inverse_depth = 0;                              ///< previous frame [1/m], may be < 0
  double inverse_depth_sigma = 0;                        ///< [1/m], of both frames
  bool cur_has_right = false;
  bool near = false;  ///< both depths are known well enough to make a hypothesis
  Eigen::Vector3d cur_left = Eigen::Vector3d::UnitZ();       ///< sighting, unit
  Eigen::Vector3d cur_right = Eigen::Vector3d::UnitZ();      ///< sighting, unit, if cur_has_right
  Eigen::Vector3d cur_direction = Eigen::Vector3d::UnitZ();  ///< if cur_has_right
  double cur_inverse_depth = 0;                              ///< [1/m], if cur_has_right
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();     ///< [m], if near: vote of onePoint
  Eigen::Matrix3d translation_covariance = Eigen::Matrix3d::Zero();
};

class MonoRansac {
 public:
  explicit MonoRansac(const RansacSettings& settings = {}) : settings_(settings) {}
  void setSettings(const RansacSettings& settings) { settings_ = settings; }

  /// Five-point RANSAC: nothing known.
  Status fivePoint(Bearings prev, Bearings cur, std::uint64_t seed, RansacResult& result);

  /// Two-point RANSAC with the rotation from the gyroscope.
  Status twoPoint(Bearings prev, Bearings cur, const Eigen::Quaterniond& R_cur_prev, std::uint64_t seed,
                  RansacResult& result);

 private:
  RansacSettings settings_;
  MonoTracks tracks_;
};

/// Marks the tracks of `prev`, `cur` that agree with a known motion `T_cur_prev` (metres, or any
/// scale), by the mono gate above; `inlier` gets one value per track. For tracks without stereo
/// depth after a stereo RANSAC. Returns the number of inliers; none when the sizes do not fit.
std::size_t monoInliers(Bearings prev, Bearings cur, const SE3& T_cur_prev, const RansacSettings& settings,
                        FixedVector<bool, kMaxFeatures>& inlier);

class StereoRansac {
 public:
  /// `T_cam1_cam0`: the rig's extrinsics, baseline not zero.
  explicit StereoRansac(const SE3& T_cam1_cam0, const RansacSettings& settings = {})
      : settings_(settings), T_cam1_cam0_(T_cam1_cam0) {}
  void setSettings(const RansacSettings& settings) { settings_ = settings; }
  void setExtrinsics(const SE3& T_cam1_cam0) { T_cam1_cam0_ = T_cam1_cam0; }

  /// Three-point RANSAC (Arun's alignment of stereo points): nothing known.
  Status threePoint(std::span<const StereoBearings> prev, std::span<const StereoBearings> cur,
                    std::uint64_t seed, RansacResult& result);

  /// One-point RANSAC with the rotation from the gyroscope: each track gives a translation with
  /// its covariance, tracks vote by Mahalanobis distance.
  Status onePoint(std::span<const StereoBearings> prev, std::span<const StereoBearings> cur,
                  const Eigen::Quaterniond& R_cur_prev, std::uint64_t seed, RansacResult& result);

 private:
  RansacSettings settings_;
  SE3 T_cam1_cam0_;
  FixedVector<StereoTrack, kMaxFeatures> tracks_;
};

}  // namespace swiftlet
