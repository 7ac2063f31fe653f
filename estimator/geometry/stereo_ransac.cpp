#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/core/random.hpp"
#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/consensus.hpp"
#include "estimator/geometry/minimal_solvers.hpp"
#include "estimator/geometry/ransac.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Probability 0.9973 (3 sigma) for 1 (linear), 2, 3 and 4 degrees of freedom.
constexpr double kGateSigmas = 3.0;
constexpr double kGateTwoDof = 11.83;
constexpr double kGateThreeDof = 14.16;
constexpr double kGateFourDof = 16.25;
// A hypothesis from a few noisy points is compared with gates widened by this (on the square).
constexpr double kWide = 9.0;
// Rays nearer than this (sine) to the baseline hold no depth.
constexpr double kMinBaselineSine = 0.02;
// Depths with a larger relative sigma make no hypothesis.
constexpr double kMaxRelativeSigma = 0.15;
// Fewer inliers with a depth do not determine a translation; nor does a smaller share of the tracks
// with a depth: when all true ones are far, the false ones alone seem to have one.
constexpr std::size_t kMinNearInliers = 5;
constexpr double kMinNearShare = 0.25;
constexpr int kSampleSteps = 2;
constexpr int kRefineSteps = 2;
constexpr int kFinalRefineSteps = 6;

using Tracks = FixedVector<StereoTrack, kMaxFeatures>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Motion between the frames in the middle of the baseline: p_cur = R p_prev + t.
struct Model {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  double cost = std::numeric_limits<double>::infinity();
  std::size_t inliers = 0;
};

struct Problem {
  Eigen::Vector3d half_baseline;  // [m] from the middle to cam1, in cam0's orientation
  Eigen::Matrix3d R_cam0_cam1;
  double sigma = 0;  // [rad]
  Eigen::Matrix3d R_prior = Eigen::Matrix3d::Identity();
  double prior_information = 0;  // [1/rad^2]; infinite: the rotation is fixed

  [[nodiscard]] bool fixesRotation() const { return std::isinf(prior_information); }
  [[nodiscard]] bool hasPrior() const { return prior_information > 0 && !fixesRotation(); }
};

// A stereo pair as direction and inverse depth from the middle of the baseline.
struct PairPoint {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double inverse_depth = 0;
  double sigma = 0;         // of inverse_depth
  bool consistent = false;  // the rays meet within their noise and not behind

  [[nodiscard]] bool near() const { return inverse_depth > 0 && sigma < kMaxRelativeSigma * inverse_depth; }
  [[nodiscard]] Eigen::Vector3d point() const { return direction / inverse_depth; }
};

PairPoint pairPoint(const Problem& problem, const Eigen::Vector3d& left, const Eigen::Vector3d& right) {
  PairPoint result;
  const double baseline = 2.0 * problem.half_baseline.norm();
  const Eigen::Vector3d axis = problem.half_baseline.normalized();
  const Eigen::Vector3d across = axis.cross(left + right);
  const double length = across.norm();
  if (!(length > 0)) return result;
  const Eigen::Vector3d normal = across / length;  // of the common epipolar plane
  const double miss = normal.dot(left - right);
  // Both rays turned into the plane; there a point is two angles from the baseline.
  const Eigen::Vector3d left_in = (left - normal * normal.dot(left)).normalized();
  const Eigen::Vector3d right_in = (right - normal * normal.dot(right)).normalized();
  const double sine = std::max(0.5 * length, kMinBaselineSine);
  const double right_sine = std::max(normal.dot(axis.cross(right_in)), kMinBaselineSine);
  const double inverse_left_depth = normal.dot(left_in.cross(right_in)) / (baseline * right_sine);
  const Eigen::Vector3d scaled = left_in - problem.half_baseline * inverse_left_depth;
  const double scale = scaled.norm();
  if (!(scale > 0)) return result;
  result.direction = scaled / scale;
  result.inverse_depth = inverse_left_depth / scale;
  result.sigma = std::numbers::sqrt2 * problem.sigma / (baseline * sine);
  const bool meets = std::abs(miss) < kGateSigmas * std::numbers::sqrt2 * problem.sigma;
  result.consistent = meets && result.inverse_depth > -kGateSigmas * result.sigma && left.dot(right) > 0;
  return result;
}

