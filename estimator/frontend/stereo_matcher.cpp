#include "estimator/frontend/stereo_matcher.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/frontend/lucas_kanade.hpp"
#include "estimator/frontend/search_patch.hpp"
#include "estimator/frontend/warped_patch.hpp"

namespace swiftlet {
namespace {

constexpr int kSearchLevel = 1;
constexpr int kMaxSamples = 256;
constexpr int kMaxStrips = 10;  // on each side of the curve
// Samples below this are not refined. It is lower than the final threshold, because the approximate warp and
// whole-pixel sampling cost some correlation.
constexpr float kMinSearchCorrelation = 0.6F;
// Samples closer than this to the best one belong to its peak [samples].
constexpr int kPeakWidth = 3;
// A rival whose correlation is within the first margin of the best is refined as well, and must then be worse
// by the second margin.
constexpr float kRivalMargin = 0.1F;
constexpr float kAmbiguity = 0.04F;
// Matches with a more negative disparity than this are rejected; smaller values are noise of distant points
// [px].
constexpr double kBeyondInfinity = 0.7;

}  // namespace

StereoMatcher::StereoMatcher(const Rig& rig, const StereoMatcherSettings& settings)
    : rig_(rig), settings_(settings) {
  setExtrinsics(rig.T_body_cam, 0);
}

void StereoMatcher::setExtrinsics(const std::array<SE3, kMaxCameras>& T_body_cam, float slack) {
  rig_.T_body_cam = T_body_cam;
  slack_ = slack;
  const SE3 T_1_0 = rig_.T_cam1_cam0();
  const SE3 T_0_1 = T_1_0.inverse();
  rotation_ = {T_1_0.rotation.toRotationMatrix(), T_0_1.rotation.toRotationMatrix()};
  translation_ = {T_1_0.translation, T_0_1.translation};
}

double StereoMatcher::epipolarDistance(const Eigen::Vector3d& bearing0,
                                       const Eigen::Vector3d& bearing1) const {
  const Eigen::Vector3d normal = (rotation_[0] * bearing0).cross(translation_[0]);
  const double norm = normal.norm();
  // On the baseline itself the bearing lies in every epipolar plane.
  if (!(norm > 1e-9)) return 0;
  return std::abs(bearing1.dot(normal)) / norm * rig_.camera[1].focal();
}

bool StereoMatcher::warpAt(std::size_t from, const Eigen::Vector3d& bearing, double inverse_distance,
                           Eigen::Matrix2f& warp) const {
  Eigen::Vector2d pixel;
  Matrix23d before;
  Matrix23d after;
  const Eigen::Vector3d point = rotation_[from] * bearing + inverse_distance * translation_[from];
  if (!rig_.camera[from].project(bearing, pixel, &before) ||
      !rig_.camera[1 - from].project(point, pixel, &after)) {
    return false;
  }
  warp = pixelWarp(before, rotation_[from], after);
  return true;
}

StereoMatcher::Candidates StereoMatcher::search(const Pyramid& from_image, std::size_t from,
                                                const Eigen::Vector2f& from_pixel,
                                                const Eigen::Vector3d& bearing,
                                                const Pyramid& to_image) const {
  Candidates found;
  const CameraModel& target = rig_.camera[1 - from];
  const Eigen::Vector3d rotated = rotation_[from] * bearing;
  const Eigen::Vector3d& translation = translation_[from];
  const double nearest = 1.0 / settings_.min_depth;
  const double farthest = -static_cast<double>(slack_) / (target.focal() * translation.norm());
  const int level = std::min(kSearchLevel, to_image.levels() - 1);
  const auto scale = static_cast<float>(1 << level);

  Eigen::Matrix2f warp;
  WarpedPatch patch;
  SearchPatch pattern;
  // One warp, for a medium distance, serves the whole search: it changes little between 0.5 m and infinity.
  if (!warpAt(from, bearing, 0.1 * nearest, warp) || !(std::abs(warp.determinant()) > 0.05F)) return found;
  if (!patch.sample(from_image.level(level), from_pixel / scale, warp.inverse(), kPyramidBorder / 2))
    return found;
  if (!pattern.build(patch.centre(), patch.stride())) return found;

  // Length of the curve: from its ends if both project, else the largest number of samples.
  Eigen::Vector2d far_end;
  Eigen::Vector2d near_end;
  int samples = kMaxSamples;
  int strips = 0;  // parallel to the curve, on each side
  Eigen::Vector2f step = Eigen::Vector2f::Zero();
  if (target.project(rotated + farthest * translation, far_end) &&
      target.project(rotated + nearest * translation, near_end)) {
    const Eigen::Vector2d along = near_end - far_end;
    samples = std::clamp(static_cast<int>(along.norm() / scale) + 2, 2, kMaxSamples);
    strips = std::min(static_cast<int>(std::lround(slack_ / scale)), kMaxStrips);
    step = scale * Eigen::Vector2d(-along.y(), along.x()).normalized().cast<float>();
  }
  const auto at = [&](double inverse_distance, const Eigen::Vector2f& aside, Candidate& c) {
    c = Candidate{};
    c.inverse_distance = inverse_distance;
    Eigen::Vector2d pixel;
    if (!target.project(rotated + inverse_distance * translation, pixel)) return;
    c.pixel = pixel.cast<float>() + aside;
    if (!patchInside(to_image.level(0), c.pixel)) return;
    c.correlation =
        pattern.correlation(to_image.level(level), static_cast<int>(std::lround(c.pixel.x() / scale)),
                            static_cast<int>(std::lround(c.pixel.y() / scale)));
  };
  std::array<Candidate, kMaxSamples> sample;
  for (int strip = -strips; strip <= strips; ++strip) {
    int best = 0;
    for (int i = 0; i < samples; ++i) {
      at(farthest + (nearest - farthest) * i / (samples - 1), static_cast<float>(strip) * step,
         sample[static_cast<std::size_t>(i)]);
      if (sample[static_cast<std::size_t>(i)].correlation >
          sample[static_cast<std::size_t>(best)].correlation)
        best = i;
    }
    Candidate rival;
    for (int i = 0; i < samples; ++i) {
      const Candidate& c = sample[static_cast<std::size_t>(i)];
      if (std::abs(i - best) > kPeakWidth && c.correlation > rival.correlation) rival = c;
    }
    found.add(sample[static_cast<std::size_t>(best)], rival, strips > 0 ? scale * kPeakWidth : 0);
  }
  return found;
}

// Merges the candidates of another strip. Those near the best one belong to its peak.
void StereoMatcher::Candidates::add(const Candidate& other_best, const Candidate& other_rival, float peak) {
  Candidate second = other_best;
  if (other_best.correlation > best.correlation) std::swap(best, second);
  for (const Candidate& c : {second, other_rival}) {
    if (c.correlation > rival.correlation && (c.pixel - best.pixel).norm() > peak) rival = c;
  }
}

bool StereoMatcher::refine(const Pyramid& from_image, std::size_t from, const Eigen::Vector2f& from_pixel,
                           const Eigen::Vector3d& bearing, const Pyramid& to_image,
                           Candidate& candidate) const {
  Eigen::Matrix2f warp;
  if (!warpAt(from, bearing, candidate.inverse_distance, warp)) return false;
  const AlignmentLimits limits;
  const int levels = std::min(kSearchLevel + 1, to_image.levels());
  if (!alignWarped(from_image, from_pixel, warp, to_image, levels, limits, PatchTemplate::Finish::kFine,
                   candidate.pixel, &candidate.correlation)) {
    return false;
  }
  if (candidate.correlation < settings_.min_correlation) return false;
  if (!patchInside(to_image.level(0), candidate.pixel)) return false;
  Eigen::Vector3d other;
  if (!rig_.camera[1 - from].unproject(candidate.pixel.cast<double>(), other)) return false;
  const double distance = from == 0 ? epipolarDistance(bearing, other) : epipolarDistance(other, bearing);
  if (distance > static_cast<double>(gate())) return false;
  // Disparity towards the epipole: the displacement from the point at infinity.
  const Eigen::Vector3d at_infinity = rotation_[from] * bearing;
  const Eigen::Vector3d& translation = translation_[from];
  const Eigen::Vector3d along = translation - at_infinity * at_infinity.dot(translation);
  const double norm = along.norm();
  if (norm > 1e-9) {
    const double disparity = (other - at_infinity).dot(along) / norm * rig_.camera[1 - from].focal();
    if (disparity < -kBeyondInfinity - static_cast<double>(slack_)) return false;
  }
  if (settings_.back_check <= 0) return true;
  Eigen::Vector2f back = from_pixel;
  if (!alignWarped(to_image, candidate.pixel, warp.inverse(), from_image, levels, limits,
                   PatchTemplate::Finish::kCoarse, back, nullptr)) {
    return false;
  }
  return (back - from_pixel).squaredNorm() < settings_.back_check * settings_.back_check;
}

bool StereoMatcher::match(const Pyramid& from_image, std::size_t from, const Eigen::Vector2f& from_pixel,
                          const Pyramid& to_image, Eigen::Vector2f& to_pixel) const {
  Eigen::Vector3d bearing;
  if (!rig_.camera[from].unproject(from_pixel.cast<double>(), bearing)) return false;
  Candidates found = search(from_image, from, from_pixel, bearing, to_image);
  if (found.best.correlation < kMinSearchCorrelation) return false;
  const bool has_rival =
      found.rival.correlation > std::max(kMinSearchCorrelation, found.best.correlation - kRivalMargin);
  const bool best_good = refine(from_image, from, from_pixel, bearing, to_image, found.best);
  const bool rival_good = has_rival && refine(from_image, from, from_pixel, bearing, to_image, found.rival);
  if (!best_good && !rival_good) return false;
  if (best_good && rival_good) {
    const bool same = (found.best.pixel - found.rival.pixel).squaredNorm() < 1.0F;
    const float lead = found.best.correlation - found.rival.correlation;
    if (!same && std::abs(lead) < kAmbiguity) return false;
    to_pixel = lead >= 0 ? found.best.pixel : found.rival.pixel;
    return true;
  }
  to_pixel = best_good ? found.best.pixel : found.rival.pixel;
  return true;
}

}  // namespace swiftlet
