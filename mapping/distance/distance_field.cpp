#include "mapping/distance/distance_field.hpp"

#include <array>

#include "mapping/distance/distance_word.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFF;
// Buckets of the queue to a cell of distance: waves run outwards evenly enough that few cells are taken
// twice.
constexpr float kBucketsPerCell = 4;
// A cell takes another surface that is nearer by more than this [cells]: what is as good makes no waves. On
// the way from a cell to its nearest surface the gain does not fall, so none is kept from farther cells.
constexpr float kGain = 0.05F;

bool isNearer(float squared, float than) {
  // sqrt(than) - sqrt(squared) > kGain, but for kGain^2.
  const float gain = than - squared;
  return gain > 0 && gain * gain > 4 * kGain * kGain * than;
}

// Cells lie in memory in bricks of 8 x 8 x 8, a page of 4 KiB each: a cell's neighbours are in few pages, and
// what waves wait for is memory.
constexpr std::uint32_t kBrickBits = 3;
constexpr std::uint32_t kBrickSide = 1U << kBrickBits;
static_assert(kBrickSide == kDistanceStep);
// The window moves once the vehicle is an eighth of it away from its middle.
constexpr int kSlack = 8;

int floorDiv(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }
int wrapped(int a, int b) {
  const int rest = a % b;
  return rest < 0 ? rest + b : rest;
}

// Origins are kept for readers in steps, 21 bits an axis.
constexpr std::uint64_t kOriginMask = (1ULL << 21U) - 1;
constexpr std::int64_t kOriginBias = 1 << 20;

std::uint64_t packOrigin(const Eigen::Vector3i& origin) {
  std::uint64_t word = 0;
  for (int i = 0; i < 3; ++i) {
    const std::int64_t steps = origin[i] / kDistanceStep + kOriginBias;
    word |= (static_cast<std::uint64_t>(steps) & kOriginMask) << (21U * static_cast<unsigned>(i));
  }
  return word;
}

Eigen::Vector3i unpackOrigin(std::uint64_t word) {
  Eigen::Vector3i origin;
  for (int i = 0; i < 3; ++i) {
    const std::uint64_t steps = word >> (21U * static_cast<unsigned>(i)) & kOriginMask;
    origin[i] = static_cast<int>(static_cast<std::int64_t>(steps) - kOriginBias) * kDistanceStep;
  }
  return origin;
}

DistanceLimits checked(DistanceLimits limits) {
  for (int i = 0; i < 3; ++i) {
    limits.cells[i] = std::max(limits.cells[i] / kDistanceStep, 2) * kDistanceStep;
  }
  limits.reach = std::clamp(limits.reach, 1, kMostReach);
  return limits;
}

bool within(const Eigen::Vector3i& cell, const Eigen::Vector3i& origin, const Eigen::Vector3i& cells) {
  const Eigen::Vector3i from = cell - origin;
  return (from.array() >= 0).all() && (from.array() < cells.array()).all();
}

}  // namespace

DistanceField::DistanceField(const DistanceLimits& limits)
    : limits_(checked(limits)),
      squared_reach_(static_cast<float>(limits_.reach * limits_.reach)),
      cell_(static_cast<std::size_t>(limits_.cells.prod())),
      surface_(cell_.size()),
      next_(cell_.size(), kNone),
      head_(static_cast<std::size_t>(static_cast<float>(limits_.reach + 2) * kBucketsPerCell), kNone),
      lowest_(head_.size()) {
  std::uint32_t stride = 1U << (3 * kBrickBits);
  for (int i = 0; i < 3; ++i) {
    brick_stride_[static_cast<std::size_t>(i)] = stride;
    stride *= static_cast<std::uint32_t>(limits_.cells[i]) >> kBrickBits;
  }
  for (int i = 0; i < 3; ++i) origin_[i] = -floorDiv(limits_.cells[i] / 2, kDistanceStep) * kDistanceStep;
  for (std::uint32_t slot = 0; slot < cell_.size(); ++slot) {
    cell_[slot].nearest.store(tagOf(cellAt(slot)) << NearestWord::kTagShift, std::memory_order_relaxed);
    surface_[slot].store(0, std::memory_order_relaxed);
  }
  publishOrigin();
}

void DistanceField::publishOrigin() { shown_origin_.store(packOrigin(origin_), std::memory_order_release); }

std::size_t DistanceField::bytes() const {
  return cell_.size() * (sizeof(Cell) + sizeof(Word) + sizeof(std::uint32_t)) +
         head_.size() * sizeof(std::uint32_t);
}

