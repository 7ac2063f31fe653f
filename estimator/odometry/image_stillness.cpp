#include "estimator/odometry/image_stillness.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

// Rotors that spin up on the ground shake the image by up to 2 mrad (EuRoC V1_01).
constexpr double kMoved = 3e-3;      // rad
constexpr double kLeastMoved = 0.5;  // px; noise of a median is about 0.1
constexpr double kFlowNoise = 0.1;   // px
// Rates of the line of sight.
constexpr double kStillRate = 0.4e-3;  // rad/s
constexpr double kSlowRate = 5e-3;     // rad/s
// An image that drifts while it shakes passes its reference position, but only for less than this time.
constexpr double kStillTime = 0.25;  // s
// Reduces shaking by rotors (above 5 Hz) to a fifteenth. The reference is shaken too, so the filtered value
// is compared with its own value after settling.
constexpr double kLowPass = 0.5;  // s
constexpr double kSettled = 1.0;  // s after the reference
constexpr std::size_t kQuadrantTracks = 5;

bool before(const TrackedFeature& a, const TrackedFeature& b) { return a.id < b.id; }

}  // namespace

void ImageStillness::takeReference(const TrackedFrame& frame) {
  reference_ = frame.features;
  if (!std::is_sorted(reference_.begin(), reference_.end(), before)) {
    std::sort(reference_.begin(), reference_.end(), before);
  }
  since_ = frame.stamp;
  last_not_still_ = frame.stamp;
  last_ = frame.stamp;
  means_.fill(Eigen::Vector2d::Zero());
  settled_ = means_;
}

ImageStillness::Moved ImageStillness::moved(const TrackedFrame& frame, std::size_t c) {
  for (Motions& quadrant : quadrants_) quadrant = {};
  const float middle_x = 0.5F * static_cast<float>(rig_.camera[c].width());
  const float middle_y = 0.5F * static_cast<float>(rig_.camera[c].height());
  for (const TrackedFeature& feature : frame.features) {
    if (!feature.seen[c]) continue;
    const auto* const reference = std::lower_bound(reference_.begin(), reference_.end(), feature, before);
    if (reference == reference_.end() || reference->id != feature.id || !reference->seen[c]) continue;
    const Eigen::Vector2f& then = reference->pixel[c];
    Motions& motions = quadrants_[(then.x() > middle_x ? 1U : 0U) + (then.y() > middle_y ? 2U : 0U)];
    motions.x.pushBack(feature.pixel[c].x() - then.x());
    motions.y.pushBack(feature.pixel[c].y() - then.y());
  }
  const double share = 1 - std::exp(-(frame.stamp - last_).seconds() / kLowPass);
  last_ = frame.stamp;
  const bool settling = (frame.stamp - since_).seconds() <= kSettled;
  FixedVector<double, 4> now;
  FixedVector<double, 4> drift;
  for (std::size_t q = 0; q < quadrants_.size(); ++q) {
    Motions& motions = quadrants_[q];
    if (motions.x.size() < kQuadrantTracks) continue;
    const Eigen::Vector2d motion(medianOf(motions.x), medianOf(motions.y));
    means_[q] += share * (motion - means_[q]);
    if (settling) settled_[q] = means_[q];
    now.pushBack(motion.norm());
    drift.pushBack((means_[q] - settled_[q]).norm());
  }
  if (now.size() < 2) return {};
  std::sort(now.begin(), now.end());
  std::sort(drift.begin(), drift.end());
  return {now[now.size() - 2], drift[drift.size() - 2]};
}

ImageMotion ImageStillness::update(const TrackedFrame& frame) {
  if (frame.features.size() < 2 * kQuadrantTracks) {
    reference_.clear();
    return ImageMotion::kUnknown;
  }
  const std::size_t c = frame.camera_present[0] ? 0 : 1;
  const Moved pixels = moved(frame, c);
  if (pixels.now < 0) {
    takeReference(frame);
    return ImageMotion::kUncertain;
  }
  if (pixels.now >= std::max(kLeastMoved, kMoved * rig_.camera[c].focal())) {
    takeReference(frame);
    return ImageMotion::kMoving;
  }
  const double seconds = (frame.stamp - since_).seconds();
  const double focal = rig_.camera[c].focal();
  const double turned = (pixels.now + kFlowNoise) / focal;
  if (turned >= kStillRate * seconds) last_not_still_ = frame.stamp;
  if ((frame.stamp - last_not_still_).seconds() > kStillTime) return ImageMotion::kStill;
  const double drifted = (pixels.drift + kFlowNoise) / focal;
  if (drifted < kStillRate * (seconds - kSettled)) return ImageMotion::kInPlace;
  return turned < kSlowRate * seconds ? ImageMotion::kSlow : ImageMotion::kUncertain;
}

}  // namespace swiftlet
