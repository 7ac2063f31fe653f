#include "drivers/simulated/track_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kTrackStream = 51;
constexpr int kGridX = 8;  // cells over which new tracks are spread
constexpr int kGridY = 6;
constexpr double kMinKeptShare = 0.5;  // a new keyframe if fewer tracks than this survive

std::size_t cellOf(const Eigen::Vector2d& pixel, const CameraModel& camera) {
  const int x = std::clamp(static_cast<int>(pixel.x() * kGridX / camera.width()), 0, kGridX - 1);
  const int y = std::clamp(static_cast<int>(pixel.y() * kGridY / camera.height()), 0, kGridY - 1);
  return static_cast<std::size_t>(y * kGridX + x);
}

}  // namespace

TrackSimulator::TrackSimulator(const World& world, const Rig& rig, const SplineTrajectory& trajectory,
                               const TrackSettings& settings)
    : world_(&world),
      rig_(&rig),
      trajectory_(&trajectory),
      settings_(settings),
      random_(settings.seed, kTrackStream) {
  settings_.max_tracks = std::min(settings_.max_tracks, static_cast<int>(kMaxFeatures));
  landmarks_.resize(static_cast<std::size_t>(settings_.landmarks));
  for (Landmark& landmark : landmarks_) {
    const SurfacePoint point = world.drawPoint(random_);
    landmark = {point.position, point.normal, false};
  }
}

TrackSimulator::Place TrackSimulator::placeAt(double seconds) const {
  Place place;
  place.seconds = seconds;
  const SE3 T_world_body = trajectory_->pose(seconds);
  for (std::size_t c = 0; c < rig_->camera_count; ++c) {
    place.T_world_cam[c] = T_world_body * rig_->T_body_cam[c];
    place.T_cam_world[c] = place.T_world_cam[c].inverse();
  }
  return place;
}

// With a rolling shutter, the pixel at the time when its own row is read.
bool TrackSimulator::atItsRow(double seconds, std::size_t camera, const Eigen::Vector3d& position,
                              Eigen::Vector2d& pixel) const {
  constexpr int kRounds = 4;  // each reduces the error to some hundredths
  for (int i = 0; i < kRounds; ++i) {
    const double row_time = seconds + rig_->rowTime(camera, pixel.y());
    const SE3 T_cam_world = (trajectory_->pose(row_time) * rig_->T_body_cam[camera]).inverse();
    if (!rig_->camera[camera].project(T_cam_world * position, pixel)) return false;
  }
  return true;
}

bool TrackSimulator::visible(const Place& place, std::size_t camera, const Landmark& landmark,
                             Eigen::Vector2d& pixel) const {
  const Eigen::Vector3d p = place.T_cam_world[camera] * landmark.position;
  const double range = p.norm();
  if (range < settings_.min_range || range > settings_.max_range) return false;
  const CameraModel& model = rig_->camera[camera];
  if (!model.project(p, pixel) || !model.inImage(pixel, settings_.border)) return false;
  return !rig_->rolls() || (atItsRow(place.seconds, camera, landmark.position, pixel) &&
                            model.inImage(pixel, settings_.border));
}

bool TrackSimulator::inSight(const SE3& T_world_cam, const Landmark& landmark) const {
  const Eigen::Vector3d to_camera = T_world_cam.translation - landmark.position;
  const double slant = std::cos(settings_.max_slant * std::numbers::pi / 180);
  if (to_camera.normalized().dot(landmark.normal) < slant) return false;
  return !settings_.occlusion || world_->sees(T_world_cam.translation, landmark.position);
}

void TrackSimulator::keepTracks(const Place& place) {
  std::erase_if(tracks_, [&](Track& track) {
    Landmark& landmark = landmarks_[track.landmark];
    if (place.seconds < track.end && visible(place, 0, landmark, track.now) &&
        inSight(place.T_world_cam[0], landmark)) {
      return false;
    }
    landmark.tracked = false;
    return true;
  });
}