Eigen::Vector3i DistanceField::cellOf(const Eigen::Vector3d& p_map) const {
  return (p_map / limits_.cell_size).array().floor().cast<int>();
}

Eigen::Vector3d DistanceField::centreOf(const Eigen::Vector3i& cell) const {
  return (cell.cast<double>().array() + 0.5) * limits_.cell_size;
}

bool DistanceField::inside(const Eigen::Vector3i& cell) const { return within(cell, origin_, limits_.cells); }

std::uint32_t DistanceField::partOfSlot(int axis, int at) const {
  const auto shift = static_cast<std::uint32_t>(axis) * kBrickBits;
  const auto place = static_cast<std::uint32_t>(at);
  return (place >> kBrickBits) * brick_stride_[static_cast<std::size_t>(axis)] +
         ((place & (kBrickSide - 1)) << shift);
}

std::uint32_t DistanceField::slotOf(const Eigen::Vector3i& cell) const {
  std::uint32_t slot = 0;
  for (int i = 0; i < 3; ++i) slot += partOfSlot(i, wrapped(cell[i], limits_.cells[i]));
  return slot;
}

std::uint32_t DistanceField::tagOf(const Eigen::Vector3i& cell) const {
  std::uint32_t tag = 0;
  for (int i = 0; i < 3; ++i) {
    const auto turns = static_cast<std::uint32_t>(floorDiv(cell[i], limits_.cells[i]));
    tag |= (turns & 1U) << static_cast<unsigned>(i);
  }
  return tag;
}

Eigen::Vector3i DistanceField::cellAt(std::uint32_t slot) const {
  Eigen::Vector3i cell;
  std::uint32_t brick = slot >> (3 * kBrickBits);
  for (int i = 0; i < 3; ++i) {
    const auto bricks = static_cast<std::uint32_t>(limits_.cells[i]) >> kBrickBits;
    const std::uint32_t within = slot >> (static_cast<std::uint32_t>(i) * kBrickBits) & (kBrickSide - 1);
    const int at = static_cast<int>((brick % bricks << kBrickBits) + within);
    brick /= bricks;
    cell[i] = origin_[i] + wrapped(at - origin_[i], limits_.cells[i]);
  }
  return cell;
}

/// What a cell with this word takes for its nearest surface, the one in `surface`, is there and has not
/// moved.
bool DistanceField::holdsTrue(const Eigen::Vector3i& surface, std::uint32_t nearest) const {
  if (!inside(surface)) return false;
  const std::uint32_t word = surface_[slotOf(surface)].load(std::memory_order_relaxed);
  if ((word & SurfaceWord::kPresent) == 0) return false;
  return ((word & SurfaceWord::kParity) != 0) == ((nearest & NearestWord::kParity) != 0);
}

/// The bits by which a cell says that its nearest surface is that one.
std::uint32_t DistanceField::linkTo(const Eigen::Vector3i& cell, const Eigen::Vector3i& surface) const {
  const std::uint32_t word = surface_[slotOf(surface)].load(std::memory_order_relaxed);
  return NearestWord::pack(surface - cell) | NearestWord::kHasSurface |
         ((word & SurfaceWord::kParity) != 0 ? NearestWord::kParity : 0U);
}

float DistanceField::squaredTo(const Eigen::Vector3i& surface, const Eigen::Vector3i& cell) const {
  const std::uint32_t word = surface_[slotOf(surface)].load(std::memory_order_relaxed);
  Eigen::Vector3f to = (surface - cell).cast<float>();
  if ((word & SurfaceWord::kPresent) != 0 && word >> SurfaceWord::kTagShift == tagOf(surface)) {
    to += SurfaceWord::offset(word);
  }
  return to.squaredNorm();
}

float DistanceField::squaredDistance(const Eigen::Vector3i& cell) const {
  const std::uint32_t word = cell_[slotOf(cell)].nearest.load(std::memory_order_relaxed);
  if ((word & NearestWord::kHasSurface) == 0) return -1;
  return squaredTo(cell + NearestWord::offset(word), cell);
}

bool DistanceField::holdsSurface(const Eigen::Vector3i& cell) const {
  return inside(cell) &&
         (surface_[slotOf(cell)].load(std::memory_order_relaxed) & SurfaceWord::kPresent) != 0;
}

