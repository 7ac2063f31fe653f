#pragma once
// Pairs of estimate and truth at the same instants.
//
// The truth is interpolated at the estimate's stamps (position linear, rotation SLERP) between the two
// poses around it, when they are at most `max_gap` apart. Where a truth pose has exactly that stamp it
// is taken as it is, so that files with common stamps give what evo gives. Nothing is extrapolated.
// Cost O(estimates log truths).

#include <optional>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {

struct AssociationOptions {
  Duration max_gap = Duration::fromMilliseconds(20);
  std::optional<Stamp> from;   ///< estimates earlier than this are left out
  std::optional<Stamp> until;  ///< estimates later than this are left out
};

struct PosePair {
  Stamp stamp;
  SE3 estimate;
  SE3 truth;
  std::size_t estimate_index = 0;  ///< in the trajectory given
};

struct Association {
  std::vector<PosePair> pairs;
  std::size_t estimates = 0;      ///< estimates within [from, until]
  std::size_t without_truth = 0;  ///< of them, those with no truth near enough
};

/// Both in time order.
Association associate(const Trajectory& estimate, const Trajectory& truth, const AssociationOptions& options);

/// The truth at `stamp`; empty if it does not reach or the gap is too long.
std::optional<SE3> interpolate(const Trajectory& truth, Stamp stamp, Duration max_gap);

}  // namespace swiftlet
