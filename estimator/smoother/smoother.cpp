#include "estimator/smoother/smoother.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kImuCapacity = 8192;  // samples: 20 s at 400 Hz, 8 s at 1 kHz
// The gauge: position and yaw of the first state define the world.
constexpr double kGaugeSigma = 1e-4;  // m, rad
// First-order bias correction of an increment is exact to about (bias change x duration)^2 / 2.
constexpr double kReintegrateGyro = 5e-4;   // rad/s
constexpr double kReintegrateAccel = 5e-2;  // m/s^2
constexpr double kRelativeDamping = 1e-10;
constexpr int kTriangulationStart = 6;         // iterations for a landmark in its first solve
constexpr int kTriangulationRestart = 2;       // and for all when states have gone back
constexpr double kConverged = 1e-4;            // largest step worth another iteration: m, rad, m/s
constexpr double kCostIncreaseAllowed = 0.02;  // of the factors' cost, before a step is taken back
constexpr double kOutlierSigmas = 20.0;        // of one sighting, during the solve
constexpr double kFinalOutlierSigmas = 3.5;
constexpr double kRestVelocitySigma = 0.01;       // m/s
constexpr double kRestPositionSigma = 3e-4;       // m, between two frames at rest: 6 mm/s at 20 Hz
constexpr double kRestRotationSigma = 3.5e-4;     // rad, likewise
constexpr double kTimeOffsetSigma = 5e-3;         // s, prior when estimated
constexpr double kExtrinsicRotationSigma = 0.01;  // rad
// Calibrations give positions to a few millimetres; a looser prior gives up the baseline, stereo's scale.
constexpr double kExtrinsicPositionSigma = 2e-3;  // m

// Of the 3-vectors that a step is made of, the longest, and the time offset's where it comes first. Lengths,
// not components: when the iteration ends must not depend on which way the world's axes point. Without the
// extra states' columns, `extra` behind the first `calibration`: points far away are not worth an iteration.
double largestStep(const VectorMap& step, bool with_time_offset, int calibration, int extra) {
  double largest = with_time_offset ? std::abs(step[0]) : 0;
  for (Eigen::Index k = with_time_offset ? 1 : 0; k + 3 <= step.size(); k += 3) {
    if (k >= calibration && k < calibration + extra) continue;
    largest = std::max(largest, step.segment<3>(k).norm());
  }
  return largest;
}

// Of the poses' parts alone, the longest.
double largestPoseStep(const VectorMap& step, std::span<const std::uint8_t> order,
                       const std::array<WindowState, kMaxStates>& states) {
  double largest = 0;
  for (const std::uint8_t slot : order) {
    const Eigen::Index at = states[slot].offset;
    largest = std::max({largest, step.segment<3>(at).norm(), step.segment<3>(at + 3).norm()});
  }
  return largest;
}

}  // namespace

Smoother::Smoother(const Rig& rig, const ImuNoise& noise, const SmootherSettings& settings)
    : rig_(rig),
      noise_(noise),
      settings_(settings),
      imu_(kImuCapacity),
      landmarks_(kMaxLandmarks),
      landmark_ids_(kMaxLandmarks, 0),
      in_system_(kMaxLandmarks, 0),
      eliminated_(kMaxLandmarks),
      step_(kMaxSystemDim),
      factor_(alignedMapSize(kMaxSystemDim)),
      columns_i_(static_cast<std::size_t>(kMaxSystemDim) * kStateDim),
      columns_j_(static_cast<std::size_t>(kMaxSystemDim) * kStateDim),
      involved_(kMaxStates + kMaxExtraStates, 0) {
  calibration_.time_offset = settings.estimate_time_offset;
  calibration_.extrinsics = settings.estimate_extrinsics;
  calibration_.cameras = rig.camera_count;
  time_offset_ = rig.camera_to_imu_shift.seconds();
  T_body_cam_ = rig.T_body_cam;
  reset();
}

void Smoother::reset() {
  order_.clear();
  for (WindowState& state : states_) state.used = false;
  std::fill(landmark_ids_.begin(), landmark_ids_.end(), 0);
  std::fill(in_system_.begin(), in_system_.end(), std::uint8_t{0});
  for (ExtraState& extra : extras_) extra = ExtraState{};
  extra_factors_.clear();
  prior_.clear();
  has_start_ = false;
  trim_due_ = false;
}

