#include "estimator/odometry/image_stillness.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Rotors that spin up on the ground shake the image by up to 2 mrad (EuRoC V1_01).
constexpr double kMoved = 3e-3;      // rad
constexpr double kLeastMoved = 0.5;  // px; noise of a median is about 0.1
constexpr double kFlowNoise = 0.1;   // px
// Of the line of sight.
constexpr double kStillRate = 0.4e-3;  // rad/s
constexpr double kSlowRate = 5e-3;     // rad/s
constexpr std::size_t kQuadrantTracks = 5;

float median(FixedVector<float, kMaxFeatures>& values) {
  float* const middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool before(const TrackedFeature& a, const TrackedFeature& b) { return a.id < b.id; }

}  // namespace

void ImageStillness::takeReference(const TrackedFrame& frame) {
  reference_ = frame.features;
  if (!std::is_sorted(reference_.begin(), reference_.end(), before)) {
    std::sort(reference_.begin(), reference_.end(), before);
  }
  since_ = frame.stamp;
}

double ImageStillness::moved(const TrackedFrame& frame, std::size_t c) {
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
  FixedVector<double, 4> moved;
  for (Motions& motions : quadrants_) {
    if (motions.x.size() >= kQuadrantTracks) moved.pushBack(std::hypot(median(motions.x), median(motions.y)));
  }
  if (moved.size() < 2) return -1;
  std::sort(moved.begin(), moved.end());
  return moved[moved.size() - 2];
}

ImageMotion ImageStillness::update(const TrackedFrame& frame) {
  if (frame.features.size() < 2 * kQuadrantTracks) {
    reference_.clear();
    return ImageMotion::kUnknown;
  }
  const std::size_t c = frame.camera_present[0] ? 0 : 1;
  const double pixels = moved(frame, c);
  if (pixels < 0) {
    takeReference(frame);
    return ImageMotion::kUncertain;
  }
  if (pixels >= std::max(kLeastMoved, kMoved * rig_.camera[c].focal())) {
    takeReference(frame);
    return ImageMotion::kMoving;
  }
  const double seconds = (frame.stamp - since_).seconds();
  const double turned = (pixels + kFlowNoise) / rig_.camera[c].focal();
  if (turned < kStillRate * seconds) return ImageMotion::kStill;
  return turned < kSlowRate * seconds ? ImageMotion::kSlow : ImageMotion::kUncertain;
}

}  // namespace swiftlet
