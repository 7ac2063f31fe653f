// Frontend::Impl: tracks features from frame to frame, verifies them, and finds lost ones.

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/frontend/frontend_impl.hpp"
#include "estimator/frontend/warped_patch.hpp"

namespace swiftlet {
namespace {

// With a predicted landmark the error is a few pixels: two levels cover 12 px.
constexpr int kLevelsWithLandmark = 2;
// With rotation removed only parallax remains, at most about 20 px between frames.
constexpr int kLevelsWithRotation = 3;
constexpr int kBackLevels = 2;
// After this many consecutive frames without agreement the patch is replaced: the view has changed.
constexpr int kMaxRefineFailures = 3;
// Fewer tracks than this are not enough for RANSAC.
constexpr std::size_t kMinTracksToVerify = 12;
// The gates are at 3 sigma of the pixel noise.
constexpr double kGateSigmas = 3.0;
// Smallest correlation with its patch for a landmark found by projection.
constexpr float kMinRecognition = 0.8F;
// Limits the time: searches per frame, at about 1.5 us each.
constexpr int kMaxSearches = 240;

}  // namespace

void Frontend::Impl::lose(const Track& track, std::size_t c, SightingLoss loss) {
  // There is room for all: each observation is lost at most once per step.
  lost_.pushBack({track.pixel[c], static_cast<std::uint8_t>(c), loss});
}

Frontend::Impl::Guess Frontend::Impl::predict(const Track& track, std::size_t c,
                                              const FrontendPrediction& prediction) const {
  if (track.landmark >= 0) {
    const PredictedLandmark& landmark = prediction.landmarks[static_cast<std::size_t>(track.landmark)];
    if (landmark.visible[c] && landmark.pixel[c].allFinite()) {
      return {landmark.pixel[c], kLevelsWithLandmark, true};
    }
  }
  const Camera& camera = camera_[c];
  Eigen::Vector2d projected;
  if (!camera.rotation_known || !rig_.camera[c].project(camera.R_cur_prev * track.bearing[c], projected)) {
    return {track.pixel[c], settings_.pyramid_levels, false};
  }
  return {projected.cast<float>(), kLevelsWithRotation, false};
}

void Frontend::Impl::joinPredictions(const FrontendPrediction& prediction) {
  landmark_order_.clear();
  for (std::size_t i = 0; i < prediction.landmarks.size(); ++i) {
    static_cast<void>(landmark_order_.tryPushBack({prediction.landmarks[i].id, static_cast<int>(i)}));
    track_of_landmark_[i] = -1;
  }
  const auto before = [](const LandmarkIndex& a, const LandmarkIndex& b) { return a.id < b.id; };
  if (!std::is_sorted(landmark_order_.begin(), landmark_order_.end(), before)) {
    std::sort(landmark_order_.begin(), landmark_order_.end(), before);
  }
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    Track& track = tracks_[i];
    track.landmark = -1;
    const auto* const at =
        std::lower_bound(landmark_order_.begin(), landmark_order_.end(), LandmarkIndex{track.id, 0}, before);
    if (at == landmark_order_.end() || at->id != track.id) continue;
    track.landmark = at->index;
    track_of_landmark_[static_cast<std::size_t>(at->index)] = static_cast<int>(i);
  }
}

bool Frontend::Impl::follow(const Track& track, std::size_t c, const Guess& guess, Eigen::Vector2f& pixel) {
  const Camera& camera = camera_[c];
  const ImageView& image = camera.now().level(0);
  AnchorPatch& patch = anchors_[track.slot].patch[c];
  const bool refines = settings_.anchor_refinement && patch.valid;
  const Eigen::Matrix2f turned = refines ? turn(c, track.bearing[c]) : Eigen::Matrix2f::Identity();
  const auto refine = [&] {
    if (!refines || !patch.refine(image, turned, pixel)) return false;
    patch.failures = 0;
    ++statistics_.refined;
    return true;
  };
  // A landmark is mostly within a pixel of its prediction: then alignment with its first observation
  // suffices.
  pixel = guess.pixel;
  if (guess.of_landmark && patch.failures == 0 && patchInside(image, pixel) && refine() &&
      patchInside(image, pixel)) {
    return true;
  }
  LucasKanadeSettings settings;
  settings.levels = guess.levels;
  settings.back_check = 0;
  pixel = guess.pixel;
  if (!trackPoint(camera.before(), track.pixel[c], camera.now(), settings, pixel)) return false;
  const Eigen::Vector2f tracked = pixel;
  // No backward check is needed if the result agrees with the first observation.
  if (refine()) return true;
  settings.back_check = settings_.back_check;
  settings.back_levels = kBackLevels;
  if (!tracksBack(camera.before(), track.pixel[c], camera.now(), settings, tracked)) return false;
  if (refines) {
    patch.warp = turned * patch.warp;
    if (++patch.failures > kMaxRefineFailures) patch.take(camera.now(), tracked);
  }
  return true;
}