void TrackSimulator::startTracks(const Place& place) {
  const int wanted = settings_.max_tracks - static_cast<int>(tracks_.size());
  if (wanted <= 0) return;
  std::array<int, kGridX * kGridY> taken{};
  for (const Track& track : tracks_) ++taken[cellOf(track.now, rig_->camera[0])];
  const int cell_limit = settings_.max_tracks / (kGridX * kGridY) + 1;
  int started = 0;
  // Landmarks were drawn at random, so iterating from a random one is as good as drawing.
  const auto count = static_cast<std::uint32_t>(landmarks_.size());
  const std::uint32_t offset = random_.below(count);
  for (std::uint32_t k = 0; k < count && started < wanted; ++k) {
    const std::uint32_t index = (k + offset) % count;
    Landmark& landmark = landmarks_[index];
    Eigen::Vector2d pixel;
    if (landmark.tracked || !visible(place, 0, landmark, pixel)) continue;
    int& in_cell = taken[cellOf(pixel, rig_->camera[0])];
    if (in_cell >= cell_limit || !inSight(place.T_world_cam[0], landmark)) continue;
    ++in_cell;
    ++started;
    landmark.tracked = true;
    Track track;
    track.id = next_id_++;
    track.landmark = index;
    track.end = place.seconds - settings_.mean_lifetime * std::log(1.0 - random_.uniform());
    track.now = pixel;
    tracks_.push_back(track);
  }
}

void TrackSimulator::chooseKeyframe(double seconds, TrackedFrame& frame) {
  std::vector<double> since_keyframe;
  std::size_t known = 0;
  for (const Track& track : tracks_) {
    if (track.has_keyframe) {
      since_keyframe.push_back((track.now - track.keyframe).norm());
      ++known;
    }
  }
  // Stamps are whole nanoseconds: half a millisecond of tolerance keeps the number of frames per interval.
  constexpr double kSlack = 5e-4;
  frame.keyframe = seconds - last_keyframe_ > settings_.keyframe_interval - kSlack ||
                   (!since_keyframe.empty() && medianOf(since_keyframe) > settings_.keyframe_motion) ||
                   static_cast<double>(known) < kMinKeptShare * static_cast<double>(tracks_.size());
  for (Track& track : tracks_) {
    if (frame.keyframe) {
      track.keyframe = track.now;
      track.has_keyframe = true;
    }
  }
  if (frame.keyframe) last_keyframe_ = seconds;
}

Eigen::Vector2d TrackSimulator::disturbed(const Eigen::Vector2d& pixel, const CameraModel& camera,
                                          bool& outlier) {
  const double nx = random_.normal();
  const double ny = random_.normal();
  const Eigen::Vector2d noisy = pixel + settings_.pixel_sigma * Eigen::Vector2d(nx, ny);
  outlier = random_.uniform() < settings_.outlier_share;
  if (!outlier) return noisy;
  constexpr int kTries = 20;  // to stay inside the image
  for (int i = 0; i < kTries; ++i) {
    const double size = random_.uniform(settings_.outlier_low, settings_.outlier_high);
    const double angle = random_.uniform(0.0, 2 * std::numbers::pi);
    const Eigen::Vector2d moved = noisy + size * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    if (camera.inImage(moved)) return moved;
  }
  outlier = false;
  return noisy;
}

void TrackSimulator::step(double seconds, Stamp stamp, TrackedFrame& frame, std::vector<TrackTruth>* truth) {
  const std::size_t cameras = settings_.mono ? 1 : rig_->camera_count;
  const Place place = placeAt(seconds);
  keepTracks(place);
  startTracks(place);

  frame.features.clear();
  frame.stamp = stamp;
  frame.index = frame_index_++;
  frame.camera_present = {};
  for (std::size_t c = 0; c < cameras; ++c) frame.camera_present[c] = true;
  if (truth != nullptr) truth->clear();
  for (const Track& track : tracks_) {
    if (random_.uniform() < settings_.dropout) continue;
    const Landmark& landmark = landmarks_[track.landmark];
    TrackedFeature feature;
    TrackTruth record;
    record.landmark = landmark.position;
    record.landmark_index = track.landmark;
    feature.id = track.id;
    feature.seen[0] = true;
    record.pixel[0] = track.now;
    feature.pixel[0] = disturbed(track.now, rig_->camera[0], record.outlier[0]).cast<float>();
    Eigen::Vector2d right;
    if (cameras > 1 && random_.uniform() < settings_.right_share && visible(place, 1, landmark, right) &&
        inSight(place.T_world_cam[1], landmark)) {
      feature.seen[1] = true;
      record.pixel[1] = right;
      feature.pixel[1] = disturbed(right, rig_->camera[1], record.outlier[1]).cast<float>();
    }
    if (!frame.features.tryPushBack(feature)) break;
    if (truth != nullptr) truth->push_back(record);
  }
  chooseKeyframe(seconds, frame);
}

}  // namespace swiftlet
