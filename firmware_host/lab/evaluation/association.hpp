#pragma once
// Pairs of estimate and truth at the same instants.
//
// The truth is interpolated at the estimate's stamps (position linear, rotation SLERP) between the two
// neighbouring poses, if they are at most `max_gap` apart. If a truth pose has exactly that stamp, it is used
// directly, so that files with common stamps give the same results as evo. Nothing is extrapolated. Cost
// O(estimates log truths).

#include <optional>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {

struct AssociationOptions {
  Duration max_gap = Duration::fromMilliseconds(20);
  std::optional<Stamp> from;   ///< earlier estimates are omitted
  std::optional<Stamp> until;  ///< later estimates are omitted

  [[nodiscard]] bool inSection(Stamp stamp) const {
    return (!from || stamp >= *from) && (!until || stamp <= *until);
  }
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
  std::size_t without_truth = 0;  ///< of these, without truth near enough
};

/// Both in time order.
Association associate(const Trajectory& estimate, const Trajectory& truth, const AssociationOptions& options);

/// The truth at `stamp`; empty if it is outside the truth or in too long a gap.
std::optional<SE3> interpolate(const Trajectory& truth, Stamp stamp, Duration max_gap);

}  // namespace swiftlet
