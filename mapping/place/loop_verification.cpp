#include "mapping/place/loop_verification.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"
#include "mapping/place/hamming.hpp"

namespace swiftlet {
namespace {

// Rounds of inlier selection and refinement.
constexpr int kRefineRounds = 3;
// Factor on the chi-square gates of the first round, because the initial pose is rough.
constexpr double kFirstRoundWidening = 4.0;
// Factor on the chi-square gate of guided matches over that of inliers, because the pose will still move.
constexpr double kGuidedWidening = 2.0;
// Weight of the configured noise [degrees of freedom] against that of the residuals, for the scale of the
// covariance: with few matches it stays near 1.
constexpr double kScaleDof = 20.0;
// Least scale of the covariance, because matches have common errors.
constexpr double kMinScale = 0.5;
// Largest ratio of noise variance to the configured one: twice its sigma.
constexpr double kMaxNoiseScale = 4.0;
constexpr std::uint16_t kFar = 512;

bool finite(const PlaceKeyframe& keyframe) {
  for (const PlaceFeature& f : keyframe.features) {
    if (!f.pixel.allFinite() || !f.bearing.allFinite() || !std::isfinite(f.inverse_depth) ||
        !std::isfinite(f.inverse_depth_sigma)) {
      return false;
    }
  }
  return true;
}

// Narrowest spread of directions about their mean [rad]: the square root of the middle eigenvalue of their
// scatter. The smallest one belongs to the viewing direction.
double narrowestSpread(const MatchedPoints& points, bool old_side) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double count = 0;
  for (const MatchedPoint& m : points) {
    if (!m.used) continue;
    const Eigen::Vector3d& b = old_side ? m.old_view.bearing : m.new_view.bearing;
    mean += b;
    scatter += b * b.transpose();
    count += 1;
  }
  if (!(count > 0)) return 0;
  mean /= count;
  const Eigen::Matrix3d covariance = scatter / count - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[1]));
}

// Ratio of the used residuals' variance to the configured one, from their median; 1 to kMaxNoiseScale. Gates
// are scaled by it, because otherwise they would cut off noise larger than configured and hide it.
double noiseScale(const MatchedPoints& points) {
  constexpr std::array<double, 3> kMedians = {0.455, 1.386,
                                              2.366};  // of chi-square, 1 to 3 degrees of freedom
  FixedVector<double, kMaxPlaceFeatures> ratios;
  for (const MatchedPoint& m : points) {
    if (m.used) (void)ratios.tryPushBack(m.chi_squared / kMedians[static_cast<std::size_t>(m.dof() - 1)]);
  }
  if (ratios.empty()) return 1.0;
  return std::clamp(medianOf(ratios), 1.0, kMaxNoiseScale);
}

double medianDistance(const MatchedPoints& points) {
  FixedVector<double, kMaxPlaceFeatures> inverse;
  for (const MatchedPoint& m : points) {
    if (m.used) (void)inverse.tryPushBack(m.inverse_depth);
  }
  if (inverse.empty()) return 0;
  const double middle = medianOf(inverse);
  return middle > 0 ? 1.0 / middle : 0;
}

double largestSigma(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

}  // namespace

const char* describe(LoopFate fate) {
  switch (fate) {
    case LoopFate::kAccepted:
      return "accepted";
    case LoopFate::kInvalidInput:
      return "invalid input";
    case LoopFate::kTooFewMatches:
      return "too few matches";
    case LoopFate::kTooFewDepths:
      return "too few depths";
    case LoopFate::kNoConsensus:
      return "no consensus";
    case LoopFate::kTooFewInliers:
      return "too few inliers";
    case LoopFate::kLowShare:
      return "low share of matches";
    case LoopFate::kPoorSpread:
      return "poor spread";
    case LoopFate::kPoorFit:
      return "poor fit";
    case LoopFate::kIllConditioned:
      return "ill-conditioned";
    case LoopFate::kTooFar:
      return "too far apart";
    case LoopFate::kFragile:
      return "fragile";
  }
  return "";
}