Status invalid(const char* what) { return {StatusCode::kInvalidInput, what}; }

Status load(std::span<const StereoBearings> prev, std::span<const StereoBearings> cur, const Problem& problem,
            const RansacSettings& settings, Tracks& tracks, RansacResult& result) {
  result = RansacResult{};
  tracks.clear();
  if (prev.size() != cur.size() || prev.size() > kMaxFeatures) {
    return invalid("ransac: track counts differ or exceed kMaxFeatures");
  }
  if (!(problem.half_baseline.norm() > 0)) return invalid("stereo ransac: the baseline is zero");
  if (!settings.valid()) return invalid("ransac: a setting is out of range");
  result.inlier.resize(prev.size());
  for (std::size_t i = 0; i < prev.size(); ++i) {
    result.inlier[i] = false;
    if (!prev[i].has_right || !prev[i].left.allFinite() || !prev[i].right.allFinite()) continue;
    if (!cur[i].left.allFinite() || (cur[i].has_right && !cur[i].right.allFinite())) continue;
    const PairPoint point = pairPoint(problem, prev[i].left, problem.R_cam0_cam1 * prev[i].right);
    if (!point.consistent) continue;
    StereoTrack track;
    track.index = i;
    track.direction = point.direction;
    track.inverse_depth = point.inverse_depth;
    track.inverse_depth_sigma = point.sigma;
    track.cur_left = cur[i].left;
    track.cur_has_right = cur[i].has_right;
    if (cur[i].has_right) {
      track.cur_right = problem.R_cam0_cam1 * cur[i].right;
      const PairPoint cur_point = pairPoint(problem, track.cur_left, track.cur_right);
      if (!cur_point.consistent) continue;
      track.near = point.near() && cur_point.near();
      track.cur_direction = cur_point.direction;
      track.cur_inverse_depth = cur_point.inverse_depth;
    }
    (void)tracks.tryPushBack(track);
  }
  return okStatus();
}

// Predicted sighting of a track by one camera at `offset` from the middle, and its derivatives.
struct Sighting {
  Eigen::Vector3d seen;   // unit
  double inverse_length;  // of the unnormalized prediction: depth ratio, 1 when nothing moved
  Eigen::Vector3d residual;
  Eigen::Vector3d by_inverse_depth;  // d residual

  Sighting(const Eigen::Vector3d& turned, const StereoTrack& track, const Eigen::Vector3d& offset,
           const Eigen::Vector3d& bearing) {
    const Eigen::Vector3d h = turned + track.inverse_depth * offset;
    inverse_length = 1.0 / h.norm();
    seen = h * inverse_length;
    residual = bearing - seen;
    by_inverse_depth = -(offset - seen * seen.dot(offset)) * inverse_length;
  }
};

// Whitened residual: sum (rows 0-2) and difference (rows 3-5) of the two cameras' errors. The noise
// of the previous direction enters both cameras alike, so it widens the sum only. `depth` is the
// derivative by the inverse depth; its noise is marginalized by the rank-one form
// I - depth depth^T / (1 / sigma^2 + |depth|^2).
struct Whitened {
  Vector6d residual = Vector6d::Zero();
  Vector6d depth = Vector6d::Zero();
  double depth_weight = 0;
  double sum_scale = 0;
  double difference_scale = 0;
  bool in_front = false;
  double gate = kGateFourDof;

  [[nodiscard]] double chiSquared() const {
    const double along = depth.dot(residual);
    return residual.squaredNorm() - depth_weight * along * along;
  }
  /// False when the four sightings together put the point behind; `prior`: the track's inverse
  /// depth. `depth_weight` is the variance of its best value.
  [[nodiscard]] bool depthPositive(double prior) const {
    return prior - depth_weight * depth.dot(residual) > -kGateSigmas * std::sqrt(depth_weight);
  }
};

