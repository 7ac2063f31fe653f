#include "estimator/frontend/frontend.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/frontend/frontend_impl.hpp"

namespace swiftlet {
namespace {

// Features of a camera whose image is missing are held this long. Slow cameras need more: one lost image, and
// the next one late by half an interval. At 1 rad/s and 450 px the view moves by a fifth of the image in 250
// ms. Features that left the view are lost one by one anyway; the limit only saves searches in a view that
// has changed.
constexpr Duration kMinHold = Duration::fromMilliseconds(250);
constexpr double kHeldIntervals = 2.5;
// Error of the estimated extrinsics, in sigmas, that is allowed in the distance of stereo matches from the
// epipolar curve.
constexpr double kExtrinsicSigmas = 3.0;
// Below this share of the wanted features, new ones are detected without waiting for a keyframe.
constexpr float kReplenishShare = 0.6F;
// If a feature is not found in the other camera, the next attempt is at the next keyframe, and after each
// further failure one keyframe later, up to this many: most such features are out of the other camera's view.
constexpr int kMaxMatchWait = 3;
// An image is dark if its mean is below this level and it has almost no features.
constexpr float kDarkMean = 12.0F;
constexpr int kDarkFeatures = 10;

}  // namespace

Frontend::Impl::Impl(const Rig& rig, const FrontendSettings& settings)
    : rig_(rig),
      settings_(settings),
      matcher_(rig, {.min_depth = settings.min_depth,
                     .epipolar_gate = settings.stereo_gate,
                     .back_check = settings.back_check}) {
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    const CameraModel& model = rig_.camera[c];
    for (Pyramid& pyramid : camera_[c].pyramid) {
      pyramid = Pyramid(model.width(), model.height(), settings.pyramid_levels);
    }
    detector_.emplace_back(model.width(), model.height());
  }
}

void Frontend::Impl::reset() {
  tracks_.clear();
  anchors_.clear();
  has_keyframe_ = false;
  for (Camera& camera : camera_) {
    camera.has_history = false;
    camera.present = false;
    camera.seen = false;
  }
}

Status Frontend::Impl::check(const StereoFrame& frame) const {
  bool any = false;
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    if (!frame.has(c)) continue;
    any = true;
    const ImageView& image = frame.image[c];
    if (image.width != rig_.camera[c].width() || image.height != rig_.camera[c].height() ||
        image.stride < image.width) {
      return {StatusCode::kInvalidInput, "image size differs from the calibration's: frame rejected"};
    }
  }
  if (!any) return {StatusCode::kInvalidInput, "frame without images rejected"};
  return okStatus();
}

void Frontend::Impl::takeExtrinsics(const FrontendPrediction& prediction) {
  if (!usesStereo() || !prediction.has_extrinsics) return;
  rig_.T_body_cam = prediction.T_body_cam;
  const double slack = kExtrinsicSigmas * prediction.stereo_rotation_sigma * rig_.camera[1].focal();
  matcher_.setExtrinsics(rig_.T_body_cam, static_cast<float>(slack));
}

void Frontend::Impl::takeImages(const StereoFrame& frame, const FrontendPrediction& prediction) {
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    Camera& camera = camera_[c];
    const bool was_present = camera.present;
    // Rotation since this camera's newest image: starts anew if that was in the previous frame.
    if (was_present) {
      camera.R_prev_cur.setIdentity();
      camera.rotation_known = true;
    }
    camera.rotation_known = camera.rotation_known && prediction.has_rotation;
    if (prediction.has_rotation) {
      const Eigen::Quaterniond& q = rig_.T_body_cam[c].rotation;
      camera.R_prev_cur = camera.R_prev_cur * (q.conjugate() * prediction.R_body_prev_body_cur * q);
      camera.R_cur_prev = camera.R_prev_cur.conjugate().toRotationMatrix();
    }
    camera.present = frame.has(c);
    const Duration hold =
        std::max(kMinHold, Duration::fromSeconds(kHeldIntervals * camera.interval.get().seconds()));
    if (camera.has_history && frame.stamp - camera.last > hold) {
      camera.has_history = false;
      for (Track& track : tracks_) track.live[c] = false;
    }
    if (!camera.present) continue;
    camera.newest = 1 - camera.newest;
    camera.scan_before = camera.scan;
    camera.scan = prediction.scan;
    camera.pyramid[camera.newest].build(frame.image[c]);
    if (camera.seen) camera.interval.add(frame.stamp - camera.last);
    camera.seen = true;
    camera.last = frame.stamp;
  }
  if (prediction.has_rotation) {
    R_keyframe_cur_ = R_keyframe_cur_ * prediction.R_body_prev_body_cur;
  } else {
    keyframe_rotation_known_ = false;
  }
}

bool Frontend::Impl::place(Track& track, std::size_t c, const Eigen::Vector2f& pixel) {
  Eigen::Vector3d bearing;
  if (!rig_.camera[c].unproject(pixel.cast<double>(), bearing)) return false;
  track.pixel[c] = pixel;
  track.bearing[c] = bearing;
  track.live[c] = true;
  return true;
}

void Frontend::Impl::dropLost() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const Track& track = tracks_[i];
    if (track.live[0] || track.live[1]) {
      if (kept != i) tracks_[kept] = track;
      ++kept;
    } else {
      anchors_[track.slot].tracked = false;
    }
  }
  tracks_.resize(kept);
}