bool LoopVerificationSettings::valid() const {
  return matching.max_distance >= 0 && matching.ratio > 0 && consensus.iterations > 0 &&
         consensus.five_point_iterations > 0 && consensus.confidence > 0 && consensus.confidence < 1 &&
         refinement.steps > 0 && refinement.huber > 0 && pixel_sigma > 0 && octave_scale >= 1 &&
         min_matches >= 3 && min_inliers >= 3;
}

LoopVerifier::LoopVerifier(const Rig& rig, const LoopVerificationSettings& settings)
    : settings_(settings),
      camera_(rig.camera[0]),
      T_body_cam_(rig.T_body_cam[0]),
      consensus_(settings.consensus) {}

PointView LoopVerifier::viewOf(const PlaceFeature& feature) const {
  PointView view;
  view.bearing = feature.bearing.cast<double>().normalized();
  view.bearing_sigma = settings_.pixel_sigma *
                       std::pow(settings_.octave_scale, static_cast<double>(feature.octave)) /
                       camera_.focal();
  if (feature.inverse_depth_sigma > 0 && feature.inverse_depth != 0.0F) {
    view.inverse_depth = feature.inverse_depth;
    view.inverse_depth_sigma = feature.inverse_depth_sigma;
  }
  return view;
}

void LoopVerifier::loadPoints() {
  points_.clear();
  for (const DescriptorMatch& match : matches_) {
    MatchedPoint m;
    m.old_view = old_views_[match.old_feature];
    m.new_view = new_views_[match.new_feature];
    (void)points_.tryPushBack(m);
  }
}

LoopFate LoopVerifier::consent(const LoopPrior& prior, LoopVerification& result) {
  const std::uint64_t seed = result.new_index * 0x9E3779B97F4A7C15ULL + result.old_index;
  const std::span<MatchedPoint> points(points_.data(), points_.size());
  ConsensusResult found;
  Status status = consensus_.threePoint(points, seed, found);
  result.samples = found.iterations;
  if (!status.ok() && prior.R_old_new) {
    const Eigen::Quaterniond R_cam =
        T_body_cam_.rotation.conjugate() * *prior.R_old_new * T_body_cam_.rotation;
    status = consensus_.onePoint(points, R_cam, seed, found);
    result.samples += found.iterations;
  }
  const bool few_depths = 2 * result.matches_with_depth < result.matches;
  if (!status.ok() && settings_.five_point && few_depths) {
    status = consensus_.fivePoint(points, seed, found);
    result.samples += found.iterations;
  }
  result.consensus = found.inliers;
  if (!status.ok() || found.inliers < settings_.min_consensus) return LoopFate::kNoConsensus;
  T_cam_ = found.T_old_new;
  return LoopFate::kAccepted;
}

Status LoopVerifier::refine(LoopVerification& result) {
  const std::span<MatchedPoint> points(points_.data(), points_.size());
  noise_scale_ = 1.0;
  for (int round = 0; round < kRefineRounds; ++round) {
    placePoints(T_cam_, points);
    const double widening = round == 0 ? kFirstRoundWidening : noise_scale_;
    for (MatchedPoint& m : points_) m.used = m.chi_squared < widening * matchGate(m.dof());
    const Status status = refineRelativePose(settings_.refinement, points, T_cam_, fit_);
    if (!status.ok()) return status;
    if (round == 0) noise_scale_ = noiseScale(points_);
  }
  for (MatchedPoint& m : points_) m.used = m.chi_squared < noise_scale_ * matchGate(m.dof());
  const SE3 T_old_new = T_body_cam_ * T_cam_ * T_body_cam_.inverse();
  result.T_old_new = T_old_new;
  // The scale of the residuals, drawn towards that of the configured noise.
  const double scale = (fit_.chi_squared + kScaleDof) / (std::max(fit_.dof, 0.0) + kScaleDof);
  result.chi_squared_per_dof = fit_.dof > 0 ? fit_.chi_squared / fit_.dof : 0;
  const Matrix6d covariance = std::max(scale, kMinScale) * fit_.information.inverse();
  result.covariance = covarianceOfBody(T_body_cam_, covariance);
  return okStatus();
}

