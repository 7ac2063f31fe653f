// What leaves the window, when, and how.

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {
namespace {

// A keyframe with less than this share of its landmarks seen lately has nothing to add.
constexpr double kMinSharedLandmarks = 0.05;
// One radian of turn separates two keyframes as much as this distance.
constexpr double kMetresPerRadian = 1.0;
constexpr double kMinDistance = 1e-2;  // m, keeps the score finite
// Eigenvalues below this share of the largest are not information.
constexpr double kRelativeRank = 1e-12;
// Bias walk within one increment is not modelled: longer intervals are not made by merging.
constexpr double kLongestMergedInterval = 3.0;  // s

double separation(const BodyState& a, const BodyState& b) {
  return (a.T_world_body.translation - b.T_world_body.translation).norm() +
         kMetresPerRadian * a.T_world_body.rotation.angularDistance(b.T_world_body.rotation) + kMinDistance;
}

}  // namespace

std::size_t Smoother::motionBegin() const {
  std::size_t k = 0;
  while (k < order_.size() && !states_[order_[k]].has_motion) ++k;
  return k;
}

void Smoother::trimWindow(FixedVector<KeyframeState, kMaxStates>& left_window) {
  const auto recent = static_cast<std::size_t>(settings_.max_recent);
  if (order_.size() > recent) oldest_recent_frame_ = states_[order_[order_.size() - recent]].frame_index;
  for (std::size_t k = 0; k + recent < order_.size();) {
    if (!states_[order_[k]].keyframe) {
      dropFrame(k);
    } else {
      ++k;
    }
  }
  const auto motion_states = static_cast<std::size_t>(settings_.max_recent + settings_.max_motion_keyframes);
  const auto keyframes = static_cast<std::size_t>(settings_.max_keyframes - settings_.max_motion_keyframes);
  const auto too_old = [this, recent] {
    return order_.size() > recent &&
           (newest().stamp - states_[order_.front()].stamp).seconds() > settings_.horizon;
  };
  // Each round takes a part of a state away, so there are at most two for each.
  for (;;) {
    const std::size_t poses = motionBegin();
    if (order_.size() - poses > motion_states || (poses == 0 && too_old())) {
      dropMotion(poses);
    } else if (poses > keyframes || too_old()) {
      const std::size_t k = too_old() ? 0 : chooseKeyframeToDrop(poses);
      static_cast<void>(left_window.tryPushBack(record(states_[order_[k]])));
      dropKeyframe(k);
    } else {
      break;
    }
  }
}

// A frame between two keyframes: its vision is given up, its two IMU intervals become one.
void Smoother::dropFrame(std::size_t position) {
  const std::uint8_t slot = order_[position];
  removeSightingsOf(slot);
  WindowState& state = states_[slot];
  const bool linked =
      position > 0 && states_[order_[position - 1]].has_motion && position + 1 < order_.size();
  if (!linked || state.frozen) {
    marginalize(position, 0, kStateDim, true, false);
    removeState(position);
    return;
  }
  WindowState& next = states_[order_[position + 1]];
  const WindowState& previous = states_[order_[position - 1]];
  next.link_duration += state.link_duration;
  if (state.link == LinkKind::kConstantVelocity) next.link = LinkKind::kConstantVelocity;
  removeState(position);
  if (next.link == LinkKind::kImu) integrateLink(next, previous);
  if (next.link_duration > kLongestMergedInterval) next.keyframe = true;
}

void Smoother::dropMotion(std::size_t position) {
  WindowState& state = states_[order_[position]];
  state.covariance = record(state).state.covariance;
  marginalize(position, kPoseDim, kStateDim - kPoseDim, true, false);
  state.has_motion = false;
}

void Smoother::dropKeyframe(std::size_t position) {
  marginalize(position, 0, kPoseDim, false, true);
  removeSightingsOf(order_[position]);
  removeState(position);
}

void Smoother::removeState(std::size_t position) {
  states_[order_[position]].used = false;
  order_.erase(position);
}

void Smoother::removeSightingsOf(std::uint8_t slot) {
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (landmark_ids_[i] == 0) continue;
    Landmark& landmark = landmarks_[i];
    for (std::size_t s = 0; s < landmark.sightings.size(); ++s) {
      if (landmark.sightings[s].slot == slot) {
        landmark.sightings.erase(s);
        break;
      }
    }
    if (landmark.sightings.empty()) removeLandmark(landmark);
  }
}

// First a keyframe whose landmarks are out of sight; else the one in the densest place, seen from
// the newest (the distance score of Engel et al., "Direct Sparse Odometry", PAMI 2018, eq. 20).
std::size_t Smoother::chooseKeyframeToDrop(std::size_t candidates) const {
  std::array<int, kMaxStates> seen{};
  std::array<int, kMaxStates> shared{};
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (landmark_ids_[i] == 0) continue;
    const bool lately = landmarks_[i].last_frame >= oldest_recent_frame_;
    for (const Sighting& s : landmarks_[i].sightings) {
      ++seen[s.slot];
      if (lately) ++shared[s.slot];
    }
  }
  std::size_t best = 0;
  double best_score = -1;
  for (std::size_t k = 0; k < candidates; ++k) {
    const std::uint8_t slot = order_[k];
    if (shared[slot] < kMinSharedLandmarks * seen[slot] || seen[slot] == 0) return k;
    double density = 0;
    for (std::size_t m = 0; m < order_.size(); ++m) {
      if (m != k && states_[order_[m]].keyframe)
        density += 1.0 / separation(states_[slot].x, states_[order_[m]].x);
    }
    const double score = std::sqrt(separation(states_[slot].x, newest().x)) * density;
    if (score > best_score) {
      best_score = score;
      best = k;
    }
  }
  return best;
}