Status Smoother::step(const StepInput& input) {
  if (order_.empty() && !has_start_) return {StatusCode::kNotReady, "no start state"};
  if (trim_due_) return {StatusCode::kInvalidInput, "the window has not been trimmed since the last step"};
  const std::uint8_t slot = addState(input);
  addSightings(slot, *input.frame, input.max_features);
  const Status status = solve(input.iterations, input.pose_tolerance);
  if (!status.ok()) return status;
  updateStatistics();
  max_keyframes_ = std::clamp(input.max_keyframes, 1, settings_.max_keyframes);
  trim_due_ = true;
  return okStatus();
}

std::uint8_t Smoother::addState(const StepInput& input) {
  std::uint8_t slot = 0;
  while (states_[slot].used) ++slot;  // trim() leaves a free slot
  WindowState& state = states_[slot];
  state = WindowState{};
  state.used = true;
  state.stamp = input.frame->stamp + Duration::fromSeconds(time_offset_);
  state.frame_index = input.frame->index;
  state.keyframe = input.frame->keyframe;
  state.at_rest = input.at_rest;
  state.time_offset = time_offset_;
  newest_frame_ = input.frame->index;
  if (order_.empty()) {
    state.x = start_.state;
    state.keyframe = true;
    static_cast<void>(order_.tryPushBack(slot));
    startPrior();
  } else {
    linkState(state, states_[order_.back()], input.imu_gap);
    static_cast<void>(order_.tryPushBack(slot));
  }
  const auto samples = imu_.around(state.stamp, state.stamp);
  if (!samples.empty()) state.omega_body = samples.front().gyro - state.x.bias_gyro;
  return slot;
}

void Smoother::integrateLink(WindowState& state, const WindowState& previous) {
  state.imu = Preintegration(noise_, previous.x.bias_gyro, previous.x.bias_accel);
  static_cast<void>(
      state.imu.integrate(imu_.around(previous.stamp, state.stamp), previous.stamp, state.stamp));
}

void Smoother::linkState(WindowState& state, const WindowState& previous, bool gap) {
  state.link_duration = (state.stamp - previous.stamp).seconds();
  state.x = previous.x;
  const double dt = state.link_duration;
  if (gap || imu_.around(previous.stamp, state.stamp).empty()) {
    state.link = LinkKind::kConstantVelocity;
    state.x.T_world_body.translation += dt * previous.x.v_world_body;
    return;
  }
  state.link = LinkKind::kImu;
  integrateLink(state, previous);
  const Eigen::Vector3d g(0, 0, -noise_.gravity);
  const SE3& T = previous.x.T_world_body;
  state.x.T_world_body.rotation = (T.rotation * state.imu.deltaRotation()).normalized();
  state.x.T_world_body.translation = T.translation + dt * previous.x.v_world_body + 0.5 * dt * dt * g +
                                     T.rotation * state.imu.deltaPosition();
  state.x.v_world_body = previous.x.v_world_body + dt * g + T.rotation * state.imu.deltaVelocity();
}

void Smoother::startPrior() {
  const std::uint8_t slot = order_.front();
  prior_.begin();
  if (calibration_.dimension() > 0) prior_.addBlock(PriorBlock::kCalibration, calibration_.dimension(), {});
  prior_.addBlock(slot, kStateDim, start_.state);
  prior_.allocate();
  MatrixMap H = prior_.H();
  int at = 0;
  if (calibration_.time_offset) H(at, at) = 1.0 / (kTimeOffsetSigma * kTimeOffsetSigma);
  if (calibration_.extrinsics) {
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      const int first = calibration_.extrinsicOffset(c);
      for (int k = 0; k < 3; ++k) {
        H(first + k, first + k) = 1.0 / (kExtrinsicRotationSigma * kExtrinsicRotationSigma);
        H(first + 3 + k, first + 3 + k) = 1.0 / (kExtrinsicPositionSigma * kExtrinsicPositionSigma);
      }
    }
  }
  time_offset_reference_ = time_offset_;
  T_body_cam_reference_ = T_body_cam_;
  at = calibration_.dimension();
  const double tilt = 1.0 / (start_.tilt_sigma * start_.tilt_sigma);
  const double gauge = 1.0 / (kGaugeSigma * kGaugeSigma);
  // The rotation error lives in body axes; the vertical there is R^T z.
  const Eigen::Vector3d up = start_.state.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  H.block<3, 3>(at, at) = tilt * Eigen::Matrix3d::Identity() + (gauge - tilt) * up * up.transpose();
  for (int k = 0; k < 3; ++k) {
    H(at + 3 + k, at + 3 + k) = gauge;
    H(at + 6 + k, at + 6 + k) = 1.0 / (start_.velocity_sigma * start_.velocity_sigma);
    H(at + 9 + k, at + 9 + k) = 1.0 / (start_.gyro_bias_sigma * start_.gyro_bias_sigma);
    H(at + 12 + k, at + 12 + k) = 1.0 / (start_.accel_bias_sigma * start_.accel_bias_sigma);
  }
}