void LoopVerifier::offerGuided(std::size_t i, std::size_t j, int distance,
                               const PlaceKeyframe& new_keyframe) {
  const auto d = static_cast<std::uint16_t>(distance);
  const auto better = [](Guided& mine, std::uint16_t bits, std::size_t partner, bool same_spot) {
    if (bits < mine.distance) {
      if (!same_spot) mine.next = mine.distance;
      mine.distance = bits;
      mine.partner = static_cast<std::uint16_t>(partner);
    } else if (!same_spot) {
      mine.next = std::min(mine.next, bits);
    }
  };
  const bool known = guided_old_[i].distance < kFar;
  const Eigen::Vector2f& spot = new_keyframe.features[j].pixel;
  const bool same = known && (new_keyframe.features[guided_old_[i].partner].pixel - spot).norm() <
                                 settings_.matching.same_spot;
  better(guided_old_[i], d, j, same);
  better(guided_new_[j], d, i, false);
}

void LoopVerifier::matchGuided(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe) {
  const std::size_t old_count = old_keyframe.features.size();
  const std::size_t new_count = new_keyframe.features.size();
  guided_old_.fill({kFar, kFar, 0});
  guided_new_.fill({kFar, kFar, 0});
  const Eigen::Matrix3d R_on = T_cam_.R();
  const SE3 inverse = T_cam_.inverse();
  const Eigen::Matrix3d R_no = inverse.R();
  const double reach = std::cos(settings_.guided_reach / camera_.focal());
  const double gate = kGuidedWidening * noise_scale_ * matchGate(2);
  for (std::size_t i = 0; i < old_count; ++i) {
    const PointView& o = old_views_[i];
    const Eigen::Vector3d seen = (R_no * o.bearing + o.inverse_depth * inverse.translation).normalized();
    for (std::size_t j = 0; j < new_count; ++j) {
      const PointView& n = new_views_[j];
      if (o.hasDepth()) {
        if (seen.dot(n.bearing) < reach) continue;
      } else if (!n.hasDepth() ||
                 (R_on * n.bearing + n.inverse_depth * T_cam_.translation).normalized().dot(o.bearing) <
                     reach) {
        continue;
      }
      const int distance =
          hammingDistance(old_keyframe.features[i].descriptor, new_keyframe.features[j].descriptor);
      if (distance > settings_.guided_distance) continue;
      if (o.hasDepth() && !(oneWayError(R_no, inverse.translation, o, n) < gate)) continue;
      if (n.hasDepth() && !(oneWayError(R_on, T_cam_.translation, n, o) < gate)) continue;
      offerGuided(i, j, distance, new_keyframe);
    }
  }
  matches_.clear();
  for (std::size_t i = 0; i < old_count; ++i) {
    const Guided& g = guided_old_[i];
    if (g.distance >= kFar || guided_new_[g.partner].partner != i) continue;
    if (static_cast<float>(g.distance) >= settings_.guided_ratio * static_cast<float>(g.next)) continue;
    (void)matches_.tryPushBack({static_cast<std::uint16_t>(i), g.partner, g.distance});
  }
}

std::size_t LoopVerifier::countKept() const {
  std::size_t kept = 0;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (!points_[m].used) continue;
    for (const DescriptorMatch& first : first_matches_) {
      if (first.old_feature == matches_[m].old_feature && first.new_feature == matches_[m].new_feature)
        ++kept;
    }
  }
  return kept;
}

