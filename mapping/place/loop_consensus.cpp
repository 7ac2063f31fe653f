#include "mapping/place/loop_consensus.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/core/random.hpp"
#include "estimator/geometry/consensus.hpp"
#include "mapping/place/three_point_pose.hpp"

namespace swiftlet {
namespace {

// Chi-square gate of two degrees of freedom (3 sigma), and the factor by which it is widened, because a
// hypothesis comes from a few noisy points.
constexpr float kGate = 11.83F;
constexpr float kWide = 9.0F;
constexpr float kBehind = 1e6F;
// Triangles whose sides differ by more than this many sigma between the keyframes are not solved.
constexpr double kSideSigmas = 3.0;
// Samples drawn for each one solved, at most.
constexpr int kDrawsPerIteration = 20;
// Points whose inverse depth has a larger relative sigma than this give no distance.
constexpr double kMaxRelativeSigma = 0.3;
// Samples are drawn from the best kFirstPool matches at first, and from all after kGrowingDraws draws.
constexpr int kGrowingDraws = 150;
constexpr std::size_t kFirstPool = 12;
// Local refinement of a hypothesis: steps on its inliers, and rounds that select the inliers again.
constexpr int kLocalSteps = 2;
constexpr int kLocalRounds = 2;

bool nearEnough(const PointView& view) {
  return view.hasDepth() && view.inverse_depth > 0 &&
         view.inverse_depth_sigma < kMaxRelativeSigma * view.inverse_depth;
}

Eigen::Vector3d pointOf(const PointView& view) { return view.bearing / view.inverse_depth; }

double distanceVariance(const PointView& view) {
  const double sigma = view.inverse_depth_sigma / (view.inverse_depth * view.inverse_depth);
  return sigma * sigma;
}

// False when the two keyframes disagree on how far apart two points are.
bool sidesAgree(const MatchedPoint& a, const MatchedPoint& b) {
  if (!nearEnough(a.old_view) || !nearEnough(a.new_view) || !nearEnough(b.old_view) ||
      !nearEnough(b.new_view)) {
    return true;
  }
  const double old_side = (pointOf(a.old_view) - pointOf(b.old_view)).norm();
  const double new_side = (pointOf(a.new_view) - pointOf(b.new_view)).norm();
  const double variance = distanceVariance(a.old_view) + distanceVariance(a.new_view) +
                          distanceVariance(b.old_view) + distanceVariance(b.new_view);
  const double difference = old_side - new_side;
  return difference * difference < kSideSigmas * kSideSigmas * variance;
}

using Pool = FixedVector<std::uint16_t, kMaxPlaceFeatures>;

// The matches whose chosen view has a usable depth, in the order of the input.
Pool poolOf(std::span<const MatchedPoint> points, bool old_side) {
  Pool pool;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (nearEnough(old_side ? points[i].old_view : points[i].new_view)) {
      (void)pool.tryPushBack(static_cast<std::uint16_t>(i));
    }
  }
  return pool;
}

// The pool that the n-th draw may use: the best first, all after kGrowingDraws.
std::size_t poolSize(std::size_t all, int draw) {
  const std::size_t first = std::min(all, kFirstPool);
  return first + (all - first) * static_cast<std::size_t>(std::min(draw, kGrowingDraws)) / kGrowingDraws;
}

}  // namespace

