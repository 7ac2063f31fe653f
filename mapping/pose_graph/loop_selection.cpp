#include "mapping/pose_graph/loop_selection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/pose_graph/chance_limit.hpp"

namespace swiftlet {
namespace {

/// docs/experiments/pose_graph.md has the figures behind these.
constexpr double kPlaneChance = 1e-4;
constexpr double kSpaceChance = 1e-2;

/// Probability that chi-squared of 3 degrees of freedom exceeds x; of 6 its closed form is a polynomial.
double tailOf(int degrees_of_freedom, double x) {
  const double half = 0.5 * x;
  if (degrees_of_freedom == 3) {
    return std::erfc(std::sqrt(half)) + 2 * std::sqrt(half / M_PI) * std::exp(-half);
  }
  return std::exp(-half) * (1 + half + 0.5 * half * half);
}

}  // namespace

double chiSquaredOfTail(int degrees_of_freedom, double tail) {
  // The tail falls strictly; 2000 is beyond what doubles can tell from 0.
  double low = 0;
  double high = 2000;
  constexpr int kHalvings = 60;  // to rounding
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    (tailOf(degrees_of_freedom, middle) > tail ? low : high) = middle;
  }
  return high;
}

template <typename Pose>
LoopSelectionSettings loopSelectionSettings(double tail) {
  LoopSelectionSettings settings;
  settings.gate_chi_squared = chiSquaredOfTail(PoseSpace<Pose>::kDof, tail);
  settings.pair_chi_squared = settings.gate_chi_squared;
  settings.max_pair_chance = PoseSpace<Pose>::kDof == 3 ? kPlaneChance : kSpaceChance;
  return settings;
}

template <typename Pose>
LoopSelection<Pose>::LoopSelection(const LoopSelectionLimits& limits, const LoopSelectionSettings& settings)
    : limits_(limits),
      settings_(settings),
      chain_(limits.max_poses),
      consistency_(limits.max_loops),
      support_(limits.max_loops),
      clique_(limits.max_loops),
      sets_(consistency_.words()),
      chosen_(consistency_.words()),
      scratch_(consistency_.words()) {
  held_.reserve(limits.max_loops);
  groups_.reserve(limits.max_loops);
  selected_.reserve(limits.max_loops);
  carried_.reserve(limits.max_loops);
  least_chances_.reserve(limits.max_loops);
}

template <typename Pose>
Status LoopSelection<Pose>::addLoop(const RelativePose<Pose>& loop, std::uint32_t max_nodes,
                                    std::uint32_t& id) {
  const Status status = place(loop, id);
  if (status.ok()) {
    extend(id, max_nodes);
    weighRival(held_[id].group, max_nodes);
    select();
  }
  return status;
}

template <typename Pose>
Status LoopSelection<Pose>::holdLoop(const RelativePose<Pose>& loop, std::uint32_t& id) {
  return place(loop, id);
}

template <typename Pose>
Status LoopSelection<Pose>::place(const RelativePose<Pose>& loop, std::uint32_t& id) {
  const bool known = loop.from < chain_.size() && loop.to < chain_.size() && loop.from != loop.to;
  if (!known || !allFinite(loop.T_from_to) || !loop.information.allFinite()) {
    ++counters_.refused;
    return {StatusCode::kInvalidInput, "a loop is not finite or does not connect two poses of the odometry"};
  }
  Held held;
  held.loop = loop;
  held.chained = chainLoop(chain_, loop);
  if (!held.chained.covariance.allFinite()) {
    ++counters_.refused;
    return {StatusCode::kInvalidInput, "a loop has no information"};
  }
  id = this->held();
  if (id == limits_.max_loops) {
    if (!findLeast(id)) {
      ++counters_.refused;
      return {StatusCode::kCapacityReached, "the limit of loops is reached, and all of them agree"};
    }
    ++counters_.replaced;
    leave(id);
  } else {
    held_.emplace_back();
  }
  held.arrival = arrivals_++;
  held.group = groupOf(held.chained);
  held_[id] = held;
  ++counters_.added;
  testGate(held_[id]);
  if (held_[id].passed) {
    testPairs(id);
  }
  return okStatus();
}

