#pragma once
// RANSAC on matches of two keyframes: the relative pose that most matches agree on, before refinement.
//
//   method       motion known before  sample                                  used when
//   threePoint   nothing              3 matches with depth in one keyframe    always first
//   onePoint     rotation             1 match with depth in both              a rotation is given
//   fivePoint    nothing              5 matches, then 1 for the scale         nothing found, depths rare
//
// threePoint takes points from whichever keyframe knows their depth and bearings from the other (P3P), so a
// match needs only one depth, and depth errors do not turn the pose. If both depths are known, the sides of
// the triangle must agree before anything is solved, which discards most false samples for 50 ns. Matches
// with small descriptor distance are drawn first (as PROSAC; Chum, Matas, CVPR 2005).
// A hypothesis is scored by the one-way error of each match, in both directions if both depths are known:
// chi-square of the bearing with the inverse depth marginalized (estimator/geometry/ransac.hpp), truncated.
// The best so far is refined on its inliers (Chum et al., DAGM 2003).
//
// Deterministic for a given seed. No allocation; the object holds 88 KiB. Bounded by `iterations`.

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/geometry/ransac.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/place/place_keyframe.hpp"
#include "mapping/place/relative_pose.hpp"

namespace swiftlet {

using MatchedPoints = FixedVector<MatchedPoint, kMaxPlaceFeatures>;

/// Chi-square of the bearing `to` of a point with direction and inverse depth `from` (bearing noise of both,
/// inverse depth marginalized); infinite if the point is behind. p_to = R p_from + t.
double oneWayError(const Eigen::Matrix3d& R_to_from, const Eigen::Vector3d& t_to_from, const PointView& from,
                   const PointView& to);

struct ConsensusSettings {
  int iterations = 400;  ///< samples solved, at most
  int five_point_iterations = 120;
  double confidence = 0.999;
  std::size_t min_inliers = 10;
};

struct ConsensusResult {
  SE3 T_old_new;  ///< cameras
  std::size_t inliers = 0;
  int iterations = 0;
};

class LoopConsensus {
 public:
  explicit LoopConsensus(const ConsensusSettings& settings = {}) : settings_(settings) {}
  void setSettings(const ConsensusSettings& settings) { settings_ = settings; }

  /// `points`: best match first (by descriptor distance). kDegenerate: no motion has min_inliers. Sets `used`
  /// of the inliers and clears that of the others.
  Status threePoint(std::span<MatchedPoint> points, std::uint64_t seed, ConsensusResult& result);

  /// With a given rotation, from odometry or gyroscope.
  Status onePoint(std::span<MatchedPoint> points, const Eigen::Quaterniond& R_old_new, std::uint64_t seed,
                  ConsensusResult& result);

  /// Rotation and direction of translation by MonoRansac::fivePoint over the first kMaxFeatures matches;
  /// scale by the match whose depth most others agree with.
  Status fivePoint(std::span<MatchedPoint> points, std::uint64_t seed, ConsensusResult& result);

 private:
  struct Lanes {
    alignas(64) std::array<float, kMaxPlaceFeatures> fx{}, fy{}, fz{}, tx{}, ty{}, tz{};  ///< from, to
    alignas(64) std::array<float, kMaxPlaceFeatures> inverse_depth{}, depth_information{};
    alignas(64) std::array<float, kMaxPlaceFeatures> from_variance{}, to_variance{};
    std::array<std::uint16_t, kMaxPlaceFeatures> index{};  ///< in the points
    std::size_t count = 0;
  };
  struct Score {
    float cost = 0;
    std::size_t inliers = 0;
  };

  void load(std::span<const MatchedPoint> points);
  void addLane(Lanes& lanes, const PointView& from, const PointView& to, std::size_t index);
  void addErrors(const Lanes& lanes, const SE3& T_to_from);
  Score score(const SE3& T_old_new);
  void markUsed(std::span<MatchedPoint> points) const;
  /// True if it became the best.
  bool offer(std::span<MatchedPoint> points, const SE3& T_old_new, ConsensusResult& result);
  [[nodiscard]] Status finish(std::span<MatchedPoint> points, ConsensusResult& result);

  ConsensusSettings settings_;
  MonoRansac mono_;
  RansacResult mono_result_;
  std::array<Eigen::Vector3d, kMaxFeatures> mono_old_{}, mono_new_{};
  Lanes old_to_new_, new_to_old_;
  alignas(64) std::array<float, kMaxPlaceFeatures> lane_error_{};  ///< of one direction
  alignas(64) std::array<float, kMaxPlaceFeatures> error_{};       ///< of each point; negative: no depth
  std::size_t count_ = 0;
  std::size_t with_depth_ = 0;
  float best_cost_ = 0;
};

}  // namespace swiftlet