Whitened whiten(const Problem& problem, const StereoTrack& track, const Sighting& left,
                const Sighting& right) {
  Whitened w;
  const double carried = left.inverse_length * left.inverse_length;
  w.in_front = left.seen.dot(track.cur_left) > 0;
  if (track.cur_has_right) {
    w.in_front = w.in_front && right.seen.dot(track.cur_right) > 0;
    w.sum_scale = 1.0 / (problem.sigma * std::sqrt(2.0 * (1.0 + carried)));
    w.difference_scale = 1.0 / (problem.sigma * std::numbers::sqrt2);
    w.residual << w.sum_scale * (left.residual + right.residual),
        w.difference_scale * (left.residual - right.residual);
    w.depth << w.sum_scale * (left.by_inverse_depth + right.by_inverse_depth),
        w.difference_scale * (left.by_inverse_depth - right.by_inverse_depth);
  } else {
    w.sum_scale = 1.0 / (problem.sigma * std::sqrt(1.0 + 0.5 * carried));
    w.residual.head<3>() = w.sum_scale * left.residual;
    w.depth.head<3>() = w.sum_scale * left.by_inverse_depth;
    w.gate = kGateTwoDof;
  }
  const double variance = track.inverse_depth_sigma * track.inverse_depth_sigma;
  w.depth_weight = variance / (1.0 + variance * w.depth.squaredNorm());
  w.in_front = w.in_front && w.depthPositive(track.inverse_depth);
  return w;
}

// Chi-square over its gate; 1 or more: outlier.
double gatedError(const Problem& problem, const Model& model, const StereoTrack& track) {
  const Eigen::Vector3d turned = model.R * track.direction;
  const Sighting left(turned, track, model.t + problem.half_baseline, track.cur_left);
  const Sighting right(turned, track, model.t - problem.half_baseline, track.cur_right);
  const Whitened w = whiten(problem, track, left, right);
  if (!w.in_front) return std::numeric_limits<double>::infinity();
  return w.chiSquared() / w.gate;
}

void score(const Problem& problem, const Tracks& tracks, double widening, Model& model) {
  model.cost = 0;
  model.inliers = 0;
  if (problem.hasPrior()) {
    const Eigen::Matrix3d difference = problem.R_prior.transpose() * model.R;
    model.cost = problem.prior_information * logSo3(difference).squaredNorm() / (kGateFourDof * widening);
  }
  for (const StereoTrack& track : tracks) {
    const double error = gatedError(problem, model, track) / widening;
    if (error < 1.0) {
      model.cost += error;
      ++model.inliers;
    } else {
      model.cost += 1.0;  // NaN too
    }
  }
}

void addTrack(const Problem& problem, const Model& model, const StereoTrack& track, double widening,
              Matrix6d& H, Vector6d& g) {
  const Eigen::Vector3d turned = model.R * track.direction;
  const Sighting left(turned, track, model.t + problem.half_baseline, track.cur_left);
  const Sighting right(turned, track, model.t - problem.half_baseline, track.cur_right);
  const Whitened w = whiten(problem, track, left, right);
  if (!w.in_front || !(w.chiSquared() < w.gate * widening)) return;
  // d prediction by (phi, t), before the projection on the sphere.
  Eigen::Matrix<double, 3, 6> by_motion;
  by_motion << -model.R * hat(track.direction), track.inverse_depth * Eigen::Matrix3d::Identity();
  const auto onSphere = [&](const Sighting& s) -> Eigen::Matrix<double, 3, 6> {
    return -(by_motion - s.seen * (s.seen.transpose() * by_motion)) * s.inverse_length;
  };
  Matrix6d J = Matrix6d::Zero();
  const Eigen::Matrix<double, 3, 6> J_left = onSphere(left);
  if (track.cur_has_right) {
    const Eigen::Matrix<double, 3, 6> J_right = onSphere(right);
    J << w.sum_scale * (J_left + J_right), w.difference_scale * (J_left - J_right);
  } else {
    J.topRows<3>() = w.sum_scale * J_left;
  }
  const Vector6d J_depth = J.transpose() * w.depth;
  H.noalias() += J.transpose() * J;
  H.noalias() -= w.depth_weight * J_depth * J_depth.transpose();
  g.noalias() += J.transpose() * w.residual;
  g.noalias() -= w.depth_weight * w.depth.dot(w.residual) * J_depth;
}

