// What leaves the window, when, and how.

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/elimination.hpp"
#include "estimator/smoother/keyframe_choice.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {
namespace {

// Bias walk within one increment is not modelled: longer intervals are not made by merging.
constexpr double kLongestMergedInterval = 3.0;  // s
// Parts of states that leave in one step because the window is to become shorter: bounds the time. Each new
// keyframe makes at most one of either kind leave, so that two bring the window down.
constexpr int kMaxDropsOfAKind = 2;

}  // namespace

std::size_t Smoother::motionBegin() const {
  std::size_t k = 0;
  while (k < order_.size() && !states_[order_[k]].has_motion) ++k;
  return k;
}

void Smoother::trim(FixedVector<KeyframeState, kMaxStates>& left_window) {
  left_window.clear();
  if (!trim_due_) return;
  trim_due_ = false;
  const auto recent = static_cast<std::size_t>(settings_.max_recent);
  if (order_.size() > recent) oldest_recent_frame_ = states_[order_[order_.size() - recent]].frame_index;
  for (std::size_t k = 0; k + recent < order_.size();) {
    if (!states_[order_[k]].keyframe) {
      dropFrame(k);
    } else {
      ++k;
    }
  }
  const int motion_keyframes = std::min(settings_.max_motion_keyframes, max_keyframes_);
  const auto motion_states = static_cast<std::size_t>(settings_.max_recent + motion_keyframes);
  const auto keyframes = static_cast<std::size_t>(max_keyframes_ - motion_keyframes);
  const auto too_old = [this, recent] {
    return order_.size() > recent &&
           (newest().stamp - states_[order_.front()].stamp).seconds() > settings_.horizon;
  };
  // Each round takes a part of a state away, so there are at most two for each.
  int motions_dropped = 0;
  int keyframes_dropped = 0;
  for (;;) {
    const std::size_t poses = motionBegin();
    if ((order_.size() - poses > motion_states && motions_dropped < kMaxDropsOfAKind) ||
        (poses == 0 && too_old())) {
      dropMotion(poses);
      ++motions_dropped;
    } else if ((poses > keyframes && keyframes_dropped < kMaxDropsOfAKind) || too_old()) {
      const std::size_t k = too_old() ? 0 : chooseKeyframeToDrop(poses);
      static_cast<void>(left_window.tryPushBack(record(states_[order_[k]])));
      dropKeyframe(k);
      ++keyframes_dropped;
    } else {
      break;
    }
  }
  releaseExtras();
}

// A frame between two keyframes: its vision is given up, its two IMU intervals become one.
void Smoother::dropFrame(std::size_t position) {
  const std::uint8_t slot = order_[position];
  removeSightingsOf(slot);
  WindowState& state = states_[slot];
  const bool linked =
      position > 0 && states_[order_[position - 1]].has_motion && position + 1 < order_.size();
  if (!linked || state.frozen) {
    marginalize({position, 0, kStateDim, true, false});
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
  marginalize({position, kPoseDim, kStateDim - kPoseDim, true, false});
  state.has_motion = false;
}

void Smoother::dropKeyframe(std::size_t position) {
  markDepartures(order_[position]);
  marginalize({position, 0, kPoseDim, false, true});
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
    if (landmark.sightings.empty() && landmark.extra == kNoExtra) removeLandmark(landmark);
  }
}

std::size_t Smoother::chooseKeyframeToDrop(std::size_t candidates) const {
  std::array<KeyframeInWindow, kMaxStates> by_slot;
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (landmark_ids_[i] == 0) continue;
    const bool lately = landmarks_[i].last_frame >= oldest_recent_frame_;
    for (const Sighting& s : landmarks_[i].sightings) {
      ++by_slot[s.slot].seen;
      if (lately) ++by_slot[s.slot].shared;
    }
  }
  FixedVector<KeyframeInWindow, kMaxStates> window;
  for (const std::uint8_t slot : order_) {
    const WindowState& state = states_[slot];
    static_cast<void>(
        window.tryPushBack({state.x.T_world_body, state.keyframe, by_slot[slot].seen, by_slot[slot].shared}));
  }
  return keyframeToDrop(window, candidates);
}

void Smoother::freeze(std::uint8_t slot) {
  WindowState& state = states_[slot];
  if (state.frozen) return;
  state.frozen = true;
  state.first_estimate = state.x;
  state.moved_estimate = state.x;
}

// Structureless landmarks leave with a keyframe once no recent frame sees them.
bool Smoother::leavesWith(const Landmark& landmark, std::uint8_t slot) const {
  if (landmark.extra != kNoExtra) return false;
  if (landmark.last_frame >= oldest_recent_frame_ || landmark.sightings.size() < 2) return false;
  return std::any_of(landmark.sightings.begin(), landmark.sightings.end(),
                     [slot](const Sighting& s) { return s.slot == slot; });
}

int Smoother::offsetOf(std::uint8_t slot) const {
  if (slot == PriorBlock::kCalibration) return 0;
  return slot < kMaxStates ? states_[slot].offset : extras_[slot - kMaxStates].offset;
}

