#include "estimator/smoother/smoother.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/smoother/window_factors.hpp"
#include "estimator/smoother/window_trim.hpp"

namespace swiftlet {
namespace {

constexpr double kOutlierSigmas = 3.5;  // largest residual used for the correlation of errors

}  // namespace

Smoother::Smoother(const Rig& rig, const ImuNoise& noise, const SmootherSettings& settings)
    : settings_(settings),
      pixel_noise_(settings.pixel_sigma),
      problem_(rig, noise, settings.estimate_time_offset, settings.estimate_extrinsics,
               settings.estimate_gyro) {}

void Smoother::reset() {
  problem_.clear();
  start_.reset();
  trim_due_ = false;
}

Status Smoother::step(const StepInput& input) {
  if (!started() && !start_) return {StatusCode::kNotReady, "no start state"};
  if (trim_due_) return {StatusCode::kInvalidInput, "the window has not been trimmed since the last step"};
  addState(input);
  problem_.intrinsics.setHeld(!input.estimate_gyro);
  addSightings(*input.frame, input.max_features);
  const Status status =
      solver_.solve(problem_, system_, covariance_, input.iterations, input.pose_tolerance, statistics_);
  if (!status.ok()) return status;
  updateStatistics();
  max_keyframes_ = std::clamp(input.max_keyframes, 1, settings_.max_keyframes);
  trim_due_ = true;
  return okStatus();
}

void Smoother::addState(const StepInput& input) {
  Window& window = problem_.window;
  const bool first = window.empty();
  WindowState& state = window.inSlot(window.add());  // trim() leaves a free slot
  state.time_offset = problem_.calibration.timeOffset();
  if (!first) {
    // A correction of the time offset must not change the order of two frames.
    const WindowState& before = window[window.size() - 2];
    const double interval = (input.frame->stamp - before.stamp).seconds() + before.time_offset;
    state.time_offset = std::max(state.time_offset, before.time_offset - 0.5 * interval);
  }
  state.stamp = input.frame->stamp + Duration::fromSeconds(state.time_offset);
  state.frame_index = input.frame->index;
  state.keyframe = input.frame->keyframe || first;
  state.rest = input.rest;
  if (first) {
    state.x = start_->state;
    problem_.startPrior(*start_);
  } else {
    linkState(state, window[window.size() - 2], input.imu_gap);
  }
  const auto samples = problem_.imu.around(state.stamp, state.stamp);
  if (!samples.empty())
    state.omega_body = problem_.intrinsics.now().rate(samples.front().gyro) - state.x.bias_gyro;
  state.scan = problem_.imu.scanTurnAt(state.stamp, problem_.rig.readout, state.x.bias_gyro,
                                       problem_.intrinsics.now());
}

void Smoother::linkState(WindowState& state, const WindowState& previous, bool gap) const {
  state.link_duration = (state.stamp - previous.stamp).seconds();
  state.x = previous.x;
  const double dt = state.link_duration;
  if (gap || problem_.imu.around(previous.stamp, state.stamp).empty()) {
    state.link = LinkKind::kConstantVelocity;
    state.x.T_world_body.translation += dt * previous.x.v_world_body;
    return;
  }
  state.link = LinkKind::kImu;
  problem_.integrateLink(state, previous);
  const Eigen::Vector3d g(0, 0, -problem_.noise.gravity);
  const SE3& T = previous.x.T_world_body;
  state.x.T_world_body.rotation = (T.rotation * state.imu.deltaRotation()).normalized();
  state.x.T_world_body.translation = T.translation + dt * previous.x.v_world_body + 0.5 * dt * dt * g +
                                     T.rotation * state.imu.deltaPosition();
  state.x.v_world_body = previous.x.v_world_body + dt * g + T.rotation * state.imu.deltaVelocity();
}

// The newest id among the `max_features` smallest. Ids increase with every detection, so these features have
// been tracked for longest.
TrackId Smoother::newestIdTaken(const TrackedFrame& frame, int max_features) {
  const auto count = static_cast<std::size_t>(std::max(max_features, 1));
  if (frame.features.size() <= count) return std::numeric_limits<TrackId>::max();
  taken_.clear();
  for (const TrackedFeature& feature : frame.features) taken_.pushBack(feature.id);
  TrackId* const last = taken_.begin() + (count - 1);
  std::nth_element(taken_.begin(), last, taken_.end());
  return *last;
}

void Smoother::addSightings(const TrackedFrame& frame, int max_features) {
  statistics_ = FrameStatistics{};
  statistics_.noise.pixel_sigma = pixel_noise_.sigma();
  double age = 0;
  const TrackId newest_taken = newestIdTaken(frame, max_features);
  for (const TrackedFeature& feature : frame.features) {
    if (feature.id > newest_taken) continue;
    const Sighting sighting = makeSighting(problem_.rig, feature.seen, feature.pixel,
                                           statistics_.noise.pixel_sigma, problem_.window.newestSlot());
    if (!sighting.any()) continue;
    Landmark* const known = problem_.landmarks.find(feature.id);
    Landmark& landmark = known != nullptr ? *known : problem_.landmarks.add(feature.id);
    statistics_.known += landmark.sightings.empty() ? 0 : 1;
    landmark.last_frame = frame.index;
    ++landmark.frames_seen;
    age += landmark.frames_seen;
    landmark.sightings.pushBack(sighting);
    ++statistics_.tracks;
  }
  if (statistics_.tracks > 0) statistics_.track_length = age / statistics_.tracks;
}

void Smoother::updateStatistics() {
  double sum = 0;
  int views = 0;
  for (const Landmark& landmark : problem_.landmarks) {
    // An explicit landmark may have lost its last observation.
    if (!landmark.accepted() || landmark.sightings.empty()) continue;
    ++statistics_.landmarks;
    const int count = landmark.viewCount();
    sum += landmark.mean_square * count;
    views += count;
    const Sighting& last = landmark.sightings.back();
    if (last.slot != problem_.window.newestSlot()) continue;
    const bool both = last.camera[0].used && last.camera[1].used;
    ++(both ? statistics_.inliers_stereo : statistics_.inliers_mono);
  }
  if (views > 0) statistics_.reprojection_rms = pixel_noise_.sigma() * std::sqrt(sum / views);
  WindowState& state = problem_.window.newest();
  MotionResiduals residuals = motionResiduals(problem_);
  // With one camera only the accelerometer determines the scale. Increasing its noise would lose the scale,
  // and the disagreement would grow further.
  if (problem_.rig.camera_count == 1) residuals.accel = 0;
  statistics_.imu_residual = std::sqrt(residuals.all);
  statistics_.noise.imu = state.imu_factors;
  statistics_.pose_variance_factor = track_correlation_.varianceFactor();
  problem_.imu_excess.update(residuals, state.link_duration);
  statistics_.keyframe = state.keyframe;
  statistics_.at_rest = state.rest != 0;
  state.statistics = statistics_;
  if (solver_.medianSquare() > 0) pixel_noise_.update(solver_.medianSquare(), state.link_duration);
  if (state.keyframe) updateTrackCorrelation();
}

// Uses the two newest keyframes that stay; the newest frames and one more state are after them.
void Smoother::updateTrackCorrelation() {
  const Window& window = problem_.window;
  const std::size_t recent = static_cast<std::size_t>(settings_.max_recent) + 1;
  if (window.size() < recent + 2) return;
  const WindowState& last = window[window.size() - recent - 1];
  const WindowState& before = window[window.size() - recent - 2];
  const auto slots =
      std::array{window.order()[window.size() - recent - 2], window.order()[window.size() - recent - 1]};
  double product = 0;
  double square = 0;
  for (const Landmark& landmark : problem_.landmarks) {
    if (!landmark.accepted()) continue;
    std::array<const Sighting*, 2> seen{};
    for (const Sighting& sighting : landmark.sightings) {
      if (sighting.slot == slots[0]) seen[0] = &sighting;
      if (sighting.slot == slots[1]) seen[1] = &sighting;
    }
    if (seen[0] == nullptr || seen[1] == nullptr) continue;
    for (std::size_t c = 0; c < problem_.rig.camera_count; ++c) {
      std::array<Eigen::Vector2d, 2> r;
      bool fits = true;
      for (std::size_t k = 0; fits && k < 2; ++k) {
        const CameraSighting& view = seen[k]->camera[c];
        fits = view.used &&
               reprojectionResidual(view, problem_.rig_poses[slots[k]].current[c], landmark.point, r[k]) &&
               r[k].squaredNorm() < kOutlierSigmas * kOutlierSigmas;
      }
      if (!fits) continue;
      product += r[0].dot(r[1]);
      square += 0.5 * (r[0].squaredNorm() + r[1].squaredNorm());
    }
  }
  track_correlation_.update(product, square, (last.stamp - before.stamp).seconds());
  covariance_.setPoseVarianceFactor(track_correlation_.varianceFactor());
}

void Smoother::trim(FixedVector<KeyframeState, kMaxStates>& left_window) {
  left_window.clear();
  if (!trim_due_) return;
  trim_due_ = false;
  const TrimLimits limits{static_cast<std::size_t>(settings_.max_recent),
                          static_cast<std::size_t>(std::min(settings_.max_motion_keyframes, max_keyframes_)),
                          static_cast<std::size_t>(max_keyframes_), settings_.horizon};
  WindowTrim(problem_, system_, covariance_, marginalization_).trim(limits, left_window);
}

void Smoother::flush(FixedVector<KeyframeState, kMaxStates>& left_window) {
  left_window.clear();
  for (const std::uint8_t slot : problem_.window.order()) {
    const WindowState& state = problem_.window.inSlot(slot);
    if (state.keyframe) left_window.pushBack(covariance_.record(state));
  }
}

void Smoother::window(SmoothedWindow& out) const {
  out.poses.clear();
  out.landmarks.clear();
  for (const std::uint8_t slot : problem_.window.order()) {
    const WindowState& s = problem_.window.inSlot(slot);
    const SE3& T = s.x.T_world_body;
    out.poses.pushBack({s.stamp, s.frame_index, s.keyframe, T, {}});
    if (problem_.rig.rolls()) out.poses.back().scan = {s.scan, T.rotation.conjugate() * s.x.v_world_body};
  }
  for (const Landmark& landmark : problem_.landmarks) {
    if (!landmark.accepted() || landmark.point.inverse_depth <= 0) continue;
    out.landmarks.pushBack({landmark.id, landmark.point.position(), landmark.point.inverse_depth_sigma,
                            static_cast<int>(landmark.sightings.size())});
  }
}

CalibrationEstimate Smoother::calibration() {
  CalibrationEstimate estimate;
  estimate.camera_to_imu_shift = timeOffset();
  estimate.readout = Duration::fromSeconds(problem_.calibration.readout());
  estimate.T_body_cam = problem_.calibration.T_body_cam();
  estimate.gyro = problem_.intrinsics.now();
  const CalibrationLayout& layout = problem_.calibration.layout();
  CalibrationMatrix P;
  if (!covariance_.calibration(layout.dimension(), P)) {
    if (layout.time_offset) estimate.shift_sigma = kTimeOffsetPriorSigma;
    if (layout.readout) estimate.readout_sigma = kReadoutPriorSigma;
    if (layout.extrinsics) estimate.stereo_rotation_sigma = std::sqrt(2.0) * kExtrinsicRotationPriorSigma;
    return estimate;
  }
  if (layout.time_offset) estimate.shift_sigma = std::sqrt(P(0, 0));
  if (layout.readout) estimate.readout_sigma = std::sqrt(P(1, 1));
  if (!layout.extrinsics) return estimate;
  // Difference of the two cameras' rotations, in body axes.
  Eigen::Matrix<double, 3, kMaxCalibrationDim> J = Eigen::Matrix<double, 3, kMaxCalibrationDim>::Zero();
  for (std::size_t c = 0; c < layout.cameras; ++c) {
    const int at = layout.extrinsicOffset(c);
    const auto sigma = [&P](int first) { return std::sqrt(P.diagonal().segment<3>(first).maxCoeff()); };
    estimate.rotation_sigma[c] = sigma(at);
    estimate.position_sigma[c] = sigma(at + 3);
    J.middleCols<3>(at) = (c == 0 ? 1.0 : -1.0) * estimate.T_body_cam[c].R();
  }
  const auto used = J.leftCols(P.cols());
  const Eigen::Matrix3d turn = used * P * used.transpose();
  if (layout.cameras > 1) estimate.stereo_rotation_sigma = std::sqrt(turn.diagonal().maxCoeff());
  return estimate;
}

void Smoother::removePlane(PlaneId plane) {
  if (problem_.extras.removePlane(plane)) marginalization_.marginalize(problem_, system_, Departure{});
}

std::optional<PlaneEstimate> Smoother::plane(PlaneId plane) {
  const ExtraState* const extra = problem_.extras.findPlane(plane);
  if (extra == nullptr) return std::nullopt;
  return PlaneEstimate{extra->x.plane, covariance_.of(*extra), problem_.extras.pointsOn(*extra)};
}

}  // namespace swiftlet