// One Gauss-Newton step; false when the tracks do not determine it.
bool applyStep(const Problem& problem, Matrix6d H, Vector6d g, Model& model) {
  if (problem.hasPrior()) {
    const Eigen::Matrix3d difference = problem.R_prior.transpose() * model.R;
    g.head<3>() += problem.prior_information * logSo3(difference);
    H.diagonal().head<3>().array() += problem.prior_information;
  }
  Vector6d step = Vector6d::Zero();
  if (problem.fixesRotation()) {
    step.tail<3>() = -H.bottomRightCorner<3, 3>().ldlt().solve(g.tail<3>());
  } else {
    step = -H.ldlt().solve(g);
  }
  if (!step.allFinite()) return false;
  model.R = model.R * expSo3Matrix(step.head<3>());
  model.t += step.tail<3>();
  return true;
}

// Steps on all tracks within the gate while the truncated cost falls.
void refine(const Problem& problem, const Tracks& tracks, double widening, int steps, Model& model) {
  for (int i = 0; i < steps; ++i) {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    for (const StereoTrack& track : tracks) addTrack(problem, model, track, widening, H, g);
    Model next = model;
    if (!applyStep(problem, H, g, next)) return;
    score(problem, tracks, widening, next);
    if (!(next.cost < model.cost)) return;
    model = next;
  }
}

// From the wide gates to the true ones.
void polish(const Problem& problem, const Tracks& tracks, Model& model) {
  refine(problem, tracks, kWide, kRefineSteps, model);
  score(problem, tracks, 1.0, model);
  refine(problem, tracks, 1.0, kRefineSteps, model);
}

struct NearTracks {
  std::array<std::size_t, kMaxFeatures> at{};
  std::size_t count = 0;

  explicit NearTracks(const Tracks& tracks) {
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (tracks[i].near) at[count++] = i;
    }
  }
};

std::size_t inliersAmong(const Problem& problem, const Tracks& tracks, const NearTracks& near,
                         const Model& model) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < near.count; ++i) {
    if (gatedError(problem, model, tracks[near.at[i]]) < 1.0) ++count;
  }
  return count;
}

// Keeps the better of two hypotheses: compared with wide gates, polished when it wins.
class Best {
 public:
  Best(const Problem& problem, const Tracks& tracks) : problem_(problem), tracks_(tracks) {}

  /// True when the model became the best.
  bool offer(Model model) {
    score(problem_, tracks_, kWide, model);
    if (!(model.cost < wide_cost_)) return false;
    wide_cost_ = model.cost;
    polish(problem_, tracks_, model);
    if (!(model.cost < model_.cost)) return false;
    model_ = model;
    return true;
  }
  [[nodiscard]] const Model& model() const { return model_; }

 private:
  const Problem& problem_;
  const Tracks& tracks_;
  Model model_;
  double wide_cost_ = std::numeric_limits<double>::infinity();
};

// All tracks far away: a rotation from directions, the translation taken as zero.
Model farModel(const Problem& problem, const Tracks& tracks, const RansacSettings& settings, Random& random,
               int& iterations) {
  Best best(problem, tracks);
  if (problem.prior_information > 0) {
    best.offer({.R = problem.R_prior});
    return best.model();
  }
  int needed = tracks.size() < 2 ? 0 : settings.max_iterations;
  for (int i = 0; i < needed; ++i, ++iterations) {
    const auto sample = drawSample<2>(random, tracks.size());
    Model model;
    model.R = rotationFromTwoPoints(std::array{tracks[sample[0]].direction, tracks[sample[1]].direction},
                                    std::array{tracks[sample[0]].cur_left, tracks[sample[1]].cur_left});
    if (!model.R.allFinite() || !best.offer(model)) continue;
    needed =
        samplesNeeded(best.model().inliers, tracks.size(), 2, settings.confidence, settings.max_iterations);
  }
  return best.model();
}