void Frontend::Impl::trackCamera(std::size_t c, const FrontendPrediction& prediction) {
  Camera& camera = camera_[c];
  for (Track& track : tracks_) {
    track.had_previous[c] = false;
    if (!track.live[c]) continue;
    track.live[c] = false;
    if (!camera.has_history) continue;
    const Eigen::Vector3d from_bearing = inMiddleRow(c, camera.scan_before, track.pixel[c], track.bearing[c]);
    Eigen::Vector2f pixel;
    if (!follow(track, c, predict(track, c, prediction), pixel) || !place(track, c, pixel)) {
      ++statistics_.lost;
      lose(track, c, SightingLoss::kNotFound);
      continue;
    }
    track.previous_bearing[c] = from_bearing;
    track.had_previous[c] = true;
    ++statistics_.tracked;
  }
}

Eigen::Matrix2f Frontend::Impl::turn(std::size_t c, const Eigen::Vector3d& from_bearing) const {
  const Camera& camera = camera_[c];
  if (!camera.rotation_known) return Eigen::Matrix2f::Identity();
  Eigen::Vector2d pixel;
  Matrix23d before;
  Matrix23d after;
  const CameraModel& model = rig_.camera[c];
  if (!model.project(from_bearing, pixel, &before) ||
      !model.project(camera.R_cur_prev * from_bearing, pixel, &after)) {
    return Eigen::Matrix2f::Identity();
  }
  return pixelWarp(before, camera.R_cur_prev, after);
}

Eigen::Vector3d Frontend::Impl::inMiddleRow(std::size_t c, const ScanTurn& scan, const Eigen::Vector2f& pixel,
                                            const Eigen::Vector3d& bearing) const {
  if (!rig_.rolls()) return bearing;
  const CameraScan camera(rig_.T_body_cam[c], {scan, Eigen::Vector3d::Zero()});
  return camera.turnAt(rig_.rowTime(c, static_cast<double>(pixel.y()))) * bearing;
}

void Frontend::Impl::verifyMotion(std::size_t c, std::uint64_t seed) {
  bearings_prev_.clear();
  bearings_cur_.clear();
  owners_.clear();
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const Track& track = tracks_[i];
    if (!track.live[c] || !track.had_previous[c]) continue;
    static_cast<void>(bearings_prev_.tryPushBack(track.previous_bearing[c]));
    static_cast<void>(
        bearings_cur_.tryPushBack(inMiddleRow(c, camera_[c].scan, track.pixel[c], track.bearing[c])));
    static_cast<void>(owners_.tryPushBack(i));
  }
  if (owners_.size() < kMinTracksToVerify) return;
  RansacSettings settings;
  settings.bearing_sigma = static_cast<double>(settings_.motion_gate) / kGateSigmas / rig_.camera[c].focal();
  ransac_.setSettings(settings);
  const Bearings prev(bearings_prev_.data(), bearings_prev_.size());
  const Bearings cur(bearings_cur_.data(), bearings_cur_.size());
  const Status status =
      camera_[c].rotation_known
          ? ransac_.twoPoint(prev, cur, camera_[c].R_prev_cur.conjugate(), seed, ransac_result_)
          : ransac_.fivePoint(prev, cur, seed, ransac_result_);
  // Without a consensus of the majority nothing can be said about single tracks.
  const bool usable =
      (status.ok() || ransac_result_.no_parallax) && 2 * ransac_result_.inlier_count > owners_.size();
  if (!usable) return;
  for (std::size_t k = 0; k < owners_.size(); ++k) {
    if (ransac_result_.inlier[k]) continue;
    tracks_[owners_[k]].live[c] = false;
    ++statistics_.false_motion;
    lose(tracks_[owners_[k]], c, SightingLoss::kMotion);
  }
}