void DistanceField::push(std::uint32_t slot, float squared) {
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  // Who waits already is taken later than its new distance asks for: more cells are taken twice, the end is
  // the same.
  if ((word & NearestWord::kQueued) != 0) return;
  cell_[slot].nearest.store(word | NearestWord::kQueued, std::memory_order_relaxed);
  const auto wanted = static_cast<std::size_t>(std::sqrt(std::max(squared, 0.0F)) * kBucketsPerCell);
  const std::size_t bucket = std::min(wanted, head_.size() - 1);
  next_[slot] = head_[bucket];
  head_[bucket] = slot;
  lowest_ = std::min(lowest_, bucket);
  ++queued_;
}

bool DistanceField::pop(std::uint32_t& slot) {
  while (lowest_ < head_.size() && head_[lowest_] == kNone) ++lowest_;
  if (lowest_ == head_.size()) return false;
  slot = head_[lowest_];
  head_[lowest_] = next_[slot];
  --queued_;
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  cell_[slot].nearest.store(word & ~NearestWord::kQueued, std::memory_order_relaxed);
  return true;
}

void DistanceField::setState(std::uint32_t slot, const Eigen::Vector3i& cell, Space space) {
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  const std::uint32_t kept = word & (NearestWord::kLink | NearestWord::kRaise | NearestWord::kQueued);
  cell_[slot].nearest.store(kept | static_cast<std::uint32_t>(space) << NearestWord::kSpaceShift |
                                tagOf(cell) << NearestWord::kTagShift,
                            std::memory_order_relaxed);
}

/// The cell's nearest surface is no more: what it was nearest to is to be raised.
void DistanceField::remove(std::uint32_t slot) {
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  cell_[slot].nearest.store((word & ~NearestWord::kLink) | NearestWord::kRaise, std::memory_order_relaxed);
}

void DistanceField::setSpace(const Eigen::Vector3i& cell, Space space) {
  if (!inside(cell)) return;
  const std::uint32_t slot = slotOf(cell);
  setState(slot, cell, space);
  dropSurface(slot, cell);
}

void DistanceField::dropSurface(std::uint32_t slot, const Eigen::Vector3i& cell) {
  const std::uint32_t before = surface_[slot].load(std::memory_order_relaxed);
  if ((before & SurfaceWord::kPresent) == 0) return;
  surface_[slot].store(before & SurfaceWord::kParity, std::memory_order_relaxed);
  askAnew(slot, cell);
}

void DistanceField::setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                              const std::array<Space, kDistanceStep>& space) {
  // The window begins and ends at multiples of kDistanceStep: a row lies in it whole, and in slots side by
  // side.
  if (!inside(first)) return;
  const std::uint32_t slot = slotOf(first);
  const std::uint32_t tag = tagOf(first) << NearestWord::kTagShift;
  for (std::uint32_t i = 0; i < kDistanceStep; ++i) {
    if ((cells >> i & 1U) == 0) continue;
    const std::uint32_t word = cell_[slot + i].nearest.load(std::memory_order_relaxed);
    const std::uint32_t now = (word & (NearestWord::kLink | NearestWord::kRaise | NearestWord::kQueued)) |
                              static_cast<std::uint32_t>(space[i]) << NearestWord::kSpaceShift | tag;
    if (now != word) cell_[slot + i].nearest.store(now, std::memory_order_relaxed);
    dropSurface(slot + i, first + Eigen::Vector3i(static_cast<int>(i), 0, 0));
  }
}

void DistanceField::setSurface(const Eigen::Vector3i& cell, Space space, const Eigen::Vector3f& offset) {
  if (!inside(cell)) return;
  const std::uint32_t slot = slotOf(cell);
  setState(slot, cell, space);
  const std::uint32_t before = surface_[slot].load(std::memory_order_relaxed);
  const std::uint32_t packed = SurfaceWord::pack(offset) | tagOf(cell) << SurfaceWord::kTagShift;
  const bool present = (before & SurfaceWord::kPresent) != 0;
  // Noise of less than this is not worth waves: the point stays where it was told to be [cells].
  constexpr float kMoved = 0.1F;
  if (present && (SurfaceWord::offset(before) - SurfaceWord::offset(packed)).norm() < kMoved) return;
  // Who took the point as it was is told by the parity.
  const std::uint32_t parity = (before & SurfaceWord::kParity) ^ (present ? SurfaceWord::kParity : 0U);
  surface_[slot].store(packed | parity, std::memory_order_relaxed);
  if (present) askAnew(slot, cell);
  takeOwn(slot, cell);
  push(slot, SurfaceWord::offset(packed).squaredNorm());
}