// The better of the motion that near tracks gave and one without depth; out to the result.
Status finish(const Problem& problem, const Tracks& tracks, const NearTracks& near,
              const RansacSettings& settings, Random& random, Model model, RansacResult& result) {
  const std::size_t agree = inliersAmong(problem, tracks, near, model);
  const bool no_parallax =
      agree < kMinNearInliers || static_cast<double>(agree) < kMinNearShare * static_cast<double>(near.count);
  if (no_parallax) {
    const Model far = farModel(problem, tracks, settings, random, result.iterations);
    if (far.cost < model.cost) model = far;
  }
  refine(problem, tracks, 1.0, kFinalRefineSteps, model);
  if (model.inliers < settings.min_inliers) {
    return {StatusCode::kDegenerate, "stereo ransac: too few tracks agree on a motion"};
  }
  // From the middle of the baseline back to cam0.
  const Eigen::Vector3d t = model.t + problem.half_baseline - model.R * problem.half_baseline;
  result.T_cur_prev = SE3(model.R, t);
  result.inlier_count = model.inliers;
  result.no_parallax = no_parallax;
  for (const StereoTrack& track : tracks)
    result.inlier[track.index] = gatedError(problem, model, track) < 1.0;
  if (!no_parallax) return okStatus();
  return {StatusCode::kDegenerate, "stereo ransac: too few near tracks, the translation is a guess"};
}

Problem makeProblem(const SE3& T_cam1_cam0, const RansacSettings& settings) {
  const SE3 T_cam0_cam1 = T_cam1_cam0.inverse();
  Problem problem;
  problem.half_baseline = 0.5 * T_cam0_cam1.translation;
  problem.R_cam0_cam1 = T_cam0_cam1.R();
  problem.sigma = settings.bearing_sigma;
  return problem;
}

// Three points aligned in space, then stepped on their sightings: depth noise gets its true weight.
Model modelFromThree(const Problem& problem, const Tracks& tracks, const std::array<std::size_t, 3>& sample) {
  std::array<Eigen::Vector3d, 3> from;
  std::array<Eigen::Vector3d, 3> to;
  for (std::size_t i = 0; i < 3; ++i) {
    const StereoTrack& track = tracks[sample[i]];
    from[i] = track.direction / track.inverse_depth;
    to[i] = track.cur_direction / track.cur_inverse_depth;
  }
  Alignment alignment;
  Model model;
  if (!alignRigid(from, to, alignment).ok()) return model;
  model.R = alignment.T_to_from.R();
  model.t = alignment.T_to_from.translation;
  for (int step = 0; step < kSampleSteps; ++step) {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    constexpr double kAll = std::numeric_limits<double>::infinity();
    for (const std::size_t at : sample) addTrack(problem, model, tracks[at], kAll, H, g);
    if (!applyStep(problem, H, g, model)) break;
  }
  return model;
}

// Covariance of a point from its inverse depth.
Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& direction, double inverse_depth,
                                double inverse_depth_sigma, double direction_variance) {
  const double depth = 1.0 / inverse_depth;
  const double across = direction_variance * depth * depth;
  const double depth_sigma = inverse_depth_sigma * depth * depth;
  return across * Eigen::Matrix3d::Identity() +
         (depth_sigma * depth_sigma - across) * direction * direction.transpose();
}

