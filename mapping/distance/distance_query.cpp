// Queries of a distance field, from any thread.

#include <cmath>

#include "mapping/distance/distance_field.hpp"
#include "mapping/distance/distance_word.hpp"

namespace swiftlet {
namespace {

// Maximum number of moves along the surface in a query. On logs it needs one or two.
constexpr int kMostDescents = 4;

Eigen::Vector3i cornerOf(int i) { return {i & 1, i >> 1 & 1, i >> 2 & 1}; }

}  // namespace

/// A cell that holds surface, relative to the first corner of a query [cells].
struct DistanceField::Holder {
  Eigen::Vector3i cell;
  std::uint32_t state = 0;
  [[nodiscard]] float squaredTo(const Eigen::Vector3f& p) const {
    return StateWord::squaredTo(state, cell.cast<float>() - p);
  }
};

/// What a query reads of one of the eight cells around the point.
struct DistanceField::Corner {
  Space space = Space::kUnknown;
  std::uint32_t nearest = 0;  ///< NearestWord
  bool held = false;          ///< its nearest surface is still there
  Holder holder;
  /// Lower bound of the distance from the cell's centre to any surface [cells].
  [[nodiscard]] float atLeast() const {
    if ((nearest & NearestWord::kHasSurface) == 0) return NearestWord::atLeast(nearest);
    return NearestWord::steps(nearest).cast<float>().norm() - NearestWord::kSpread;
  }
};

/// Reads the eight cells. False if a word belongs to another cell: the point is outside the window, or the
/// window is moving.
bool DistanceField::corners(const Eigen::Vector3i& first, std::array<Corner, 8>& out) const {
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i cell = first + cornerOf(i);
    const std::size_t slot = slotOf(cell);
    const std::uint32_t tag = tagOf(cell);
    const std::uint32_t state = state_[slot].load(std::memory_order_relaxed);
    Corner& corner = out[static_cast<std::size_t>(i)];
    corner.nearest = nearest_[slot].load(std::memory_order_relaxed);
    if (state >> kTagShift != tag >> kTagShift || corner.nearest >> kTagShift != tag >> kTagShift)
      return false;
    corner.space = StateWord::space(state);
    if ((corner.nearest & NearestWord::kHasSurface) == 0) continue;
    corner.holder.cell = cornerOf(i) + NearestWord::steps(corner.nearest);
    corner.held = findHolder(first, corner.holder);
  }
  return true;
}

bool DistanceField::findHolder(const Eigen::Vector3i& first, Holder& holder) const {
  const Eigen::Vector3i cell = first + holder.cell;
  holder.state = state_[slotOf(cell)].load(std::memory_order_relaxed);
  return StateWord::holds(holder.state, tagOf(cell));
}

/// Finds the cell with the nearest surface point, which need not be the nearest cell. Starts at the nearest
/// of the cells that the corners name and moves to neighbours while one is nearer.
DistanceField::Holder DistanceField::descend(const Eigen::Vector3i& first, const Eigen::Vector3f& part,
                                             const std::array<Corner, 8>& corner) const {
  Holder best = corner[0].holder;
  float least = best.squaredTo(part);
  const auto take = [&](const Holder& holder) {
    const float squared = holder.squaredTo(part);
    if (squared >= least) return;
    least = squared;
    best = holder;
  };
  for (const Corner& one : corner) take(one.holder);
  for (int round = 0; round < kMostDescents; ++round) {
    const Eigen::Vector3i middle = best.cell;
    for (int i = 0; i < 27; ++i) {
      Holder beside{middle + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1), 0};
      if (findHolder(first, beside)) take(beside);
    }
    if (best.cell == middle) break;
  }
  return best;
}

DistanceSample DistanceField::query(const Eigen::Vector3d& p_map) const {
  DistanceSample out;
  out.up_to.ns = up_to_.load(std::memory_order_acquire);
  out.stale = out.up_to.ns < newest_.load(std::memory_order_relaxed);
  const Eigen::Vector3d at = p_map.array() / limits_.cell_size - 0.5;
  const Eigen::Vector3i origin = shownOrigin();
  const Eigen::Array3d from = at.array() - origin.cast<double>().array();
  if (!((from >= 0).all() && (from < limits_.cells.cast<double>().array() - 1).all())) return out;
  const Eigen::Vector3i first = at.array().floor().cast<int>();
  const Eigen::Vector3d part = at - first.cast<double>();
  std::array<Corner, 8> corner;
  if (!corners(first, corner)) return out;
  const auto bit = [&](int axis) { return part[axis] < 0.5 ? 0 : 1 << axis; };
  const Corner& own = corner[static_cast<std::size_t>(bit(0) + bit(1) + bit(2))];
  out.space = own.space;
  const bool unknown = out.space == Space::kUnknown;
  if (!unknown) out.known_to = limits_.cell_size * NearestWord::knownTo(own.nearest);
  const bool measured = std::all_of(corner.begin(), corner.end(), [](const Corner& one) { return one.held; });
  if (measured) {
    interpolate(corner, descend(first, part.cast<float>(), corner), part, out);
    if (!unknown) out.kind = DistanceKind::kDistance;
  } else if (!unknown) {
    out.kind = DistanceKind::kAtLeast;
    for (int i = 0; i < 8; ++i) {
      const double there = static_cast<double>(corner[static_cast<std::size_t>(i)].atLeast());
      out.distance = std::max(out.distance, there - (cornerOf(i).cast<double>() - part).norm());
    }
    if (out.space == Space::kBehindSurface) out.distance = -out.distance;
  }
  out.distance *= limits_.cell_size;
  return out;
}

/// Interpolates trilinearly between the distances at the eight cells' centres [cells].
void DistanceField::interpolate(const std::array<Corner, 8>& corner, const Holder& near_point,
                                const Eigen::Vector3d& part, DistanceSample& out) {
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i bit = cornerOf(i);
    float squared = near_point.squaredTo(bit.cast<float>());
    for (const Corner& one : corner) squared = std::min(squared, one.holder.squaredTo(bit.cast<float>()));
    const Space space = corner[static_cast<std::size_t>(i)].space;
    // No known surface separates the point from an unknown corner: such a corner takes the point's side. A
    // point in unknown space has no side, and all distances are positive.
    const bool behind = out.space != Space::kUnknown &&
                        (space == Space::kUnknown ? out.space : space) == Space::kBehindSurface;
    const double distance = static_cast<double>(behind ? -std::sqrt(squared) : std::sqrt(squared));
    Eigen::Vector3d weight;
    for (int axis = 0; axis < 3; ++axis) weight[axis] = bit[axis] != 0 ? part[axis] : 1 - part[axis];
    out.distance += weight.prod() * distance;
    for (int axis = 0; axis < 3; ++axis) {
      const double others = weight[(axis + 1) % 3] * weight[(axis + 2) % 3];
      slope[axis] += (bit[axis] != 0 ? others : -others) * distance;
    }
  }
  if (slope.norm() > 0) out.gradient = slope.normalized();
}

}  // namespace swiftlet