double oneWayError(const Eigen::Matrix3d& R_to_from, const Eigen::Vector3d& t_to_from, const PointView& from,
                   const PointView& to) {
  const Eigen::Vector3d h = R_to_from * from.bearing + from.inverse_depth * t_to_from;
  const double inverse = 1.0 / h.norm();
  const Eigen::Vector3d s = h * inverse;
  if (!(s.dot(to.bearing) > 0)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d e = to.bearing - s;
  const Eigen::Vector3d j = (t_to_from - s * s.dot(t_to_from)) * inverse;
  const double variance =
      to.bearing_sigma * to.bearing_sigma + from.bearing_sigma * from.bearing_sigma * inverse * inverse;
  const double depth_variance = from.inverse_depth_sigma * from.inverse_depth_sigma;
  const double along = e.dot(j);
  const double marginal = depth_variance / (variance + depth_variance * j.squaredNorm());
  return (e.squaredNorm() - marginal * along * along) / variance;
}

void LoopConsensus::addLane(Lanes& lanes, const PointView& from, const PointView& to, std::size_t index) {
  const std::size_t i = lanes.count++;
  const Eigen::Vector3f f = from.bearing.cast<float>();
  const Eigen::Vector3f t = to.bearing.cast<float>();
  lanes.fx[i] = f.x();
  lanes.fy[i] = f.y();
  lanes.fz[i] = f.z();
  lanes.tx[i] = t.x();
  lanes.ty[i] = t.y();
  lanes.tz[i] = t.z();
  lanes.inverse_depth[i] = static_cast<float>(from.inverse_depth);
  lanes.depth_information[i] =
      static_cast<float>(1.0 / (from.inverse_depth_sigma * from.inverse_depth_sigma));
  lanes.from_variance[i] = static_cast<float>(from.bearing_sigma * from.bearing_sigma);
  lanes.to_variance[i] = static_cast<float>(to.bearing_sigma * to.bearing_sigma);
  lanes.index[i] = static_cast<std::uint16_t>(index);
}

void LoopConsensus::load(std::span<const MatchedPoint> points) {
  count_ = std::min(points.size(), kMaxPlaceFeatures);
  old_to_new_.count = 0;
  new_to_old_.count = 0;
  with_depth_ = 0;
  best_cost_ = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    const MatchedPoint& m = points[i];
    if (m.old_view.hasDepth()) addLane(old_to_new_, m.old_view, m.new_view, i);
    if (m.new_view.hasDepth()) addLane(new_to_old_, m.new_view, m.old_view, i);
    if (m.old_view.hasDepth() || m.new_view.hasDepth()) ++with_depth_;
  }
}

void LoopConsensus::addErrors(const Lanes& lanes, const SE3& T_to_from) {
  const Eigen::Matrix3f R = T_to_from.R().cast<float>();
  const Eigen::Vector3f t = T_to_from.translation.cast<float>();
  const float r00 = R(0, 0), r01 = R(0, 1), r02 = R(0, 2);
  const float r10 = R(1, 0), r11 = R(1, 1), r12 = R(1, 2);
  const float r20 = R(2, 0), r21 = R(2, 1), r22 = R(2, 2);
  const float t0 = t.x(), t1 = t.y(), t2 = t.z();
  const std::size_t count = lanes.count;
  for (std::size_t i = 0; i < count; ++i) {
    const float rho = lanes.inverse_depth[i];
    const float hx = r00 * lanes.fx[i] + r01 * lanes.fy[i] + r02 * lanes.fz[i] + rho * t0;
    const float hy = r10 * lanes.fx[i] + r11 * lanes.fy[i] + r12 * lanes.fz[i] + rho * t1;
    const float hz = r20 * lanes.fx[i] + r21 * lanes.fy[i] + r22 * lanes.fz[i] + rho * t2;
    const float inverse = 1.0F / std::sqrt(hx * hx + hy * hy + hz * hz);
    const float sx = hx * inverse, sy = hy * inverse, sz = hz * inverse;
    const float ex = lanes.tx[i] - sx, ey = lanes.ty[i] - sy, ez = lanes.tz[i] - sz;
    const float st = sx * t0 + sy * t1 + sz * t2;
    const float jx = (t0 - sx * st) * inverse, jy = (t1 - sy * st) * inverse, jz = (t2 - sz * st) * inverse;
    const float variance = lanes.to_variance[i] + lanes.from_variance[i] * inverse * inverse;
    const float along = ex * jx + ey * jy + ez * jz;
    const float jj = jx * jx + jy * jy + jz * jz;
    const float ee = ex * ex + ey * ey + ez * ez;
    const float chi = (ee - along * along / (variance * lanes.depth_information[i] + jj)) / variance;
    const bool front = sx * lanes.tx[i] + sy * lanes.ty[i] + sz * lanes.tz[i] > 0;
    // NaN counts as behind.
    lane_error_[i] = front && chi < kBehind ? chi : kBehind;
  }
  for (std::size_t i = 0; i < count; ++i) {
    float& worst = error_[lanes.index[i]];
    worst = std::max(worst, lane_error_[i]);
  }
}

