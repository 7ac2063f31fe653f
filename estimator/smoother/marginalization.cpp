#include "estimator/smoother/marginalization.hpp"

#include <algorithm>

#include "estimator/smoother/elimination.hpp"
#include "estimator/smoother/window_factors.hpp"

namespace swiftlet {

Marginalization::Marginalization() : work_(static_cast<std::size_t>(kMaxSystemDim) * kStateDim) {}

void Marginalization::marginalize(WindowProblem& problem, NormalEquations& system,
                                  const Departure& departure) {
  Departure checked = departure;
  checked.with_motion_factor = departure.with_motion_factor && departure.position + 1 < problem.window.size();
  slot_ = departure.count > 0 ? problem.window.order()[departure.position] : kNoSlot;
  landmarks_of_ = departure.with_landmarks ? slot_ : kNoSlot;
  problem.assignOffsets();
  involve(problem, checked);
  build(problem, system, checked);
  eliminate(problem, system, checked);
  writePrior(problem, system, checked);
  for (ExtraState& extra : problem.extras.states()) {
    if (extra.leaving) problem.extras.vacate(extra);
  }
}

// Whether a structureless landmark leaves with the keyframe: if no recent frame sees it.
bool Marginalization::leaves(const WindowProblem& problem, const Landmark& landmark) const {
  return landmark.extra == kNoExtra && landmark.last_frame < problem.oldest_recent_frame &&
         landmark.sightings.size() >= 2 && landmark.seenFrom(landmarks_of_);
}

// Marks the variables that the prior or a leaving factor involves.
void Marginalization::involve(WindowProblem& problem, const Departure& departure) {
  involved_.fill(false);
  if (slot_ != kNoSlot) involved_[slot_] = true;
  for (const PriorBlock& block : problem.prior.blocks()) {
    if (block.isState()) involved_[block.slot] = true;
  }
  if (departure.with_motion_factor) involved_[problem.window.order()[departure.position + 1]] = true;
  if (landmarks_of_ != kNoSlot) {
    for (const Landmark& landmark : problem.landmarks) {
      if (!landmark.accepted() || !leaves(problem, landmark)) continue;
      for (const Sighting& s : landmark.sightings) involved_[s.slot] = true;
    }
  }
  involveExtras(problem);
}

void Marginalization::involveExtras(const WindowProblem& problem) {
  const auto& extras = problem.extras.states();
  for (std::size_t e = 0; e < extras.size(); ++e) {
    const ExtraState& extra = extras[e];
    if (extra.leaving) involved_[kMaxStates + e] = true;
    if (!extra.isLandmark()) continue;
    const Landmark& landmark = problem.landmarks[extra.landmark];
    if (extra.leaving) {
      for (const Sighting& s : landmark.sightings) involved_[s.slot] = true;
    } else if (landmarks_of_ != kNoSlot && landmark.seenFrom(landmarks_of_)) {
      involved_[kMaxStates + e] = true;
    }
  }
  for (const ExtraFactor& factor : problem.extras.factors()) {
    if (!problem.extras.departs(factor) || !problem.extras.counts(factor)) continue;
    involved_[kMaxStates + factor.plane] = true;
    if (factor.tiesPoint()) involved_[kMaxStates + factor.landmark] = true;
  }
}

void Marginalization::build(WindowProblem& problem, NormalEquations& system, const Departure& departure) {
  problem.placeCameras();
  system.begin(problem.calibration.layout(), problem.dimension);
  addPrior(problem, system, work_);
  if (departure.with_motion_factor) addMotion(problem, departure.position + 1, system);
  if (landmarks_of_ != kNoSlot) {
    for (Landmark& landmark : problem.landmarks) {
      if (!leaves(problem, landmark)) continue;
      // A landmark that constrains nothing does not change the prior.
      if (landmark.accepted()) {
        static_cast<void>(
            system.addLandmark(problem.viewsOf(landmark.views()), landmark.point, problem.window.slots()));
      }
      problem.landmarks.remove(landmark);
    }
  }
  addDepartingExtras(problem, landmarks_of_ != kNoSlot ? &landmarks_of_ : nullptr, system);
  system.finish(problem.window.slots());
  MatrixMap H = system.H();
  for (int c = 0; c < problem.dimension; ++c) {
    for (int r = c + 1; r < problem.dimension; ++r) H(c, r) = H(r, c);
  }
}

// Eliminates extra states one by one, then the columns of the body state. What remains: all extra columns, in
// ranges that need not be variables, and the involved states.
void Marginalization::eliminate(const WindowProblem& problem, NormalEquations& system,
                                const Departure& departure) {
  const bool state_leaves = departure.count > 0;
  const ColumnRange body{state_leaves ? problem.window.inSlot(slot_).offset + departure.first : 0,
                         departure.count};
  constexpr std::size_t kMaxRanges =
      kMaxStates + 3 + (kMaxExtraStates * kExtraDim + kStateDim - 1) / kStateDim;
  FixedVector<ColumnRange, kMaxRanges> others;
  const int calibration = problem.calibration.dimension();
  if (calibration > 0) others.pushBack({0, calibration});
  if (problem.intrinsics.estimated()) others.pushBack({problem.intrinsics.offset(), kGyroMatrixDim});
  const int extras = calibration + problem.intrinsics.dimension();
  for (int c = 0; c < problem.extras.columns(); c += kStateDim) {
    others.pushBack({extras + c, std::min(kStateDim, problem.extras.columns() - c)});
  }
  for (const std::uint8_t slot : problem.window.order()) {
    if (!involved_[slot]) continue;
    const WindowState& state = problem.window.inSlot(slot);
    const int dimension = state.dimension() - (slot == slot_ ? departure.count : 0);
    if (dimension > 0) others.pushBack({state.offset, dimension});
  }
  if (state_leaves) others.pushBack(body);
  const auto eliminateRange = [&](const ColumnRange& leaving, std::size_t count) {
    eliminateColumns(system.H(), system.g(), leaving, {others.data(), count}, work_);
  };
  for (const ExtraState& extra : problem.extras.states()) {
    if (extra.leaving) eliminateRange({extra.offset, kExtraDim}, others.size());
  }
  if (state_leaves) eliminateRange(body, others.size() - 1);
}

// The system contains the old prior, so its memory is reused for the new one, whose reference is the current
// values.
void Marginalization::writePrior(WindowProblem& problem, NormalEquations& system,
                                 const Departure& departure) const {
  Prior& prior = problem.prior;
  prior.begin();
  problem.calibration.setReference();
  problem.intrinsics.setReference();
  if (problem.calibration.dimension() > 0) {
    prior.addBlock(PriorBlock::kCalibration, problem.calibration.dimension(), {});
  }
  if (problem.intrinsics.estimated()) prior.addBlock(PriorBlock::kGyroIntrinsics, kGyroMatrixDim, {});
  for (std::size_t e = 0; e < kMaxExtraStates; ++e) {
    if (!involved_[kMaxStates + e] || problem.extras.states()[e].leaving) continue;
    problem.extras.states()[e].enterPrior();
    prior.addBlock(static_cast<std::uint8_t>(kMaxStates + e), kExtraDim, {});
  }
  for (const std::uint8_t slot : problem.window.order()) {
    if (!involved_[slot]) continue;
    const WindowState& state = problem.window.inSlot(slot);
    const int dimension = state.dimension() - (slot == slot_ ? departure.count : 0);
    if (dimension > 0) prior.addBlock(slot, dimension, state.x);
  }
  prior.allocate();
  const MatrixMap H = system.H();
  const VectorMap g = system.g();
  MatrixMap prior_H = prior.H();
  for (const PriorBlock& row : prior.blocks()) {
    const int row_at = problem.offsetOf(row.slot);
    prior.b().segment(row.offset, row.dimension) = g.segment(row_at, row.dimension);
    for (const PriorBlock& column : prior.blocks()) {
      prior_H.block(row.offset, column.offset, row.dimension, column.dimension) =
          H.block(row_at, problem.offsetOf(column.slot), row.dimension, column.dimension);
    }
  }
}

}  // namespace swiftlet