LoopFate LoopVerifier::judge(LoopVerification& result) {
  result.inliers.clear();
  for (std::size_t m = 0; m < points_.size(); ++m) {
    if (points_[m].used) (void)result.inliers.tryPushBack(matches_[m]);
  }
  result.spread = std::min(narrowestSpread(points_, true), narrowestSpread(points_, false));
  const auto share = static_cast<double>(result.kept) / static_cast<double>(result.matches);
  if (result.inliers.size() < settings_.min_inliers || result.kept < settings_.min_kept) {
    return LoopFate::kTooFewInliers;
  }
  if (!(share >= settings_.min_kept_share)) return LoopFate::kLowShare;
  const bool many = result.kept >= settings_.many_kept;
  if (!(result.spread >= (many ? settings_.min_spread_of_many : settings_.min_spread))) {
    return LoopFate::kPoorSpread;
  }
  if (!(result.chi_squared_per_dof <= settings_.max_chi_squared_per_dof)) return LoopFate::kPoorFit;
  const double far =
      std::max(settings_.max_translation_sigma, settings_.max_relative_sigma * medianDistance(points_));
  if (!(largestSigma(result.covariance.topLeftCorner<3, 3>()) <= settings_.max_rotation_sigma) ||
      !(largestSigma(result.covariance.bottomRightCorner<3, 3>()) <= far)) {
    return LoopFate::kIllConditioned;
  }
  if (!(result.T_old_new.translation.norm() <= settings_.max_distance)) return LoopFate::kTooFar;
  result.support = relativePoseSupport(settings_.refinement, {points_.data(), points_.size()}, T_cam_,
                                       settings_.support_reach);
  if (!(result.support.rotation_shift <= settings_.max_rotation_shift) ||
      !(result.support.translation_shift <= far)) {
    return LoopFate::kFragile;
  }
  return LoopFate::kAccepted;
}

LoopFate LoopVerifier::run(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe,
                           const LoopPrior& prior, LoopVerification& result) {
  if (!finite(old_keyframe) || !finite(new_keyframe)) return LoopFate::kInvalidInput;
  (void)matcher_.match(old_keyframe.features, new_keyframe.features, settings_.matching, matches_);
  result.matches = matches_.size();
  if (result.matches < settings_.min_matches) return LoopFate::kTooFewMatches;
  // The consensus expects the best matches first.
  std::sort(matches_.begin(), matches_.end(), [](const DescriptorMatch& a, const DescriptorMatch& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.old_feature < b.old_feature;
  });
  for (std::size_t i = 0; i < old_keyframe.features.size(); ++i)
    old_views_[i] = viewOf(old_keyframe.features[i]);
  for (std::size_t i = 0; i < new_keyframe.features.size(); ++i)
    new_views_[i] = viewOf(new_keyframe.features[i]);
  first_matches_ = matches_;
  loadPoints();
  for (const MatchedPoint& m : points_) {
    if (m.old_view.hasDepth() || m.new_view.hasDepth()) ++result.matches_with_depth;
  }
  if (result.matches_with_depth < settings_.min_depths) return LoopFate::kTooFewDepths;
  const LoopFate consented = consent(prior, result);
  if (consented != LoopFate::kAccepted) return consented;
  if (!refine(result).ok()) return LoopFate::kIllConditioned;
  matchGuided(old_keyframe, new_keyframe);
  loadPoints();
  if (!refine(result).ok()) return LoopFate::kTooFewInliers;
  result.kept = countKept();
  return judge(result);
}

Status LoopVerifier::verify(const PlaceKeyframe& old_keyframe, const PlaceKeyframe& new_keyframe,
                            const LoopPrior& prior, double effort, LoopVerification& result) {
  result = LoopVerification{};
  result.old_index = old_keyframe.index;
  result.new_index = new_keyframe.index;
  if (!settings_.valid() || !(effort > 0)) {
    return {StatusCode::kInvalidInput, "loop verification: a setting or the effort is out of range"};
  }
  ConsensusSettings consensus = settings_.consensus;
  consensus.min_inliers = settings_.min_consensus;
  const double part = std::min(effort, 1.0);
  consensus.iterations = std::max(1, static_cast<int>(part * consensus.iterations));
  consensus.five_point_iterations = std::max(1, static_cast<int>(part * consensus.five_point_iterations));
  consensus_.setSettings(consensus);
  result.fate = run(old_keyframe, new_keyframe, prior, result);
  return okStatus();
}

}  // namespace swiftlet