LoopConsensus::Score LoopConsensus::score(const SE3& T_old_new) {
  std::fill(error_.begin(), error_.begin() + static_cast<std::ptrdiff_t>(count_), -1.0F);
  addErrors(new_to_old_, T_old_new);
  addErrors(old_to_new_, T_old_new.inverse());
  Score result;
  for (std::size_t i = 0; i < count_; ++i) {
    if (error_[i] < 0) continue;
    result.cost += std::min(error_[i], kGate * kWide);
    if (error_[i] < kGate * kWide) ++result.inliers;
  }
  return result;
}

void LoopConsensus::markUsed(std::span<MatchedPoint> points) const {
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].used = i < count_ && error_[i] >= 0 && error_[i] < kGate * kWide;
  }
}

bool LoopConsensus::offer(std::span<MatchedPoint> points, const SE3& T_old_new, ConsensusResult& result) {
  Score best = score(T_old_new);
  if (!(best.cost < best_cost_)) return false;
  SE3 T = T_old_new;
  for (int round = 0; round < kLocalRounds && best.inliers >= 4; ++round) {
    (void)score(T);
    markUsed(points);
    SE3 next = T;
    RelativePoseFit fit;
    if (!refineRelativePose({.steps = kLocalSteps}, points, next, fit).ok()) break;
    const Score refined = score(next);
    if (!(refined.cost < best.cost)) break;
    best = refined;
    T = next;
  }
  best_cost_ = best.cost;
  result.T_old_new = T;
  result.inliers = best.inliers;
  return true;
}

Status LoopConsensus::finish(std::span<MatchedPoint> points, ConsensusResult& result) {
  if (!std::isfinite(best_cost_))
    return {StatusCode::kDegenerate, "loop consensus: no sample could be solved"};
  (void)score(result.T_old_new);
  markUsed(points);
  if (result.inliers < settings_.min_inliers) {
    return {StatusCode::kDegenerate, "loop consensus: too few matches agree on a motion"};
  }
  return okStatus();
}

Status LoopConsensus::threePoint(std::span<MatchedPoint> points, std::uint64_t seed,
                                 ConsensusResult& result) {
  result = ConsensusResult{};
  load(points);
  const Pool old_pool = poolOf(points, true);
  const Pool new_pool = poolOf(points, false);
  if (std::max(old_pool.size(), new_pool.size()) < 3) {
    return {StatusCode::kDegenerate, "loop consensus: too few matches with depth"};
  }
  Random random(seed);
  int needed = settings_.iterations;
  int draws = kDrawsPerIteration * settings_.iterations;
  for (int draw = 0; draw < draws && result.iterations < needed; ++draw) {
    // Both keyframes give the points in turn, unless one has too few depths.
    const bool from_old = new_pool.size() < 3 || (old_pool.size() >= 3 && draw % 2 == 0);
    const Pool& pool = from_old ? old_pool : new_pool;
    const auto sample = drawSample<3>(random, poolSize(pool.size(), draw));
    const MatchedPoint& a = points[pool[sample[0]]];
    const MatchedPoint& b = points[pool[sample[1]]];
    const MatchedPoint& c = points[pool[sample[2]]];
    if (!sidesAgree(a, b) || !sidesAgree(b, c) || !sidesAgree(a, c)) continue;
    ++result.iterations;
    const auto poses =
        from_old ? poseFromThreePoints({pointOf(a.old_view), pointOf(b.old_view), pointOf(c.old_view)},
                                       {a.new_view.bearing, b.new_view.bearing, c.new_view.bearing})
                 : poseFromThreePoints({pointOf(a.new_view), pointOf(b.new_view), pointOf(c.new_view)},
                                       {a.old_view.bearing, b.old_view.bearing, c.old_view.bearing});
    for (const SE3& pose : poses) {
      if (!offer(points, from_old ? pose : pose.inverse(), result)) continue;
      const std::size_t pool_all = std::max<std::size_t>(with_depth_, 3);
      needed = samplesNeeded(result.inliers, pool_all, 3, settings_.confidence, settings_.iterations);
      draws = std::min(draws, draw + 1 + kDrawsPerIteration * needed);
    }
  }
  return finish(points, result);
}