/// The held loop that gives way to a new one; false when all are in the sets.
template <typename Pose>
bool LoopSelection<Pose>::findLeast(std::uint32_t& id) const {
  std::uint32_t least = 0;
  bool found = false;
  for (std::uint32_t k = 0; k < held(); ++k) {
    if (held_[k].released) {
      id = k;
      return true;
    }
    if (testBit(sets_, k)) {
      continue;
    }
    const std::uint32_t agreeing = countBits(consistency_.row(k));
    if (!found || agreeing < least || (agreeing == least && held_[k].arrival < held_[id].arrival)) {
      found = true;
      least = agreeing;
      id = k;
    }
  }
  return found;
}

template <typename Pose>
std::uint32_t LoopSelection<Pose>::groupOf(const ChainedLoop<Pose>& chained) {
  for (std::uint32_t k = 0; k < groups_.size(); ++k) {
    if (groups_[k].from == chained.from_component && groups_[k].to == chained.to_component) {
      return k;
    }
  }
  for (std::uint32_t k = 0; k < groups_.size(); ++k) {
    // Reuse a group without loops.
    const auto uses = [&](const Held& held) { return held.group == k; };
    if (groups_[k].size == 0 && std::none_of(held_.begin(), held_.end(), uses)) {
      groups_[k] = {chained.from_component, chained.to_component, 0, true};
      return k;
    }
  }
  groups_.push_back({chained.from_component, chained.to_component, 0, true});
  return static_cast<std::uint32_t>(groups_.size()) - 1;
}

template <typename Pose>
void LoopSelection<Pose>::testGate(Held& held) const {
  held.gate = held.chained.withinComponent() ? odometryTest(chain_, held.chained) : CycleTest{0, 0};
  held.passed = held.gate.chi_squared <= settings_.gate_chi_squared;
  held.log_chance = held.least_log_chance = std::numeric_limits<double>::infinity();
  if (!held.chained.withinComponent()) return;
  const double log_box = chain_.logBox(held.chained.to);
  held.log_chance = logChance<Pose>(held.gate, log_box);
  held.least_log_chance = logChance<Pose>({0, held.gate.log_deviation}, log_box);
}

template <typename Pose>
void LoopSelection<Pose>::limitGateChance() {
  least_chances_.clear();
  for (const Held& held : held_) {
    if (!held.released && held.chained.withinComponent()) least_chances_.push_back(held.least_log_chance);
  }
  log_gate_limit_ =
      std::min(std::log(settings_.max_gate_chance), logChanceLimit(settings_.max_false, least_chances_));
}

template <typename Pose>
void LoopSelection<Pose>::testPairs(std::uint32_t id) {
  const Held& a = held_[id];
  const PairTest<Pose> test(chain_, a.chained);
  const double log_chance = std::log(settings_.max_pair_chance);
  // A false loop between two components may lead anywhere in the larger one.
  const bool within = a.chained.withinComponent();
  const double log_room =
      within ? 0 : std::max(chain_.logWholeBox(a.chained.from), chain_.logWholeBox(a.chained.to));
  for (std::uint32_t k = 0; k < held(); ++k) {
    const Held& b = held_[k];
    if (k == id || !b.passed || b.group != a.group) {
      continue;
    }
    ++counters_.pair_tests;
    const CycleTest pair = test.against(b.chained);
    if (pair.chi_squared > settings_.pair_chi_squared) {
      continue;
    }
    consistency_.connect(id, k);
    const double log_box = within ? chain_.logBox(std::max(a.chained.to, b.chained.to)) : log_room;
    if (logChance<Pose>(pair, log_box) <= log_chance) {
      support_.connect(id, k);
    }
  }
}

template <typename Pose>
void LoopSelection<Pose>::extend(std::uint32_t id, std::uint32_t max_nodes) {
  if (!held_[id].passed) {
    return;
  }
  Group& group = groups_[held_[id].group];
  const ConstBitSet row = consistency_.row(id);
  if (countBoth(row, sets_) == group.size) {
    setBit(sets_, id);
    ++group.size;
    return;
  }
  if (countBits(row) < group.size) {
    return;
  }
  const CliqueResult result = clique_.search(consistency_, row, group.size - 1, max_nodes, scratch_);
  counters_.nodes += result.nodes;
  group.exact = group.exact && result.exact;
  if (result.size > 0) {
    setBit(scratch_, id);
    replaceSet(held_[id].group);
  }
}