// Each near track's translation and covariance, the given rotation's noise included.
void makeVotes(const Problem& problem, double rotation_sigma, const NearTracks& near, Tracks& tracks) {
  const double direction_variance = 0.5 * problem.sigma * problem.sigma;
  const double turned_variance = direction_variance + rotation_sigma * rotation_sigma;
  for (std::size_t i = 0; i < near.count; ++i) {
    StereoTrack& track = tracks[near.at[i]];
    const Eigen::Vector3d turned = problem.R_prior * track.direction;
    track.translation = track.cur_direction / track.cur_inverse_depth - turned / track.inverse_depth;
    track.translation_covariance =
        pointCovariance(turned, track.inverse_depth, track.inverse_depth_sigma, turned_variance) +
        pointCovariance(track.cur_direction, track.cur_inverse_depth, track.inverse_depth_sigma,
                        direction_variance);
  }
}

// The mean of the votes that agree with one of them, each weighted by its information.
Eigen::Vector3d meanOfVotes(const NearTracks& near, const Tracks& tracks, const StereoTrack& chosen) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < near.count; ++i) {
    const StereoTrack& other = tracks[near.at[i]];
    const Eigen::Vector3d difference = other.translation - chosen.translation;
    const Eigen::Matrix3d covariance = other.translation_covariance + chosen.translation_covariance;
    if (difference.dot(covariance.inverse() * difference) >= kGateThreeDof) continue;
    const Eigen::Matrix3d weight = other.translation_covariance.inverse();
    information += weight;
    weighted += weight * other.translation;
  }
  return information.ldlt().solve(weighted);
}

}  // namespace

Status StereoRansac::threePoint(std::span<const StereoBearings> prev, std::span<const StereoBearings> cur,
                                std::uint64_t seed, RansacResult& result) {
  const Problem problem = makeProblem(T_cam1_cam0_, settings_);
  const Status loaded = load(prev, cur, problem, settings_, tracks_, result);
  if (!loaded.ok()) return loaded;
  Random random(seed);
  const NearTracks near(tracks_);
  Best best(problem, tracks_);
  int needed = near.count < 3 ? 0 : settings_.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    auto sample = drawSample<3>(random, near.count);
    for (std::size_t& at : sample) at = near.at[at];
    if (!best.offer(modelFromThree(problem, tracks_, sample))) continue;
    const std::size_t agree = inliersAmong(problem, tracks_, near, best.model());
    needed = samplesNeeded(agree, near.count, 3, settings_.confidence, settings_.max_iterations);
  }
  return finish(problem, tracks_, near, settings_, random, best.model(), result);
}

Status StereoRansac::onePoint(std::span<const StereoBearings> prev, std::span<const StereoBearings> cur,
                              const Eigen::Quaterniond& R_cur_prev, std::uint64_t seed,
                              RansacResult& result) {
  Problem problem = makeProblem(T_cam1_cam0_, settings_);
  const Status loaded = load(prev, cur, problem, settings_, tracks_, result);
  if (!loaded.ok()) return loaded;
  if (!R_cur_prev.coeffs().allFinite()) return invalid("ransac: the given rotation is not finite");
  problem.R_prior = R_cur_prev.normalized().toRotationMatrix();
  problem.prior_information = 1.0 / (settings_.rotation_sigma * settings_.rotation_sigma);
  Random random(seed);
  const NearTracks near(tracks_);
  makeVotes(problem, settings_.rotation_sigma, near, tracks_);
  Best best(problem, tracks_);
  int needed = near.count < 1 ? 0 : settings_.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    const std::size_t chosen = near.at[random.below(static_cast<std::uint32_t>(near.count))];
    Model model;
    model.R = problem.R_prior;
    model.t = meanOfVotes(near, tracks_, tracks_[chosen]);
    if (!model.t.allFinite() || !best.offer(model)) continue;
    const std::size_t agree = inliersAmong(problem, tracks_, near, best.model());
    needed = samplesNeeded(agree, near.count, 1, settings_.confidence, settings_.max_iterations);
  }
  return finish(problem, tracks_, near, settings_, random, best.model(), result);
}

}  // namespace swiftlet