/// A cell with surface in it, for which no other is nearer to its middle.
void DistanceField::takeOwn(std::uint32_t slot, const Eigen::Vector3i& cell) {
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  const float own = SurfaceWord::offset(surface_[slot].load(std::memory_order_relaxed)).squaredNorm();
  if ((word & NearestWord::kHasSurface) != 0 && own >= cell_[slot].squared) return;
  cell_[slot].nearest.store((word & ~NearestWord::kLink) | linkTo(cell, cell), std::memory_order_relaxed);
  cell_[slot].squared = own;
}

/// The surface in the cell left or moved: the cell, and after it those that took it for their nearest, look
/// again.
void DistanceField::askAnew(std::uint32_t slot, const Eigen::Vector3i& cell) {
  const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
  if ((word & NearestWord::kHasSurface) != 0 && !holdsTrue(cell + NearestWord::offset(word), word))
    remove(slot);
  const std::uint32_t now = cell_[slot].nearest.load(std::memory_order_relaxed);
  cell_[slot].nearest.store(now | NearestWord::kRaise, std::memory_order_relaxed);
  push(slot, cell_[slot].squared);
}

/// The slots around a cell: along each axis what the three coordinates add to the slot, kNone outside the
/// window.
struct DistanceField::Around {
  std::array<std::array<std::uint32_t, 3>, 3> part;  ///< [axis][step + 1]
};

DistanceField::Around DistanceField::around(const Eigen::Vector3i& cell) const {
  Around result;
  for (int axis = 0; axis < 3; ++axis) {
    const int cells = limits_.cells[axis];
    const int inside_at = cell[axis] - origin_[axis];
    const int slot_at = wrapped(cell[axis], cells);
    for (int step = -1; step <= 1; ++step) {
      const int next = slot_at + step == cells ? 0 : slot_at + step < 0 ? cells - 1 : slot_at + step;
      const bool within_window = inside_at + step >= 0 && inside_at + step < cells;
      result.part[static_cast<std::size_t>(axis)][static_cast<std::size_t>(step + 1)] =
          within_window ? partOfSlot(axis, next) : kNone;
    }
  }
  return result;
}

/// Calls `visit(slot, x, y, z)` with steps of -1, 0, 1 for the neighbours in the window.
template <typename Visit>
void DistanceField::forNeighbours(const Around& around, const Visit& visit) {
  for (int z = -1; z <= 1; ++z) {
    const std::uint32_t at_z = around.part[2][static_cast<std::size_t>(z + 1)];
    if (at_z == kNone) continue;
    for (int y = -1; y <= 1; ++y) {
      const std::uint32_t at_y = around.part[1][static_cast<std::size_t>(y + 1)];
      if (at_y == kNone) continue;
      for (int x = -1; x <= 1; ++x) {
        const std::uint32_t at_x = around.part[0][static_cast<std::size_t>(x + 1)];
        if (at_x == kNone || (x == 0 && y == 0 && z == 0)) continue;
        visit(at_z + at_y + at_x, x, y, z);
      }
    }
  }
}

std::size_t DistanceField::propagate(std::size_t work) {
  std::size_t taken = 0;
  for (std::uint32_t slot = 0; taken < work && pop(slot); ++taken) {
    const Eigen::Vector3i cell = cellAt(slot);
    const Around neighbours = around(cell);
    if ((cell_[slot].nearest.load(std::memory_order_relaxed) & NearestWord::kRaise) != 0)
      raise(slot, cell, neighbours);
    const bool holds = (surface_[slot].load(std::memory_order_relaxed) & SurfaceWord::kPresent) != 0;
    if (holds) takeOwn(slot, cell);
    const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
    // A cell hands on its own surface too, where another is nearer to its own middle: the neighbours may
    // differ.
    if (holds) lower(neighbours, Eigen::Vector3i::Zero(), linkTo(cell, cell), surface_[slot]);
    if ((word & NearestWord::kHasSurface) == 0 || (word & NearestWord::kRaise) != 0) continue;
    const Eigen::Vector3i offset = NearestWord::offset(word);
    if (offset.isZero() || !holdsTrue(cell + NearestWord::offset(word), word)) continue;
    lower(neighbours, offset, word & NearestWord::kLink, surface_[slotOf(cell + offset)]);
  }
  return taken;
}