/// The set of the group becomes scratch_.
template <typename Pose>
void LoopSelection<Pose>::replaceSet(std::uint32_t group) {
  for (std::uint32_t k = 0; k < held(); ++k) {
    if (held_[k].group == group) {
      clearBit(sets_, k);
    }
  }
  for (std::size_t w = 0; w < sets_.size(); ++w) {
    sets_[w] |= scratch_[w];
  }
  groups_[group].size = countBits(scratch_);
}

template <typename Pose>
void LoopSelection<Pose>::searchGroup(std::uint32_t group, std::uint32_t max_nodes) {
  std::fill(scratch_.begin(), scratch_.end(), 0);
  replaceSet(group);
  std::vector<std::uint64_t>& candidates = chosen_;  // made anew by select()
  std::fill(candidates.begin(), candidates.end(), 0);
  for (std::uint32_t k = 0; k < held(); ++k) {
    if (held_[k].group == group && held_[k].passed) {
      setBit(candidates, k);
    }
  }
  const CliqueResult result = clique_.search(consistency_, candidates, 0, max_nodes, scratch_);
  counters_.nodes += result.nodes;
  groups_[group].exact = result.exact;
  if (result.size > 0) {
    replaceSet(group);
  }
  weighRival(group, max_nodes);
}

/// Size of the largest set that contradicts the group's, among loops that agree with less than half of it.
template <typename Pose>
void LoopSelection<Pose>::weighRival(std::uint32_t group, std::uint32_t max_nodes) {
  Group& ties = groups_[group];
  ties.rival = 0;
  if (ties.from == ties.to) {
    return;
  }
  std::vector<std::uint64_t>& against = chosen_;  // made anew by select()
  std::fill(against.begin(), against.end(), 0);
  for (std::uint32_t k = 0; k < held(); ++k) {
    const bool asked = held_[k].group == group && held_[k].passed && !testBit(sets_, k);
    if (asked && 2 * countBoth(consistency_.row(k), sets_) < ties.size) {
      setBit(against, k);
    }
  }
  const CliqueResult result = clique_.search(consistency_, against, 0, max_nodes, scratch_);
  counters_.nodes += result.nodes;
  ties.rival = result.size;
}

template <typename Pose>
void LoopSelection<Pose>::search(std::uint32_t max_nodes) {
  for (std::uint32_t group = 0; group < groups_.size(); ++group) {
    searchGroup(group, max_nodes);
  }
  select();
}

/// Takes the loop out of pairs and sets.
template <typename Pose>
void LoopSelection<Pose>::leave(std::uint32_t id) {
  consistency_.disconnect(id);
  support_.disconnect(id);
  if (testBit(sets_, id)) {
    clearBit(sets_, id);
    --groups_[held_[id].group].size;
  }
}

template <typename Pose>
void LoopSelection<Pose>::giveUp(std::uint32_t id) {
  leave(id);
  held_[id].passed = false;
  held_[id].released = true;
  ++counters_.released;
}

template <typename Pose>
Status LoopSelection<Pose>::release(std::uint32_t id) {
  if (id >= held() || held_[id].released) {
    return {StatusCode::kInvalidInput, "no such loop"};
  }
  giveUp(id);
  select();
  return okStatus();
}

/// Names `onto` in the place of `pose`. With T_pose_onto <- T_pose_onto Exp(eta), cov(eta) = Q, and the
/// loop's Z <- Z Exp(zeta):  Z T_pose_onto has the error Ad(T_onto_pose) zeta + eta, T_onto_pose Z has zeta -
/// Ad((T_onto_pose Z)^-1) eta.
template <typename Pose>
void LoopSelection<Pose>::carry(RelativePose<Pose>& loop, std::uint32_t pose, std::uint32_t onto) const {
  using Matrix = PoseMatrix<Pose>;
  const Pose T_onto_pose = chain_.relative(onto, pose);
  const Matrix turned = poseAdjoint(T_onto_pose);
  const Matrix Q = pose < onto ? chain_.covariance(pose, onto)
                               : Matrix(turned * chain_.covariance(onto, pose) * turned.transpose());
  Matrix R = covarianceFromInformation(loop.information);
  if (loop.to == pose) {
    loop.T_from_to = loop.T_from_to * T_onto_pose.inverse();
    R = turned * R * turned.transpose() + Q;
    loop.to = onto;
  } else {
    loop.T_from_to = T_onto_pose * loop.T_from_to;
    const Matrix back = poseAdjoint(loop.T_from_to.inverse());
    R += back * Q * back.transpose();
    loop.from = onto;
  }
  loop.information = informationFromCovariance(R);
}

