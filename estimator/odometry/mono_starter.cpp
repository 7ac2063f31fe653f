#include "estimator/odometry/mono_starter.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "estimator/messages/camera_scan.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kKeptFrames = 64;  // the whole patience at 20 Hz, every 8th frame of it at 200 Hz
constexpr std::size_t kMinFrames = 8;
constexpr Duration kShortestWindow = Duration::fromMilliseconds(400);
constexpr double kScaleSigmaWanted = 0.10;    // relative
constexpr double kScaleSigmaAccepted = 0.50;  // once the patience has passed
constexpr int kMinSightings = 3;

}  // namespace

MonoStarter::MonoStarter(const Rig& rig, const ImuNoise& noise)
    : rig_(rig),
      noise_(noise),
      frames_(kKeptFrames),
      tracks_(kMaxMonoTracks),
      track_ids_(kMaxMonoTracks),
      from_first_(kMaxMonoFrames) {}

void MonoStarter::reset() { begin_ = count_ = 0; }

void MonoStarter::push(const TrackedFrame& frame) {
  if (count_ == 0) {
    waits_since_ = frame.stamp;
    stride_ = 1;
  }
  newest_kept_ = count_ == 0 || frame.keyframe || ++since_kept_ >= stride_;
  if (!newest_kept_) return;
  since_kept_ = 0;
  if (count_ == frames_.size() && frame.stamp - waits_since_ < kMonoPatience) thinOut();
  if (count_ == frames_.size()) {
    begin_ = (begin_ + 1) % frames_.size();
    --count_;
  }
  frames_[(begin_ + count_++) % frames_.size()] = frame;
}

void MonoStarter::thinOut() {
  stride_ *= 2;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    if (k % 2 != 0 && !frame(k).keyframe) continue;
    if (kept != k) frames_[(begin_ + kept) % frames_.size()] = frame(k);
    ++kept;
  }
  count_ = kept;
}

// Tracks of the chosen frames with enough sightings, moved to the front of `tracks_`.
std::size_t MonoStarter::gatherTracks(std::span<const std::size_t> chosen, const ImuBuffer& imu,
                                      const Eigen::Vector3d& bias_gyro, const GyroIntrinsics& gyro) {
  std::size_t count = 0;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const Stamp stamp = frame(chosen[k]).stamp + rig_.camera_to_imu_shift;
    const ScanTurn turn = imu.scanTurnAt(stamp, rig_.readout, bias_gyro, gyro);
    const CameraScan scan(rig_.T_body_cam[0], {turn, Eigen::Vector3d::Zero()});
    for (const TrackedFeature& feature : frame(chosen[k]).features) {
      Eigen::Vector3d bearing;
      if (!feature.seen[0] || !rig_.camera[0].unproject(feature.pixel[0].cast<double>(), bearing)) continue;
      // Only rotation is corrected: a steady velocity shifts the positions of all frames equally.
      if (rig_.rolls())
        bearing = scan.turnAt(rig_.rowTime(0, static_cast<double>(feature.pixel[0].y()))) * bearing;
      const auto end = track_ids_.begin() + static_cast<std::ptrdiff_t>(count);
      const auto found = std::find(track_ids_.begin(), end, feature.id);
      const auto index = static_cast<std::size_t>(found - track_ids_.begin());
      if (found == end) {
        if (count == tracks_.size()) continue;
        track_ids_[count] = feature.id;
        tracks_[count].seen = 0;
        ++count;
      }
      tracks_[index].seen |= 1U << k;
      tracks_[index].bearing[k] = bearing;
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (std::popcount(tracks_[i].seen) >= kMinSightings) tracks_[kept++] = tracks_[i];
  }
  return kept;
}

bool MonoStarter::trySolve(const ImuBuffer& imu, Stamp earliest, const StartPrior& prior,
                           const CalibrationEstimate& calibration, double pixel_sigma, StartState& start,
                           const char*& waiting_for) {
  waiting_for = "more frames (with one camera the scale comes from motion)";
  if (!newest_kept_ || count_ < kMinFrames) return false;
  const Stamp newest = frame(count_ - 1).stamp;
  if (newest - frame(0).stamp < kShortestWindow) return false;
  const bool impatient = newest - waits_since_ >= kMonoPatience;
  const Duration shift = rig_.camera_to_imu_shift = calibration.camera_to_imu_shift;
  rig_.readout = calibration.readout;
  rig_.T_body_cam = calibration.T_body_cam;

  std::array<std::size_t, kMaxMonoFrames> chosen{};
  const std::size_t n = std::min(count_, kMaxMonoFrames);
  for (std::size_t k = 0; k < n; ++k) chosen[k] = k * (count_ - 1) / (n - 1);
  const std::size_t tracks = gatherTracks(std::span(chosen).first(n), imu, prior.bias_gyro, calibration.gyro);

  const Stamp first = frame(0).stamp + shift;
  TiltEstimate tilt;
  const Stamp history = std::max(first - Duration::fromSeconds(1.0), earliest);
  if (!estimateTilt(imu.around(history, first), first, noise_, prior, tilt).ok()) {
    waiting_for = "IMU samples before the first image";
    return false;
  }
  for (std::size_t k = 1; k < n; ++k) {
    const Stamp at = frame(chosen[k]).stamp + shift;
    from_first_[k - 1] = Preintegration(noise_, prior.bias_gyro, prior.bias_accel, calibration.gyro);
    if (!from_first_[k - 1].integrate(imu.around(first, at), first, at).ok()) return false;
  }
  MonoStart mono;
  const Status status =
      solveMonoStart(std::span(from_first_).first(n - 1), std::span(tracks_).first(tracks),
                     rig_.T_body_cam[0], pixel_sigma / rig_.camera[0].focal(), tilt, noise_, prior, mono);
  waiting_for = status.ok() ? "acceleration, to observe the scale" : "parallax";
  const bool solved = status.ok() && mono.scale_sigma < (impatient ? kScaleSigmaAccepted : kScaleSigmaWanted);
  if (!solved && !impatient) return false;
  start.state = BodyState{};
  start.state.T_world_body.rotation = gravityAlignedRotation(solved ? mono.motion.up : tilt.up);
  start.state.bias_gyro = solved ? mono.motion.bias_gyro : prior.bias_gyro;
  start.state.bias_accel = solved ? mono.motion.bias_accel : prior.bias_accel;
  if (solved) start.state.v_world_body = start.state.T_world_body.rotation * mono.motion.velocity;
  start.tilt_sigma = tilt.sigma;
  start.gyro_bias_sigma = prior.bias_gyro_sigma;
  start.accel_bias_sigma = prior.bias_accel_sigma;
  return true;
}

}  // namespace swiftlet
