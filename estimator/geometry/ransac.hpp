#pragma once
// Geometric verification of one camera's tracks between two frames by RANSAC.
//
//   method                  motion known before    sample     gives
//   MonoRansac::fivePoint   nothing                5 tracks   rotation, direction of translation
//   MonoRansac::twoPoint    rotation               2 tracks   direction of translation
//
// Unit bearings, so any lens and angles beyond 90 degrees are supported; p_cur = T_cur_prev * p_prev.
//
// Gate. Set the noise from the tracker's real errors, including their tails: if the real noise is 1.6 times
// the configured one, 7 % of the good tracks are lost. `bearing_sigma` is the noise of one bearing [rad, 1
// sigma per axis] = pixel sigma / focal length. A track is an inlier if its spherical Sampson error is below
// 3 sigma, its depth is positive in both frames (parallax against the direction of motion is allowed up to 3
// sigma, so that far points are kept), and it is not nearer than `min_depth_over_baseline` allows.
//
// Status: kOk; kInvalidInput (sizes differ or above kMaxFeatures, settings not positive); kDegenerate (too
// few tracks, no consensus, or not enough parallax). Without parallax `no_parallax` is set, and the mask is
// valid for a pure rotation with zero translation. Otherwise kDegenerate marks all tracks as outliers.
// Non-finite bearings are outliers.
//
// Deterministic for a given seed (use the frame's index). No allocation: scratch is a member (22 KiB). Cost:
// O(iterations * tracks) per call; docs/geometry.md.
//
// Sources: Nister, PAMI 2004 (5-point); Troiani et al., ICRA 2014 (2-point); Fischler, Bolles 1981;
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
  /// Standard deviation per axis [rad] of the given rotation (twoPoint), used as its prior in the refinement.
  /// Zero keeps the rotation fixed.
  double rotation_sigma = 1e-3;
  /// Smallest plausible depth, relative to the distance travelled between the frames.
  double min_depth_over_baseline = 0.5;
  /// Smallest number of inliers for a consensus.
  std::size_t min_inliers = 8;

  [[nodiscard]] bool valid() const {
    return bearing_sigma > 0 && confidence > 0 && confidence < 1 && max_iterations > 0 &&
           rotation_sigma >= 0 && min_depth_over_baseline >= 0;
  }
};

struct RansacResult {
  /// Unit translation, or zero, see `no_parallax`.
  SE3 T_cur_prev;
  /// One per track, in the order of the input.
  FixedVector<bool, kMaxFeatures> inlier;
  std::size_t inlier_count = 0;
  int iterations = 0;
  /// A pure rotation explains the tracks; there is no translation.
  bool no_parallax = false;
};

/// A track as unit bearings in the two frames of one camera.
using Bearings = std::span<const Eigen::Vector3d>;

/// Scratch of MonoRansac: coordinates of the finite tracks and their indices in the input.
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

class MonoRansac {
 public:
  explicit MonoRansac(const RansacSettings& settings = {}) : settings_(settings) {}
  void setSettings(const RansacSettings& settings) { settings_ = settings; }

  /// Five-point RANSAC without prior motion.
  Status fivePoint(Bearings prev, Bearings cur, std::uint64_t seed, RansacResult& result);

  /// Two-point RANSAC with the rotation from the gyroscope.
  Status twoPoint(Bearings prev, Bearings cur, const Eigen::Quaterniond& R_cur_prev, std::uint64_t seed,
                  RansacResult& result);

 private:
  RansacSettings settings_;
  MonoTracks tracks_;
};

}  // namespace swiftlet