Status LoopConsensus::onePoint(std::span<MatchedPoint> points, const Eigen::Quaterniond& R_old_new,
                               std::uint64_t seed, ConsensusResult& result) {
  result = ConsensusResult{};
  if (!R_old_new.coeffs().allFinite() || !(R_old_new.norm() > 0)) {
    return {StatusCode::kInvalidInput, "loop consensus: the given rotation is not finite"};
  }
  load(points);
  const Eigen::Quaterniond R = R_old_new.normalized();
  Random random(seed);
  Pool pool;
  for (std::size_t i = 0; i < count_; ++i) {
    if (nearEnough(points[i].old_view) && nearEnough(points[i].new_view)) {
      (void)pool.tryPushBack(static_cast<std::uint16_t>(i));
    }
  }
  int needed = pool.empty() ? 0 : std::min(settings_.iterations, static_cast<int>(4 * pool.size()));
  for (; result.iterations < needed; ++result.iterations) {
    const std::size_t all = poolSize(pool.size(), result.iterations);
    const MatchedPoint& m = points[pool[random.below(static_cast<std::uint32_t>(all))]];
    const SE3 T(R, pointOf(m.old_view) - R * pointOf(m.new_view));
    if (!offer(points, T, result)) continue;
    needed = std::min(needed, samplesNeeded(result.inliers, std::max<std::size_t>(with_depth_, 1), 1,
                                            settings_.confidence, settings_.iterations));
  }
  return finish(points, result);
}

Status LoopConsensus::fivePoint(std::span<MatchedPoint> points, std::uint64_t seed, ConsensusResult& result) {
  result = ConsensusResult{};
  load(points);
  const std::size_t count = std::min(points.size(), kMaxFeatures);
  double sigma = 0;
  for (std::size_t i = 0; i < count; ++i) {
    mono_new_[i] = points[i].new_view.bearing;
    mono_old_[i] = points[i].old_view.bearing;
    sigma += points[i].new_view.bearing_sigma / static_cast<double>(count);
  }
  RansacSettings settings;
  settings.bearing_sigma = sigma > 0 ? sigma : 1.0;
  settings.max_iterations = settings_.five_point_iterations;
  settings.min_inliers = settings_.min_inliers;
  // Keyframes of one place may be far apart, with points between them.
  settings.min_depth_over_baseline = 0.1;
  mono_.setSettings(settings);
  const std::span<const Eigen::Vector3d> from(mono_new_.data(), count);
  const std::span<const Eigen::Vector3d> to(mono_old_.data(), count);
  const Status status = mono_.fivePoint(from, to, seed, mono_result_);
  result.iterations = mono_result_.iterations;
  if (!status.ok() && !mono_result_.no_parallax) return status;
  const SE3 T = mono_result_.T_cur_prev;
  if (mono_result_.no_parallax) {
    (void)offer(points, T, result);
    return finish(points, result);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!mono_result_.inlier[i]) continue;
    // The length of the translation that puts this match at its depth; the direction is known.
    const PointView& view = nearEnough(points[i].new_view) ? points[i].new_view : points[i].old_view;
    if (!nearEnough(view)) continue;
    const bool in_new = &view == &points[i].new_view;
    const SE3 motion = in_new ? T : T.inverse();
    const Eigen::Vector3d& seen = in_new ? points[i].old_view.bearing : points[i].new_view.bearing;
    const Eigen::Vector3d a = seen.cross(motion.rotation * pointOf(view));
    const Eigen::Vector3d c = seen.cross(motion.translation);
    const double scale = -a.dot(c) / c.squaredNorm();
    if (!(scale > 0) || !std::isfinite(scale)) continue;
    (void)offer(points, SE3(T.rotation, scale * T.translation), result);
  }
  return finish(points, result);
}

}  // namespace swiftlet