void Frontend::Impl::verifyStereo() {
  if (!usesStereo() || !camera_[0].present || !camera_[1].present) return;
  for (Track& track : tracks_) {
    if (!track.live[0] || !track.live[1]) continue;
    if (matcher_.epipolarDistance(track.bearing[0], track.bearing[1]) >
        static_cast<double>(matcher_.gate())) {
      track.live[1] = false;
      ++statistics_.false_stereo;
      lose(track, 1, SightingLoss::kStereo);
    }
  }
}

bool Frontend::Impl::locate(AnchorPatch& anchor, std::size_t c, const PredictedLandmark& landmark,
                            Eigen::Vector2f& pixel) const {
  if (!patchInside(camera_[c].now().level(0), landmark.pixel[c])) return false;
  if (!(std::abs(anchor.warp.determinant()) > 0.05F)) return false;
  const Eigen::Matrix2f inverse = anchor.warp.inverse();
  AlignmentLimits limits;
  limits.max_displacement = landmark.gate;
  WarpedPatch patch;
  PatchTemplate pattern;
  pixel = landmark.pixel[c];
  for (int level = AnchorPatch::kLevels - 1; level >= 0; --level) {
    const auto scale = static_cast<float>(1 << level);
    const auto finish = level == 0 ? PatchTemplate::Finish::kFine : PatchTemplate::Finish::kCoarse;
    const ImageView& image = camera_[c].now().level(level);
    Eigen::Vector2f position = pixel / scale;
    const bool found = patch.sample(anchor.view(level), anchor.centre(level), inverse) &&
                       pattern.build(patch.centre(), patch.stride()) &&
                       pattern.align(image, limits, finish, position);
    if (found) pixel = position * scale;
    if (!found && level == 0) return false;
  }
  const ImageView& image = camera_[c].now().level(0);
  // The warp is as old as the last observation: update it together with the position.
  if (pattern.correlation(image, pixel) < kMinRecognition ||
      !anchor.refine(image, Eigen::Matrix2f::Identity(), pixel)) {
    return false;
  }
  anchor.failures = 0;
  return (pixel - landmark.pixel[c]).norm() <= landmark.gate && patchInside(image, pixel);
}

void Frontend::Impl::findAgain(const FrontendPrediction& prediction, int max_features) {
  int searches = 0;
  for (std::size_t i = 0; i < prediction.landmarks.size(); ++i) {
    const PredictedLandmark& landmark = prediction.landmarks[i];
    if (searches >= kMaxSearches) return;
    const bool known = track_of_landmark_[i] >= 0;
    if (!known && static_cast<int>(tracks_.size()) >= max_features) continue;
    Track lost;
    if (!known) {
      lost.id = landmark.id;
      lost.slot = anchors_.find(landmark.id);
      lost.age = 1;
    }
    Track& target = known ? tracks_[static_cast<std::size_t>(track_of_landmark_[i])] : lost;
    const int slot = target.slot;
    // A tracked slot without a track: the same landmark twice in the prediction.
    if (slot < 0 || (!known && anchors_[slot].tracked)) continue;
    bool found = false;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      if (!camera_[c].present || !landmark.visible[c] || target.live[c]) continue;
      AnchorPatch& anchor = anchors_[slot].patch[c];
      if (!anchor.valid) continue;
      ++searches;
      Eigen::Vector2f pixel;
      if (!locate(anchor, c, landmark, pixel) || !place(target, c, pixel)) continue;
      target.had_previous[c] = false;
      target.in_keyframe[c] = false;
      found = true;
      ++statistics_.found_again;
    }
    if (!found || known) continue;
    if (!tracks_.tryPushBack(lost)) return;
    anchors_[slot].tracked = true;
  }
}

}  // namespace swiftlet