void Smoother::buildMarginalSystem(const Departure& departure) {
  const std::uint8_t slot = departure.count > 0 ? order_[departure.position] : kNoSlot;
  const std::uint8_t landmarks_of = departure.with_landmarks ? slot : kNoSlot;
  assignOffsets();
  std::fill(involved_.begin(), involved_.end(), std::uint8_t{0});
  if (slot != kNoSlot) involved_[slot] = 1;
  for (const PriorBlock& block : prior_.blocks()) {
    if (block.slot != PriorBlock::kCalibration) involved_[block.slot] = 1;
  }
  if (departure.with_motion_factor) involved_[order_[departure.position + 1]] = 1;
  if (landmarks_of != kNoSlot) {
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (in_system_[i] == 0 || !leavesWith(landmarks_[i], slot)) continue;
      for (const Sighting& s : landmarks_[i].sightings) involved_[s.slot] = 1;
    }
  }
  involveExtras(landmarks_of);
  moveEstimates();
  // The old prior is re-expanded at the current values of states that were not frozen so far.
  for (const std::uint8_t s : order_) {
    if (involved_[s] != 0) freeze(s);
  }
  for (std::size_t e = 0; e < extras_.size(); ++e) {
    if (involved_[kMaxStates + e] != 0) extras_[e].freeze();
  }
  placeCameras();
  system_.begin(calibration_, dimension_);
  addPrior();
  if (departure.with_motion_factor) addMotionFactor(departure.position + 1);
  if (landmarks_of != kNoSlot) {
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (landmark_ids_[i] == 0 || !leavesWith(landmarks_[i], slot)) continue;
      if (in_system_[i] != 0) {
        static_cast<void>(system_.addLandmark(viewsOf(landmarks_[i].views()), landmarks_[i].point, states_));
      }
      removeLandmark(landmarks_[i]);
    }
  }
  addDepartingFactors(landmarks_of);
  system_.finish(states_);
}

// Both triangles, and b at the references: g = b + H d.
void Smoother::expandAtReferences() {
  MatrixMap H = system_.H();
  VectorMap g = system_.g();
  for (int c = 0; c < dimension_; ++c) {
    for (int r = c + 1; r < dimension_; ++r) H(c, r) = H(r, c);
  }
  VectorMap d(step_.data(), dimension_);
  d.setZero();
  const int calibration_dim = calibration_.dimension();
  d.head(calibration_dim) = calibrationDeviation().head(calibration_dim);
  for (std::size_t e = 0; e < extras_.size(); ++e) {
    if (involved_[kMaxStates + e] != 0) d.segment<kExtraDim>(extras_[e].offset) = extras_[e].deviation();
  }
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
}

// Extra states one by one, then the body state's columns. What stays: all extra columns, in ranges that need
// not be variables, and the states involved.
void Smoother::eliminateDeparture(const Departure& departure) {
  const std::uint8_t slot = departure.count > 0 ? order_[departure.position] : kNoSlot;
  const ColumnRange body{slot != kNoSlot ? states_[slot].offset + departure.first : 0, departure.count};
  constexpr std::size_t kMaxRanges =
      kMaxStates + 2 + (kMaxExtraStates * kExtraDim + kStateDim - 1) / kStateDim;
  FixedVector<ColumnRange, kMaxRanges> others;
  const int calibration_dim = calibration_.dimension();
  if (calibration_dim > 0) static_cast<void>(others.tryPushBack({0, calibration_dim}));
  for (int c = 0; c < extra_columns_; c += kStateDim) {
    static_cast<void>(others.tryPushBack({calibration_dim + c, std::min(kStateDim, extra_columns_ - c)}));
  }
  for (const std::uint8_t s : order_) {
    if (involved_[s] == 0) continue;
    const int dimension = states_[s].dimension() - (s == slot ? departure.count : 0);
    if (dimension > 0) static_cast<void>(others.tryPushBack({states_[s].offset, dimension}));
  }
  const auto eliminate = [this, &others](const ColumnRange& leaving, std::size_t count) {
    eliminateColumns(system_.H(), system_.g(), leaving, {others.data(), count}, columns_i_);
  };
  if (departure.count > 0) static_cast<void>(others.tryPushBack(body));
  for (const ExtraState& extra : extras_) {
    if (extra.leaving) eliminate({extra.offset, kExtraDim}, others.size());
  }
  if (departure.count > 0) eliminate(body, others.size() - 1);
}

void Smoother::marginalize(const Departure& departure) {
  Departure checked = departure;
  checked.with_motion_factor = departure.with_motion_factor && departure.position + 1 < order_.size();
  buildMarginalSystem(checked);
  expandAtReferences();
  eliminateDeparture(departure);
  // The old prior is in the system: its memory takes the new one.
  const std::uint8_t slot = departure.count > 0 ? order_[departure.position] : kNoSlot;
  prior_.begin();
  if (calibration_.dimension() > 0) prior_.addBlock(PriorBlock::kCalibration, calibration_.dimension(), {});
  for (std::size_t e = 0; e < extras_.size(); ++e) {
    const std::size_t extra_slot = kMaxStates + e;
    if (involved_[extra_slot] == 0 || extras_[e].leaving) continue;
    prior_.addBlock(static_cast<std::uint8_t>(extra_slot), kExtraDim, {});
  }
  for (const std::uint8_t s : order_) {
    if (involved_[s] == 0) continue;
    const int dimension = states_[s].dimension() - (s == slot ? departure.count : 0);
    if (dimension > 0) prior_.addBlock(s, dimension, states_[s].first_estimate);
  }
  prior_.allocate();
  const MatrixMap H = system_.H();
  const VectorMap g = system_.g();
  MatrixMap prior_H = prior_.H();
  for (const PriorBlock& row : prior_.blocks()) {
    const int row_at = offsetOf(row.slot);
    prior_.b().segment(row.offset, row.dimension) = g.segment(row_at, row.dimension);
    for (const PriorBlock& column : prior_.blocks()) {
      prior_H.block(row.offset, column.offset, row.dimension, column.dimension) =
          H.block(row_at, offsetOf(column.slot), row.dimension, column.dimension);
    }
  }
  for (ExtraState& extra : extras_) {
    if (extra.leaving) freeExtra(extra);
  }
}

}  // namespace swiftlet