/// Neighbours whose surface is no more are to be raised too. Of those of the others the cell takes the
/// nearest for its own: so they need not be asked to hand theirs on.
void DistanceField::raise(std::uint32_t slot, const Eigen::Vector3i& cell, const Around& neighbours) {
  float best = squared_reach_;
  Eigen::Vector3i found = Eigen::Vector3i::Zero();
  bool any = false;
  forNeighbours(neighbours, [&](std::uint32_t beside, int x, int y, int z) {
    const std::uint32_t word = cell_[beside].nearest.load(std::memory_order_relaxed);
    if ((word & NearestWord::kHasSurface) == 0 || (word & NearestWord::kRaise) != 0) return;
    const Eigen::Vector3i surface = cell + Eigen::Vector3i(x, y, z) + NearestWord::offset(word);
    if (!holdsTrue(surface, word)) {
      remove(beside);
      push(beside, cell_[beside].squared);
      return;
    }
    const float squared = squaredTo(surface, cell);
    if (squared > best) return;
    best = squared;
    found = surface;
    any = true;
  });
  std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed) & ~NearestWord::kRaise;
  const bool holds = (word & NearestWord::kHasSurface) != 0;
  if (any && (!holds || isNearer(best, cell_[slot].squared))) {
    word = (word & ~NearestWord::kLink) | linkTo(cell, found);
    cell_[slot].squared = best;
  }
  cell_[slot].nearest.store(word, std::memory_order_relaxed);
  // Handed on into what was raised before.
  if (any || holds) push(slot, cell_[slot].squared);
}

/// Hands the surface point in the cell at `offset` on to the neighbours. `link`: how the cell itself names
/// it.
void DistanceField::lower(const Around& neighbours, const Eigen::Vector3i& offset, std::uint32_t link,
                          const Word& surface) {
  const Eigen::Vector3f to =
      offset.cast<float>() + SurfaceWord::offset(surface.load(std::memory_order_relaxed));
  std::array<std::array<float, 3>, 3> square{};  // [axis][step + 1]
  for (int axis = 0; axis < 3; ++axis) {
    for (int step = -1; step <= 1; ++step) {
      const float along = to[axis] - static_cast<float>(step);
      square[static_cast<std::size_t>(axis)][static_cast<std::size_t>(step + 1)] = along * along;
    }
  }
  forNeighbours(neighbours, [&](std::uint32_t beside, int x, int y, int z) {
    const float squared = square[0][static_cast<std::size_t>(x + 1)] +
                          square[1][static_cast<std::size_t>(y + 1)] +
                          square[2][static_cast<std::size_t>(z + 1)];
    if (squared > squared_reach_) return;
    const std::uint32_t word = cell_[beside].nearest.load(std::memory_order_relaxed);
    if ((word & NearestWord::kRaise) != 0) return;
    if ((word & NearestWord::kHasSurface) != 0 && !isNearer(squared, cell_[beside].squared)) return;
    // Within reach no component of the offset leaves its seven bits, so that steps are subtracted from all at
    // once.
    const std::uint32_t shifted = link - static_cast<std::uint32_t>(x + (y << 7) + (z << 14));
    cell_[beside].nearest.store((word & ~NearestWord::kLink) | shifted, std::memory_order_relaxed);
    cell_[beside].squared = squared;
    push(beside, squared);
  });
}

bool DistanceField::follow(const Eigen::Vector3d& p_map) {
  const Eigen::Vector3i before = origin_;
  const Eigen::Vector3i cell = cellOf(p_map);
  for (int axis = 0; axis < 3; ++axis) {
    const int cells = limits_.cells[axis];
    const int wanted = cell[axis] - cells / 2;
    if (std::abs(wanted - origin_[axis]) <= std::max(cells / kSlack, kDistanceStep)) continue;
    const int from = origin_[axis];
    const int to = floorDiv(wanted, kDistanceStep) * kDistanceStep;
    const int steps = std::min(std::abs(to - from), cells);
    // Who asks meanwhile finds words of another place, and takes them for unknown.
    origin_[axis] = to;
    publishOrigin();
    if (to > from) {
      clearSlab(axis, to + cells - steps, to + cells);
      wakeLayer(axis, to);
      wakeLayer(axis, to + cells - steps - 1);
    } else {
      clearSlab(axis, to, to + steps);
      wakeLayer(axis, to + cells - 1);
      wakeLayer(axis, to + steps);
    }
  }
  return origin_ != before;
}

