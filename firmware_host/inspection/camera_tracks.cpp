#include "firmware_host/inspection/camera_tracks.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"
#include "estimator/frontend/lucas_kanade.hpp"

namespace swiftlet {
namespace {

constexpr int kLevels = 4;
constexpr int kTracks = 120;
// Brightness is compared at a pyramid level whose pixels average about 6 x 6 pixels.
constexpr int kLightLevel = 2;
// Grey levels between which a camera's response to light is roughly linear.
constexpr float kDark = 16;
constexpr float kBright = 240;

float median(std::vector<float>& values) { return values.empty() ? 0 : medianOf(values); }

float greyAt(const Pyramid& pyramid, const Eigen::Vector2f& pixel) {
  const int level = std::min(kLightLevel, pyramid.levels() - 1);
  const ImageView& image = pyramid.level(level);
  const auto scale = static_cast<float>(1 << level);
  const int x = std::clamp(static_cast<int>(std::lround(pixel.x() / scale)), 0, image.width - 1);
  const int y = std::clamp(static_cast<int>(std::lround(pixel.y() / scale)), 0, image.height - 1);
  return static_cast<float>(image.row(y)[x]);
}

}  // namespace

void CameraTracks::add(Stamp stamp, const ImageView& view, bool follows) {
  if (pyramid_.empty()) {
    for (int i = 0; i < 2; ++i) pyramid_.emplace_back(view.width, view.height, kLevels);
    detector_.emplace_back(view.width, view.height);
  }
  newest_ = 1 - newest_;
  pyramid_[newest_].build(view);
  TrackedImage image;
  image.stamp = stamp;
  image.follows = follows && !images_.empty();
  if (image.follows) follow(image);
  fill(image);
  images_.push_back(std::move(image));
}

void CameraTracks::follow(TrackedImage& image) {
  const LucasKanadeSettings settings;
  const Pyramid& before = pyramid_[1 - newest_];
  const Pyramid& now = pyramid_[newest_];
  std::vector<float> flow;
  std::vector<float> x;
  std::vector<float> y;
  std::vector<float> light;
  for (const TrackedPoint& seen : images_.back().points) {
    Eigen::Vector2f pixel = seen.pixel + drift_;
    if (!trackPoint(before, seen.pixel, now, settings, pixel) || !patchInside(now.level(0), pixel)) continue;
    image.points.push_back({seen.track, pixel});
    const Eigen::Vector2f step = pixel - seen.pixel;
    flow.push_back(step.norm());
    x.push_back(step.x());
    y.push_back(step.y());
    const float was = greyAt(before, seen.pixel);
    const float is = greyAt(now, pixel);
    if (std::min(was, is) > kDark && std::max(was, is) < kBright) light.push_back(is / was);
  }
  image.kept = image.points.size();
  image.flow = median(flow);
  constexpr std::size_t kFewest = 10;
  if (light.size() >= kFewest) image.light = median(light);
  drift_ = flow.size() < kFewest ? Eigen::Vector2f::Zero().eval() : Eigen::Vector2f(median(x), median(y));
}

void CameraTracks::fill(TrackedImage& image) {
  CornerDetector::Pixels occupied;
  for (const TrackedPoint& seen : image.points) occupied.pushBack(seen.pixel);
  const int wanted = kTracks - static_cast<int>(occupied.size());
  if (wanted <= 0) return;
  FixedVector<Corner, kMaxFeatures> corners;
  const ImageView& view = pyramid_[newest_].level(0);
  detector_.front().detect(view, occupied, kTracks, wanted, CornerSettings{}, corners);
  for (const Corner& corner : corners) {
    if (patchInside(view, corner.pixel)) image.points.push_back({next_track_++, corner.pixel});
  }
}

std::vector<TrackPair> commonTracks(const TrackedImage& from, const TrackedImage& to) {
  std::vector<TrackPair> pairs;
  std::size_t i = 0;
  for (const TrackedPoint& seen : to.points) {
    while (i < from.points.size() && from.points[i].track < seen.track) ++i;
    if (i == from.points.size()) break;
    if (from.points[i].track == seen.track) {
      pairs.push_back({from.points[i].pixel.cast<double>(), seen.pixel.cast<double>()});
    }
  }
  return pairs;
}

}  // namespace swiftlet