void Smoother::freeze(std::uint8_t slot) {
  WindowState& state = states_[slot];
  if (state.frozen) return;
  state.frozen = true;
  state.first_estimate = state.x;
  state.moved_estimate = state.x;
}

// Landmarks leave with a keyframe once no recent frame sees them.
bool Smoother::leavesWith(const Landmark& landmark, std::uint8_t slot) const {
  if (landmark.last_frame >= oldest_recent_frame_ || landmark.sightings.size() < 2) return false;
  return std::any_of(landmark.sightings.begin(), landmark.sightings.end(),
                     [slot](const Sighting& s) { return s.slot == slot; });
}

void Smoother::buildMarginalSystem(std::size_t position, bool with_motion_factor, bool with_landmarks) {
  const std::uint8_t slot = order_[position];
  assignOffsets();
  std::fill(involved_.begin(), involved_.end(), 0);
  involved_[slot] = 1;
  for (const PriorBlock& block : prior_.blocks()) {
    if (block.slot != PriorBlock::kCalibration) involved_[block.slot] = 1;
  }
  if (with_motion_factor) involved_[order_[position + 1]] = 1;
  if (with_landmarks) {
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (in_system_[i] == 0 || !leavesWith(landmarks_[i], slot)) continue;
      for (const Sighting& s : landmarks_[i].sightings) involved_[s.slot] = 1;
    }
  }
  moveEstimates();
  // The old prior is re-expanded at the current values of states that were not frozen so far.
  for (const std::uint8_t s : order_) {
    if (involved_[s] != 0) freeze(s);
  }
  placeCameras();
  system_.begin(calibration_, dimension_);
  addPrior();
  if (with_motion_factor) addMotionFactor(position + 1);
  if (with_landmarks) {
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (landmark_ids_[i] == 0 || !leavesWith(landmarks_[i], slot)) continue;
      if (in_system_[i] != 0) {
        static_cast<void>(system_.addLandmark(landmarks_[i], rig_poses_, T_body_cam_, states_));
      }
      removeLandmark(landmarks_[i]);
    }
  }
  system_.finish(states_);
}

void Smoother::marginalize(std::size_t position, int first, int count, bool with_motion_factor,
                           bool with_landmarks) {
  const std::uint8_t slot = order_[position];
  buildMarginalSystem(position, with_motion_factor && position + 1 < order_.size(), with_landmarks);
  MatrixMap H = system_.H();
  VectorMap g = system_.g();
  for (int c = 0; c < dimension_; ++c) {
    for (int r = c + 1; r < dimension_; ++r) H(c, r) = H(r, c);
  }

  // b at the references: g = b + H d.
  VectorMap d(step_.data(), dimension_);
  d.setZero();
  const int calibration_dim = calibration_.dimension();
  d.head(calibration_dim) = calibrationDeviation().head(calibration_dim);
  for (const std::uint8_t s : order_) {
    if (involved_[s] == 0) continue;
    d.segment(states_[s].offset, states_[s].dimension()) =
        states_[s].x.minus(states_[s].first_estimate).head(states_[s].dimension());
  }
  for (int r = 0; r < dimension_; ++r) {
    double sum = 0;
    for (int c = 0; c < dimension_; ++c) sum += H(c, r) * d[c];
    g[r] -= sum;
  }

  using MarginalMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStateDim, kStateDim>;
  const int at = states_[slot].offset + first;
  const MarginalMatrix H_mm = H.block(at, at, count, count);
  const Eigen::SelfAdjointEigenSolver<MarginalMatrix> eigen(H_mm);
  const double floor = kRelativeRank * std::max(eigen.eigenvalues().maxCoeff(), 1.0);
  // Columns of U / sqrt(lambda): H_mm^+ = W W^T.
  MarginalMatrix W = eigen.eigenvectors();
  for (int k = 0; k < count; ++k) {
    const double lambda = eigen.eigenvalues()[k];
    W.col(k) *= lambda > floor ? 1.0 / std::sqrt(lambda) : 0.0;
  }

  next_prior_.begin();
  if (calibration_dim > 0) next_prior_.addBlock(PriorBlock::kCalibration, calibration_dim, {});
  for (const std::uint8_t s : order_) {
    if (involved_[s] == 0) continue;
    const int dimension = s == slot ? states_[s].dimension() - count : states_[s].dimension();
    if (dimension > 0) next_prior_.addBlock(s, dimension, states_[s].first_estimate);
  }
  next_prior_.allocate();
  const auto offset_of = [this](const PriorBlock& b) {
    return b.slot == PriorBlock::kCalibration ? 0 : states_[b.slot].offset;
  };
  MatrixMap next_H = next_prior_.H();
  VectorMap next_b = next_prior_.b();
  Eigen::Matrix<double, kStateDim, 1> w_b = Eigen::Matrix<double, kStateDim, 1>::Zero();
  w_b.head(count) = W.transpose() * g.segment(at, count);
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStateDim, kStateDim>;
  for (const PriorBlock& row : next_prior_.blocks()) {
    const int row_at = offset_of(row);
    const Rows row_w = H.block(row_at, at, row.dimension, count) * W;
    next_b.segment(row.offset, row.dimension) = g.segment(row_at, row.dimension) - row_w * w_b.head(count);
    for (const PriorBlock& column : next_prior_.blocks()) {
      const int column_at = offset_of(column);
      const Rows column_w = H.block(column_at, at, column.dimension, count) * W;
      next_H.block(row.offset, column.offset, row.dimension, column.dimension) =
          H.block(row_at, column_at, row.dimension, column.dimension) - row_w * column_w.transpose();
    }
  }
  std::swap(prior_, next_prior_);
}

}  // namespace swiftlet