void Frontend::Impl::darkImages() {
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    if (!camera_[c].present) continue;
    int features = 0;
    for (const Track& track : tracks_) features += track.live[c] ? 1 : 0;
    if (features >= kDarkFeatures) continue;
    // The coarsest level serves as a small mean image.
    const Pyramid& pyramid = camera_[c].now();
    const ImageView& small = pyramid.level(pyramid.levels() - 1);
    std::int64_t sum = 0;
    for (int y = 0; y < small.height; ++y) {
      for (int x = 0; x < small.width; ++x) sum += small.row(y)[x];
    }
    const auto pixels = static_cast<float>(small.width * small.height);
    if (static_cast<float>(sum) / pixels > kDarkMean) continue;
    camera_[c].present = false;
    camera_[c].has_history = false;
    for (Track& track : tracks_) track.live[c] = false;
  }
}

void Frontend::Impl::replenish(int max_features) {
  const int wanted = max_features - static_cast<int>(tracks_.size());
  if (wanted <= 0) return;
  if (camera_[0].present) {
    detect(0, wanted, max_features);
  } else if (usesStereo() && camera_[1].present) {
    detect(1, wanted, max_features);
  }
}

void Frontend::Impl::detect(std::size_t c, int wanted, int max_features) {
  occupied_.clear();
  for (const Track& track : tracks_) {
    if (track.live[c]) occupied_.pushBack(track.pixel[c]);
  }
  CornerSettings corner_settings;
  corner_settings.min_distance = settings_.min_distance;
  detector_[c].detect(camera_[c].now().level(0), occupied_, max_features, wanted, corner_settings, corners_);
  for (const Corner& corner : corners_) {
    if (tracks_.full()) return;
    Track track;
    if (!place(track, c, corner.pixel)) continue;
    track.id = next_id_++;
    track.slot = anchors_.acquire(track.id);
    anchors_[track.slot].patch[c].take(camera_[c].now(), corner.pixel);
    tracks_.pushBack(track);
    ++statistics_.detected;
  }
}

void Frontend::Impl::matchMissing(bool only_new) {
  if (!usesStereo() || !camera_[0].present || !camera_[1].present) return;
  for (Track& track : tracks_) {
    if (track.live[0] == track.live[1] || (only_new && track.age > 0)) continue;
    const std::size_t from = track.live[0] ? 0 : 1;
    const std::size_t to = 1 - from;
    if (track.match_wait > 0) {
      --track.match_wait;
      continue;
    }
    Eigen::Vector2f pixel;
    if (!matcher_.match(camera_[from].now(), from, track.pixel[from], camera_[to].now(), pixel) ||
        !place(track, to, pixel)) {
      ++statistics_.match_failed;
      track.match_wait = std::min(track.unmatched++, kMaxMatchWait);
      continue;
    }
    track.unmatched = 0;
    track.had_previous[to] = false;
    track.in_keyframe[to] = false;
    anchors_[track.slot].patch[to].take(camera_[to].now(), pixel);
    ++statistics_.matched;
  }
}

void Frontend::Impl::write(const StereoFrame& frame, bool keyframe, TrackedFrame& out) {
  out.stamp = frame.stamp;
  out.index = frame.index;
  out.keyframe = keyframe;
  out.features.clear();
  for (std::size_t c = 0; c < kMaxCameras; ++c) out.camera_present[c] = camera_[c].present;
  for (Track& track : tracks_) {
    TrackedFeature feature;
    feature.id = track.id;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      feature.seen[c] = camera_[c].present && track.live[c];
      feature.pixel[c] = track.pixel[c];
    }
    anchors_[track.slot].last_seen = frame.index;
    ++track.age;
    if (feature.seen[0] || feature.seen[1]) out.features.pushBack(feature);
  }
}

Status Frontend::Impl::step(const StereoFrame& frame, const FrontendPrediction& prediction, int max_features,
                            TrackedFrame& out) {
  if (const Status status = check(frame); !status.ok()) return status;
  const int limit = std::clamp(max_features, 0, static_cast<int>(kMaxFeatures));
  statistics_ = {};
  lost_.clear();
  takeExtrinsics(prediction);
  takeImages(frame, prediction);
  joinPredictions(prediction);
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    if (!camera_[c].present) continue;
    trackCamera(c, prediction);
    verifyMotion(c, frame.index * kMaxCameras + c);
  }
  verifyStereo();
  if (settings_.find_again) findAgain(prediction, limit);
  dropLost();
  const bool keyframe = keyframeDue(frame.stamp);
  const bool few = static_cast<float>(tracks_.size()) < kReplenishShare * static_cast<float>(limit);
  if (keyframe || few) {
    replenish(limit);
    matchMissing(!keyframe);
  }
  darkImages();
  dropLost();
  if (keyframe) markKeyframe(frame.stamp);
  write(frame, keyframe, out);
  for (Camera& camera : camera_) {
    if (camera.present) camera.has_history = true;
  }
  return okStatus();
}

Frontend::Frontend(const Rig& rig, const FrontendSettings& settings)
    : impl_(std::make_unique<Impl>(rig, settings)) {}
Frontend::~Frontend() = default;
Frontend::Frontend(Frontend&&) noexcept = default;
Frontend& Frontend::operator=(Frontend&&) noexcept = default;

Status Frontend::step(const StereoFrame& frame, const FrontendPrediction& prediction, int max_features,
                      TrackedFrame& out) {
  return impl_->step(frame, prediction, max_features, out);
}
const FrontendStatistics& Frontend::statistics() const { return impl_->statistics(); }
const LostSightings& Frontend::lost() const { return impl_->lost(); }
void Frontend::reset() { impl_->reset(); }

}  // namespace swiftlet