Landmark* Smoother::findLandmark(TrackId id) {
  const auto found = std::find(landmark_ids_.begin(), landmark_ids_.end(), id);
  return found == landmark_ids_.end() ? nullptr
                                      : &landmarks_[static_cast<std::size_t>(found - landmark_ids_.begin())];
}

// When full, the landmark that was lost longest ago makes room; explicit ones leave in their own way.
Landmark* Smoother::newLandmark(TrackId id) {
  auto free = std::find(landmark_ids_.begin(), landmark_ids_.end(), TrackId{0});
  if (free == landmark_ids_.end()) {
    static_assert(kMaxExplicitLandmarks < kMaxLandmarks);
    std::size_t oldest = 0;
    while (landmarks_[oldest].extra != kNoExtra) ++oldest;
    for (std::size_t i = oldest + 1; i < landmarks_.size(); ++i) {
      if (landmarks_[i].extra != kNoExtra) continue;
      if (landmarks_[i].last_frame < landmarks_[oldest].last_frame) oldest = i;
    }
    removeLandmark(landmarks_[oldest]);
    free = landmark_ids_.begin() + static_cast<std::ptrdiff_t>(oldest);
  }
  Landmark& landmark = landmarks_[static_cast<std::size_t>(free - landmark_ids_.begin())];
  landmark.point.triangulated = false;
  landmark.id = id;
  landmark.frames_seen = 0;
  landmark.rejections = 0;
  landmark.extra = kNoExtra;
  landmark.sightings.clear();
  *free = id;
  return &landmark;
}

void Smoother::removeLandmark(Landmark& landmark) {
  const auto index = static_cast<std::size_t>(&landmark - landmarks_.data());
  landmark.sightings.clear();
  landmark_ids_[index] = 0;
  in_system_[index] = 0;
}

// Ids rise with every detection, so those up to this one have been followed for longest.
TrackId Smoother::newestIdTaken(const TrackedFrame& frame, int max_features) {
  const auto count = static_cast<std::size_t>(std::max(max_features, 1));
  if (frame.features.size() <= count) return std::numeric_limits<TrackId>::max();
  taken_.clear();
  for (const TrackedFeature& feature : frame.features) static_cast<void>(taken_.tryPushBack(feature.id));
  TrackId* const last = taken_.begin() + (count - 1);
  std::nth_element(taken_.begin(), last, taken_.end());
  return *last;
}

void Smoother::addSightings(std::uint8_t slot, const TrackedFrame& frame, int max_features) {
  statistics_ = FrameStatistics{};
  double age = 0;
  const TrackId newest_taken = newestIdTaken(frame, max_features);
  for (const TrackedFeature& feature : frame.features) {
    if (feature.id > newest_taken) continue;
    Sighting sighting;
    sighting.slot = slot;
    bool any = false;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      if (!feature.seen[c]) continue;
      CameraSighting& view = sighting.camera[c];
      Eigen::Vector2d pixel;
      Matrix23d J;
      if (!rig_.camera[c].unproject(feature.pixel[c].cast<double>(), view.bearing)) continue;
      if (!rig_.camera[c].project(view.bearing, pixel, &J)) continue;
      view.weight = J / settings_.pixel_sigma;
      view.used = true;
      any = true;
    }
    if (!any) continue;
    Landmark* landmark = findLandmark(feature.id + 1);  // 0 marks a free slot
    if (landmark == nullptr) landmark = newLandmark(feature.id + 1);
    landmark->last_frame = frame.index;
    ++landmark->frames_seen;
    age += landmark->frames_seen;
    static_cast<void>(landmark->sightings.tryPushBack(sighting));
    ++statistics_.tracks;
  }
  if (statistics_.tracks > 0) statistics_.track_length = age / statistics_.tracks;
}

