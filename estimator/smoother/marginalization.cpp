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
  expandAtReferences(problem, system);
  eliminate(problem, system, checked);
  writePrior(problem, system, checked);
  for (ExtraState& extra : problem.extras.states()) {
    if (extra.leaving) problem.extras.vacate(extra);
  }
}

// Structureless landmarks leave with a keyframe once no recent frame sees them.
bool Marginalization::leaves(const WindowProblem& problem, const Landmark& landmark) const {
  return landmark.extra == kNoExtra && landmark.last_frame < problem.oldest_recent_frame &&
         landmark.sightings.size() >= 2 && landmark.seenFrom(landmarks_of_);
}

// Everything that the prior or a leaving factor touches is frozen: the old prior is re-expanded at the
// current values of states that were not frozen so far.
void Marginalization::involve(WindowProblem& problem, const Departure& departure) {
  involved_.fill(false);
  if (slot_ != kNoSlot) involved_[slot_] = true;
  for (const PriorBlock& block : problem.prior.blocks()) {
    if (block.isState()) involved_[block.slot] = true;
  }
  if (departure.with_motion_factor) involved_[problem.window.order()[departure.position + 1]] = true;
  if (landmarks_of_ != kNoSlot) {
    for (const Landmark& landmark : problem.landmarks) {
      if (!landmark.in_system || !leaves(problem, landmark)) continue;
      for (const Sighting& s : landmark.sightings) involved_[s.slot] = true;
    }
  }
  involveExtras(problem);
  problem.moveEstimates();
  for (const std::uint8_t slot : problem.window.order()) {
    if (involved_[slot]) problem.window.freeze(slot);
  }
  for (std::size_t e = 0; e < kMaxExtraStates; ++e) {
    if (involved_[kMaxStates + e]) problem.extras.states()[e].freeze();
  }
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
      // One that constrains nothing leaves without a trace.
      if (landmark.in_system) {
        static_cast<void>(
            system.addLandmark(problem.viewsOf(landmark.views()), landmark.point, problem.window.slots()));
      }
      problem.landmarks.remove(landmark);
    }
  }
  addDepartingExtras(problem, landmarks_of_ != kNoSlot ? &landmarks_of_ : nullptr, system);
  system.finish(problem.window.slots());
}

// Both triangles, and b at the references: g = b + H d.
void Marginalization::expandAtReferences(const WindowProblem& problem, NormalEquations& system) {
  MatrixMap H = system.H();
  VectorMap g = system.g();
  const int n = problem.dimension;
  for (int c = 0; c < n; ++c) {
    for (int r = c + 1; r < n; ++r) H(c, r) = H(r, c);
  }
  VectorMap d(work_.data(), n);
  d.setZero();
  const int calibration = problem.calibration.dimension();
  d.head(calibration) = problem.calibration.deviation().head(calibration);
  if (problem.intrinsics.estimated()) {
    d.segment<kGyroMatrixDim>(problem.intrinsics.offset()) = problem.intrinsics.deviation();
  }
  for (std::size_t e = 0; e < kMaxExtraStates; ++e) {
    const ExtraState& extra = problem.extras.states()[e];
    if (involved_[kMaxStates + e]) d.segment<kExtraDim>(extra.offset) = extra.deviation();
  }
  for (const std::uint8_t slot : problem.window.order()) {
    if (!involved_[slot]) continue;
    const WindowState& state = problem.window.inSlot(slot);
    d.segment(state.offset, state.dimension()) = state.x.minus(state.first_estimate).head(state.dimension());
  }
  for (int r = 0; r < n; ++r) {
    double sum = 0;
    for (int c = 0; c < n; ++c) sum += H(c, r) * d[c];
    g[r] -= sum;
  }
}

// Extra states one by one, then the body state's columns. What stays: all extra columns, in ranges that need
// not be variables, and the states involved.
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

// The old prior is in the system: its memory takes the new one.
void Marginalization::writePrior(WindowProblem& problem, NormalEquations& system,
                                 const Departure& departure) const {
  Prior& prior = problem.prior;
  prior.begin();
  if (problem.calibration.dimension() > 0) {
    prior.addBlock(PriorBlock::kCalibration, problem.calibration.dimension(), {});
  }
  if (problem.intrinsics.estimated()) prior.addBlock(PriorBlock::kGyroIntrinsics, kGyroMatrixDim, {});
  for (std::size_t e = 0; e < kMaxExtraStates; ++e) {
    if (!involved_[kMaxStates + e] || problem.extras.states()[e].leaving) continue;
    prior.addBlock(static_cast<std::uint8_t>(kMaxStates + e), kExtraDim, {});
  }
  for (const std::uint8_t slot : problem.window.order()) {
    if (!involved_[slot]) continue;
    const WindowState& state = problem.window.inSlot(slot);
    const int dimension = state.dimension() - (slot == slot_ ? departure.count : 0);
    if (dimension > 0) prior.addBlock(slot, dimension, state.first_estimate);
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