/// The cells that entered, from `first` to before `last`, are unknown. Those in the queue stay in it.
void DistanceField::clearSlab(int axis, int first, int last) {
  Eigen::Vector3i low = origin_;
  Eigen::Vector3i high = origin_ + limits_.cells;
  low[axis] = first;
  high[axis] = last;
  for (int z = low.z(); z < high.z(); ++z) {
    for (int y = low.y(); y < high.y(); ++y) {
      for (int x = low.x(); x < high.x(); ++x) {
        const Eigen::Vector3i cell(x, y, z);
        const std::uint32_t slot = slotOf(cell);
        const std::uint32_t queued =
            cell_[slot].nearest.load(std::memory_order_relaxed) & NearestWord::kQueued;
        cell_[slot].nearest.store(queued | tagOf(cell) << NearestWord::kTagShift, std::memory_order_relaxed);
        surface_[slot].store(0, std::memory_order_relaxed);
      }
    }
  }
}

/// A layer next to where the window changed: raised where its surface left, else handed on into what entered.
void DistanceField::wakeLayer(int axis, int at) {
  Eigen::Vector3i low = origin_;
  Eigen::Vector3i high = origin_ + limits_.cells;
  if (at < low[axis] || at >= high[axis]) return;
  low[axis] = at;
  high[axis] = at + 1;
  for (int z = low.z(); z < high.z(); ++z) {
    for (int y = low.y(); y < high.y(); ++y) {
      for (int x = low.x(); x < high.x(); ++x) {
        const Eigen::Vector3i cell(x, y, z);
        const std::uint32_t slot = slotOf(cell);
        const std::uint32_t word = cell_[slot].nearest.load(std::memory_order_relaxed);
        if ((word & NearestWord::kHasSurface) == 0) continue;
        if (!holdsTrue(cell + NearestWord::offset(word), word)) remove(slot);
        push(slot, cell_[slot].squared);
      }
    }
  }
}

DistanceField::Corner DistanceField::corner(const Eigen::Vector3i& cell) const {
  const std::uint32_t word = cell_[slotOf(cell)].nearest.load(std::memory_order_relaxed);
  Corner out;
  if (word >> NearestWord::kTagShift != tagOf(cell)) return out;
  out.known = true;
  out.space = static_cast<Space>((word & NearestWord::kSpaceMask) >> NearestWord::kSpaceShift);
  out.bounded = (word & NearestWord::kHasSurface) != 0;
  const float squared = out.bounded ? squaredTo(cell + NearestWord::offset(word), cell) : squared_reach_;
  const float distance = std::min(std::sqrt(squared), static_cast<float>(limits_.reach));
  out.distance = out.space == Space::kBehindSurface ? -distance : distance;
  return out;
}

bool DistanceField::query(const Eigen::Vector3d& p_map, DistanceSample& out) const {
  out = DistanceSample{};
  const Eigen::Vector3d at = p_map.array() / limits_.cell_size - 0.5;
  const Eigen::Vector3i origin = unpackOrigin(shown_origin_.load(std::memory_order_acquire));
  const Eigen::Array3d from = at.array() - origin.cast<double>().array();
  if (!((from >= 0).all() && (from < limits_.cells.cast<double>().array() - 1).all())) return false;
  const Eigen::Vector3i first = at.array().floor().cast<int>();
  const Eigen::Vector3d part = at - first.cast<double>();
  const Eigen::Vector3i own = (at.array() + 0.5).floor().cast<int>();
  double distance = 0;
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  bool bounded = true;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i bit(i & 1, i >> 1 & 1, i >> 2 & 1);
    const Corner value = corner(first + bit);
    if (!value.known) return false;
    bounded = bounded && value.bounded;
    if (first + bit == own) out.space = value.space;
    Eigen::Vector3d weight;
    for (int axis = 0; axis < 3; ++axis) weight[axis] = bit[axis] != 0 ? part[axis] : 1 - part[axis];
    distance += weight.prod() * static_cast<double>(value.distance);
    for (int axis = 0; axis < 3; ++axis) {
      const double others = weight[(axis + 1) % 3] * weight[(axis + 2) % 3];
      slope[axis] += (bit[axis] != 0 ? others : -others) * static_cast<double>(value.distance);
    }
  }
  out.distance = distance * limits_.cell_size;
  out.bounded = bounded;
  if (bounded && slope.norm() > 0) out.gradient = slope.normalized();
  return true;
}

}  // namespace swiftlet