void Smoother::assignOffsets() {
  dimension_ = calibration_.dimension();
  extra_columns_ = 0;
  for (ExtraState& extra : extras_) {
    if (extra.kind == ExtraKind::kNone) continue;
    extra.offset = dimension_ + extra_columns_;
    extra_columns_ += kExtraDim;
  }
  dimension_ += extra_columns_;
  for (const std::uint8_t slot : order_) {
    states_[slot].offset = dimension_;
    dimension_ += states_[slot].dimension();
  }
}

// First estimates keep what is known apart from what is not; but when the window as a whole has
// moved since (with one camera the scale, and so the place, is known to some per cent only), points
// and states that are not frozen have moved along, and Jacobians between old and new places are wrong
// by the parallax of that move. A common translation changes no factor and leaves the unobservable
// directions' span: the first estimates are moved with the window.
void Smoother::moveEstimates() {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  int frozen = 0;
  for (const std::uint8_t slot : order_) {
    const WindowState& state = states_[slot];
    if (!state.frozen) continue;
    shift += state.x.T_world_body.translation - state.moved_estimate.T_world_body.translation;
    ++frozen;
  }
  if (frozen == 0) return;
  shift /= frozen;
  for (const std::uint8_t slot : order_) {
    if (states_[slot].frozen) states_[slot].moved_estimate.T_world_body.translation += shift;
  }
  for (ExtraState& extra : extras_) {
    if (extra.frozen) extra.translateEstimate(shift);
  }
}

void Smoother::placeCameras() {
  for (const std::uint8_t slot : order_) {
    const WindowState& state = states_[slot];
    RigPose& rig = rig_poses_[slot];
    SE3 T = state.x.T_world_body;
    const double shift = time_offset_ - state.time_offset;
    rig.v_world = state.x.v_world_body;
    rig.omega_body = state.omega_body;
    if (shift != 0) {
      T.rotation = (T.rotation * expSo3(shift * state.omega_body)).normalized();
      T.translation += shift * state.x.v_world_body;
    }
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      rig.current[c] = CameraPose::of(T, T_body_cam_[c]);
      rig.linearization[c] =
          state.frozen ? CameraPose::of(state.moved_estimate.T_world_body, T_body_cam_[c]) : rig.current[c];
    }
  }
}

// Landmarks that have no point yet get one; the others move by `iterations` steps of their own, with none
// they are only looked at.
void Smoother::triangulateAll(int iterations) {
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (landmark_ids_[i] == 0) continue;
    Landmark& landmark = landmarks_[i];
    if (landmark.extra != kNoExtra) {
      in_system_[i] = landmark.sightings.empty() ? 0 : 1;
      continue;
    }
    const int steps = landmark.point.triangulated ? iterations : kTriangulationStart;
    in_system_[i] =
        landmark.sightings.size() >= 2 && triangulate(rig_poses_, landmark.views(), steps, landmark.point)
            ? 1
            : 0;
  }
}

LandmarkViews Smoother::viewsOf(std::span<const Sighting> sightings) const {
  return {sightings, rig_poses_, T_body_cam_, calibration_};
}

// The points' part of the step that was solved for.
void Smoother::substitutePoints(const VectorMap& step) {
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (in_system_[i] == 0 || landmarks_[i].extra != kNoExtra) continue;
    LandmarkPoint& point = landmarks_[i].point;
    const Eigen::Vector3d point_step = eliminated_[i].step(step, states_);
    if (point_step.allFinite()) {
      movePoint(point_step, PointBasis::of(point.bearing), point);
    } else {
      in_system_[i] = 0;
    }
  }
}