template <typename Pose>
Status LoopSelection<Pose>::removePose(std::uint32_t pose, std::uint32_t onto) {
  const bool known = pose + 1 < chain_.size() && onto < chain_.size();
  if (!known || chain_.component(pose) != chain_.component(onto)) {
    return {StatusCode::kInvalidInput,
            "no such pose to remove, or no neighbour that can take over its loops"};
  }
  carried_.clear();
  for (std::uint32_t k = 0; k < held(); ++k) {
    RelativePose<Pose>& loop = held_[k].loop;
    if (held_[k].released || (loop.from != pose && loop.to != pose)) {
      continue;
    }
    if (pose == onto || loop.from == onto || loop.to == onto) {
      giveUp(k);
      continue;
    }
    carry(loop, pose, onto);
    carried_.push_back(k);
  }
  chain_.erase(pose);
  const auto moveDown = [pose](std::uint32_t& k) { k -= k > pose ? 1U : 0U; };
  for (Held& held : held_) {
    moveDown(held.loop.from);
    moveDown(held.loop.to);
    moveDown(held.chained.from);
    moveDown(held.chained.to);
  }
  for (const std::uint32_t k : carried_) {
    held_[k].chained = chainLoop(chain_, held_[k].loop);
  }
  counters_.carried += carried_.size();
  select();
  return okStatus();
}

template <typename Pose>
void LoopSelection<Pose>::select() {
  if (settings_.pairwise) {
    chosen_ = sets_;
    dropUnsupported();
  } else {
    std::fill(chosen_.begin(), chosen_.end(), 0);
    for (std::uint32_t k = 0; k < held(); ++k) {
      if (held_[k].passed) {
        setBit(chosen_, k);
      }
    }
  }
  selected_.clear();
  forEachBit(ConstBitSet(chosen_), [&](std::uint32_t k) { selected_.push_back(k); });
}

template <typename Pose>
void LoopSelection<Pose>::dropUnsupported() {
  limitGateChance();
  for (bool changed = true; changed;) {
    changed = false;
    forEachBit(ConstBitSet(chosen_), [&](std::uint32_t k) {
      const bool proven = held_[k].log_chance <= log_gate_limit_;
      if (!proven && countBoth(support_.row(k), chosen_) < settings_.min_support) {
        clearBit(chosen_, k);
        changed = true;
      }
    });
  }
  for (std::uint32_t group = 0; group < groups_.size(); ++group) {
    if (groups_[group].from == groups_[group].to || groups_[group].size == 0) {
      continue;
    }
    const auto chosen = [&](std::uint32_t k) { return held_[k].group == group && testBit(chosen_, k); };
    std::uint32_t count = 0;
    for (std::uint32_t k = 0; k < held(); ++k) {
      count += chosen(k) ? 1U : 0U;
    }
    const double lead = static_cast<double>(count) - groups_[group].rival;
    const double all = static_cast<double>(count) + groups_[group].rival;
    const bool beyond_doubt = lead > 0 && lead * lead >= settings_.min_between * all;
    for (std::uint32_t k = 0; !beyond_doubt && k < held(); ++k) {
      if (chosen(k)) {
        clearBit(chosen_, k);
      }
    }
  }
}

template <typename Pose>
LoopVerdict LoopSelection<Pose>::verdict(std::uint32_t id) const {
  if (testBit(chosen_, id)) {
    return LoopVerdict::kSelected;
  }
  if (held_[id].released) {
    return LoopVerdict::kReleased;
  }
  if (!held_[id].passed) {
    return LoopVerdict::kAgainstOdometry;
  }
  return testBit(sets_, id) ? LoopVerdict::kUnsupported : LoopVerdict::kInconsistent;
}

template <typename Pose>
bool LoopSelection<Pose>::exact() const {
  return std::all_of(groups_.begin(), groups_.end(), [](const Group& group) { return group.exact; });
}

template LoopSelectionSettings loopSelectionSettings<SE2>(double);
template LoopSelectionSettings loopSelectionSettings<SE3>(double);
template class LoopSelection<SE2>;
template class LoopSelection<SE3>;

}  // namespace swiftlet