void Smoother::addPrior() {
  prior_cost_ = 0;
  if (prior_.empty()) return;
  MatrixMap H = system_.H();
  VectorMap g = system_.g();
  MatrixMap prior_H = prior_.H();
  Eigen::Map<Eigen::VectorXd> deviation(step_.data(), prior_.dimension());
  for (const PriorBlock& block : prior_.blocks()) {
    if (block.slot == PriorBlock::kCalibration) {
      deviation.segment(block.offset, block.dimension) = calibrationDeviation().head(block.dimension);
    } else if (block.isExtra()) {
      deviation.segment<kExtraDim>(block.offset) = extras_[block.slot - kMaxStates].deviation();
    } else {
      deviation.segment(block.offset, block.dimension) =
          states_[block.slot].x.minus(block.reference).head(block.dimension);
    }
  }
  for (const PriorBlock& row : prior_.blocks()) {
    const int at = offsetOf(row.slot);
    for (const PriorBlock& column : prior_.blocks()) {
      const int to = offsetOf(column.slot);
      if (to > at) continue;
      H.block(at, to, row.dimension, column.dimension) +=
          prior_H.block(row.offset, column.offset, row.dimension, column.dimension);
    }
    for (int k = 0; k < row.dimension; ++k) {
      double force = 0;
      for (int m = 0; m < prior_.dimension(); ++m) force += prior_H(m, row.offset + k) * deviation[m];
      const double b = prior_.b()[row.offset + k];
      g[at + k] += b + force;
      prior_cost_ += deviation[row.offset + k] * (b + 0.5 * force);
    }
  }
}

Eigen::Matrix<double, kMaxCalibrationDim, 1> Smoother::calibrationDeviation() const {
  Eigen::Matrix<double, kMaxCalibrationDim, 1> d = Eigen::Matrix<double, kMaxCalibrationDim, 1>::Zero();
  if (calibration_.time_offset) d[0] = time_offset_ - time_offset_reference_;
  if (calibration_.extrinsics) {
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      const int at = calibration_.extrinsicOffset(c);
      d.segment<3>(at) = logSo3(T_body_cam_reference_[c].rotation.conjugate() * T_body_cam_[c].rotation);
      d.segment<3>(at + 3) = T_body_cam_[c].translation - T_body_cam_reference_[c].translation;
    }
  }
  return d;
}

void Smoother::addMotionFactor(std::size_t position) {
  if (position == 0) return;
  const WindowState& i = states_[order_[position - 1]];
  const WindowState& j = states_[order_[position]];
  if (!i.has_motion || !j.has_motion || j.link == LinkKind::kNone) return;
  MotionFactor factor;
  const bool valid = j.link == LinkKind::kImu
                         ? imuFactor(j.imu, noise_, i.x, j.x, i.linearization(), j.linearization(), factor)
                         : constantVelocityFactor(j.link_duration, noise_, i.x, j.x, i.linearization(),
                                                  j.linearization(), factor);
  if (!valid) return;
  system_.addMotion(factor, i, j);
  if (position + 1 == order_.size()) {
    statistics_.imu_residual = std::sqrt(factor.residual.head<9>().squaredNorm() / 9.0);
  }
  addRestFactor(i, j);
}

// Rest is soft: the velocity is near zero, and two frames at rest are at nearly the same pose. It
// lives and leaves with the motion factor between the two states, so that the prior inherits it.
void Smoother::addRestFactor(const WindowState& i, const WindowState& j) {
  if (!j.at_rest) return;
  system_.addDiagonal(j, 6, j.x.v_world_body, kRestVelocitySigma);
  if (!i.at_rest) return;
  MotionFactor factor;
  factor.residual.setZero();
  factor.jacobian_i.setZero();
  factor.jacobian_j.setZero();
  factor.residual.segment<3>(0) =
      logSo3(i.x.T_world_body.rotation.conjugate() * j.x.T_world_body.rotation) / kRestRotationSigma;
  factor.residual.segment<3>(3) =
      (j.x.T_world_body.translation - i.x.T_world_body.translation) / kRestPositionSigma;
  factor.jacobian_i.block<3, 3>(0, 0) = -Eigen::Matrix3d::Identity() / kRestRotationSigma;
  factor.jacobian_j.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() / kRestRotationSigma;
  factor.jacobian_i.block<3, 3>(3, 3) = -Eigen::Matrix3d::Identity() / kRestPositionSigma;
  factor.jacobian_j.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() / kRestPositionSigma;
  system_.addMotion(factor, i, j);
}

void Smoother::buildSystem() {
  system_.begin(calibration_, dimension_);
  addPrior();
  for (std::size_t k = 1; k < order_.size(); ++k) addMotionFactor(k);
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (in_system_[i] == 0 || landmarks_[i].extra != kNoExtra) continue;
    if (!system_.addLandmark(viewsOf(landmarks_[i].views()), landmarks_[i].point, states_, &eliminated_[i])) {
      in_system_[i] = 0;
    }
  }
  addExtras();
  system_.finish(states_);
  finishExtras();
}

void Smoother::backup() {
  for (const std::uint8_t slot : order_) backup_[slot] = states_[slot].x;
  for (ExtraState& extra : extras_) extra.backup = extra.x;
  time_offset_backup_ = time_offset_;
  T_body_cam_backup_ = T_body_cam_;
}

void Smoother::restore() {
  for (const std::uint8_t slot : order_) states_[slot].x = backup_[slot];
  time_offset_ = time_offset_backup_;
  T_body_cam_ = T_body_cam_backup_;
  restoreExtras();
}

void Smoother::applyStep(const Eigen::Ref<const Eigen::VectorXd>& step) {
  if (calibration_.time_offset) time_offset_ += step[0];
  if (calibration_.extrinsics) {
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      const int at = calibration_.extrinsicOffset(c);
      T_body_cam_[c].rotation = (T_body_cam_[c].rotation * expSo3(step.segment<3>(at))).normalized();
      T_body_cam_[c].translation += step.segment<3>(at + 3);
    }
  }
  for (const std::uint8_t slot : order_) {
    Vector15d delta = Vector15d::Zero();
    delta.head(states_[slot].dimension()) = step.segment(states_[slot].offset, states_[slot].dimension());
    states_[slot].x.retract(delta);
  }
  retractExtras(step);
}

Status Smoother::solve(int iterations, double pose_tolerance) {
  assignOffsets();
  settlePlanes();
  for (std::size_t k = 1; k < order_.size(); ++k) {
    WindowState& state = states_[order_[k]];
    const WindowState& previous = states_[order_[k - 1]];
    if (!previous.has_motion || state.link != LinkKind::kImu) continue;
    const bool moved = (previous.x.bias_gyro - state.imu.biasGyro()).norm() > kReintegrateGyro ||
                       (previous.x.bias_accel - state.imu.biasAccel()).norm() > kReintegrateAccel;
    // The newest interval but one ended without the sample behind its last image.
    if (moved || k + 2 == order_.size()) integrateLink(state, previous);
  }
  double cost = 0;
  bool factored = false;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    moveEstimates();
    placeCameras();
    if (iteration == 0) triangulateAll(0);
    if (iteration == 1) rejectOutliers(kOutlierSigmas, true);
    buildSystem();
    // The prior's cost has an offset of its own: only differences of the sum mean anything.
    const double total = system_.cost() + prior_cost_;
    if (iteration > 1 && total > cost + kCostIncreaseAllowed * system_.cost()) {
      restore();
      placeCameras();
      triangulateAll(kTriangulationRestart);
      break;
    }
    cost = total;
    MatrixMap H = system_.H();
    for (int k = 0; k < dimension_; ++k) H(k, k) *= 1.0 + kRelativeDamping;
    if (!choleskyInPlace(H)) {
      if (!factored) return {StatusCode::kFailed, "the window's normal equations are singular; reset"};
      break;
    }
    factored = true;
    keepFactor();
    VectorMap step(step_.data(), dimension_);
    step = -system_.g();
    choleskySolve(alignedMap(factor_, dimension_), step);
    if (!step.allFinite()) return {StatusCode::kFailed, "the window's solution is not finite; reset"};
    backup();
    substitutePoints(step);
    applyStep(step);
    statistics_.iterations = iteration + 1;
    if (largestStep(step, calibration_.time_offset, calibration_.dimension(), extra_columns_) < kConverged ||
        largestPoseStep(step, {order_.data(), order_.size()}, states_) < pose_tolerance) {
      break;
    }
  }
  placeCameras();
  rejectOutliers(kFinalOutlierSigmas, true);
  rejectOutliers(kFinalOutlierSigmas, false);
  return okStatus();
}

}  // namespace swiftlet
