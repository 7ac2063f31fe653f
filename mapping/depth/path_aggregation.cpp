#include "mapping/depth/path_aggregation.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>

#include "mapping/depth/disparity_lanes.hpp"

namespace swiftlet {
namespace {

using disparity_lanes::kLanes;

/// Costs of all disparities of one pixel.
template <typename Lanes, int kVectors>
struct Costs {
  using Bytes = typename Lanes::Bytes;
  Bytes part[kVectors];

  static Costs load(const std::uint8_t* from) {
    Costs v;
    for (int i = 0; i < kVectors; ++i) v.part[i] = Lanes::load(from + kLanes * i);
    return v;
  }
  void store(std::uint8_t* to) const {
    for (int i = 0; i < kVectors; ++i) Lanes::store(to + kLanes * i, part[i]);
  }
  static Costs broadcast(std::uint8_t x) {
    Costs v;
    for (Bytes& p : v.part) p = Lanes::broadcast(x);
    return v;
  }
  /// 0, 1, 2, ...
  static Costs count() {
    std::array<std::uint8_t, std::size_t{kLanes} * kVectors> numbers{};
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<std::uint8_t>(i);
    return load(numbers.data());
  }
  void add(const Costs& other) {
    for (int i = 0; i < kVectors; ++i) part[i] = Lanes::add(part[i], other.part[i]);
  }
  [[nodiscard]] Bytes least() const {
    Bytes m = part[0];
    for (int i = 1; i < kVectors; ++i) m = Lanes::min(m, part[i]);
    return m;
  }
};

/// 255 in the lane of a pixel's first or last disparity, which has no neighbour on one side.
template <typename Lanes>
struct EndMasks {
  EndMasks() {
    std::array<std::uint8_t, kLanes> mask{};
    mask.front() = 255;
    first = Lanes::load(mask.data());
    mask.front() = 0;
    mask.back() = 255;
    last = Lanes::load(mask.data());
  }
  typename Lanes::Bytes first;
  typename Lanes::Bytes last;
};

/// A pixel's costs along a path, less their least, and those of the disparities below and above.
template <typename Lanes, int kVectors>
struct Neighbours {
  Costs<Lanes, kVectors> same;
  Costs<Lanes, kVectors> below;
  Costs<Lanes, kVectors> above;

  static Neighbours of(const Costs<Lanes, kVectors>& costs) {
    const auto none = Lanes::broadcast(255);
    Neighbours n;
    n.same = costs;
    for (int i = 0; i < kVectors; ++i) {
      n.below.part[i] = Lanes::shiftUp(i > 0 ? costs.part[i - 1] : none, costs.part[i]);
      n.above.part[i] = Lanes::shiftDown(costs.part[i], i + 1 < kVectors ? costs.part[i + 1] : none);
    }
    return n;
  }
  /// From a buffer: unaligned loads are cheaper than shifts. Reads a byte on both sides.
  static Neighbours load(const std::uint8_t* from, const EndMasks<Lanes>& end) {
    Neighbours n;
    n.same = Costs<Lanes, kVectors>::load(from);
    n.below = Costs<Lanes, kVectors>::load(from - 1);
    n.above = Costs<Lanes, kVectors>::load(from + 1);
    n.below.part[0] = Lanes::bitOr(n.below.part[0], end.first);
    n.above.part[kVectors - 1] = Lanes::bitOr(n.above.part[kVectors - 1], end.last);
    return n;
  }
};

/// One step of a path: costs along it.
template <typename Lanes, int kVectors>
Costs<Lanes, kVectors> along(const Neighbours<Lanes, kVectors>& before, const Costs<Lanes, kVectors>& costs,
                             typename Lanes::Bytes small, std::uint8_t large_penalty) {
  const auto large = Lanes::broadcast(large_penalty);
  Costs<Lanes, kVectors> path;
  for (int i = 0; i < kVectors; ++i) {
    const auto changed = Lanes::add(Lanes::min(before.below.part[i], before.above.part[i]), small);
    path.part[i] = Lanes::add(costs.part[i], Lanes::min(Lanes::min(before.same.part[i], large), changed));
  }
  return path;
}

/// Costs less their least, as the next pixel of the path uses them.
template <typename Lanes, int kVectors>
Costs<Lanes, kVectors> relative(const Costs<Lanes, kVectors>& path) {
  const auto least = Lanes::spreadLeast(path.least());
  Costs<Lanes, kVectors> v;
  for (int i = 0; i < kVectors; ++i) v.part[i] = Lanes::subtract(path.part[i], least);
  return v;
}

std::uint8_t largePenalty(const PathPenalties& penalties, std::uint8_t a, std::uint8_t b) {
  return penalties.large[static_cast<std::size_t>(std::abs(a - b))];
}

template <typename Lanes, int kVectors>
Costs<Lanes, kVectors> matchingCosts(const MatchingRow& row, int x) {
  Costs<Lanes, kVectors> costs;
  for (int i = 0; i < kVectors; ++i) {
    const int first = row.width - 1 - x + kLanes * i;
    costs.part[i] = Lanes::broadcast(0);
    for (std::size_t p = 0; p < kCensusPlanes; ++p) {
      const auto differ =
          Lanes::bitXor(Lanes::broadcast(row.left_signs[p][x]), Lanes::load(row.right_signs[p] + first));
      costs.part[i] = Lanes::add(costs.part[i], Lanes::bitCount(differ));
    }
  }
  return costs;
}

/// Least sums and their disparities of the right image's pixels x - d, while x rises. In each step the values
/// of a pixel move up by one lane; after the last lane its disparity is final.
template <typename Lanes, int kVectors>
class RightView {
 public:
  RightView(int width, std::uint8_t* disparity)
      : width_(width),
        disparity_(disparity),
        count_(Costs<Lanes, kVectors>::count()),
        least_(Costs<Lanes, kVectors>::broadcast(255)),
        best_(Costs<Lanes, kVectors>::broadcast(0)) {}

  void add(int x, const Costs<Lanes, kVectors>& sums) {
    for (int i = kVectors - 1; i >= 0; --i) {
      const auto none = Lanes::broadcast(255);
      const auto least = Lanes::shiftUp(i > 0 ? least_.part[i - 1] : none, least_.part[i]);
      const auto best = Lanes::shiftUp(i > 0 ? best_.part[i - 1] : none, best_.part[i]);
      best_.part[i] = Lanes::select(Lanes::atLeast(sums.part[i], least), best, count_.part[i]);
      least_.part[i] = Lanes::min(least, sums.part[i]);
    }
    const int done = x - (kLanes * kVectors - 1);
    if (done >= 0) disparity_[done] = Lanes::last(best_.part[kVectors - 1]);
  }

  void finish() const {
    std::array<std::uint8_t, std::size_t{kLanes} * kVectors> best;
    best_.store(best.data());
    const int held = std::min(kLanes * kVectors, width_);
    for (int d = 0; d < held; ++d) disparity_[width_ - 1 - d] = best[static_cast<std::size_t>(d)];
  }

 private:
  int width_;
  std::uint8_t* disparity_;
  Costs<Lanes, kVectors> count_;
  Costs<Lanes, kVectors> least_;
  Costs<Lanes, kVectors> best_;
};

}  // namespace

template <typename Lanes, int kVectors>
void matchUpwards(const MatchingRow& row, const PathPenalties& penalties, std::uint8_t* neighbours,
                  std::uint8_t* costs, std::uint8_t* sums) {
  constexpr int kDisparities = kLanes * kVectors;
  using Pixel = Costs<Lanes, kVectors>;
  using Before = Neighbours<Lanes, kVectors>;
  const EndMasks<Lanes> end;
  const Pixel count = Pixel::count();
  const auto outside = Lanes::broadcast(penalties.outside);
  const auto small = Lanes::broadcast(penalties.small);
  Pixel right = Pixel::broadcast(0);
  for (int x = row.width - 1; x >= 0; --x) {
    const std::ptrdiff_t at = std::ptrdiff_t{x} * kDisparities;
    const std::uint8_t grey = row.grey[x];
    Pixel pixel = matchingCosts<Lanes, kVectors>(row, x);
    if (x + 1 < kDisparities) {
      const auto last_inside = Lanes::broadcast(static_cast<std::uint8_t>(x));
      for (int i = 0; i < kVectors; ++i) {
        pixel.part[i] = Lanes::select(Lanes::atLeast(last_inside, count.part[i]), pixel.part[i], outside);
      }
    }
    Pixel path = along(Before::load(neighbours + at, end), pixel, small,
                       largePenalty(penalties, grey, row.grey_before[x]));
    relative(path).store(neighbours + at);
    if (costs == nullptr) continue;
    pixel.store(costs + at);
    const Pixel leftwards =
        along(Before::of(right), pixel, small, largePenalty(penalties, grey, row.grey[x + 1]));
    right = relative(leftwards);
    path.add(leftwards);
    path.store(sums + at);
  }
}

template <typename Lanes, int kVectors>
void addDownwards(const MatchingRow& row, const PathPenalties& penalties, const std::uint8_t* costs,
                  std::uint8_t* neighbours, std::uint8_t* sums) {
  constexpr int kDisparities = kLanes * kVectors;
  using Pixel = Costs<Lanes, kVectors>;
  using Before = Neighbours<Lanes, kVectors>;
  const EndMasks<Lanes> end;
  const auto small = Lanes::broadcast(penalties.small);
  Pixel left = Pixel::broadcast(0);
  for (int x = 0; x < row.width; ++x) {
    const std::ptrdiff_t at = std::ptrdiff_t{x} * kDisparities;
    const Pixel pixel = Pixel::load(costs + at);
    const std::uint8_t grey = row.grey[x];
    const Pixel rightwards =
        along(Before::of(left), pixel, small, largePenalty(penalties, grey, row.grey[x - 1]));
    left = relative(rightwards);
    const Pixel downwards = along(Before::load(neighbours + at, end), pixel, small,
                                  largePenalty(penalties, grey, row.grey_before[x]));
    relative(downwards).store(neighbours + at);
    Pixel sum = Pixel::load(sums + at);
    sum.add(rightwards);
    sum.add(downwards);
    sum.store(sums + at);
  }
}

template <typename Lanes, int kVectors>
void chooseDisparities(const std::uint8_t* sums, int width, const DisparityChoice& choice) {
  constexpr int kDisparities = kLanes * kVectors;
  using Pixel = Costs<Lanes, kVectors>;
  const Pixel count = Pixel::count();
  const auto one = Lanes::broadcast(1);
  RightView<Lanes, kVectors> right(width, choice.right_disparity);
  for (int x = 0; x < width; ++x) {
    const std::uint8_t* const at = sums + std::ptrdiff_t{x} * kDisparities;
    const Pixel pixel = Pixel::load(at);
    const auto least = Lanes::spreadLeast(pixel.least());
    int best = 0;
    for (int i = kVectors - 1; i >= 0; --i) {
      const int first = Lanes::firstSet(Lanes::equal(pixel.part[i], least));
      if (first < kLanes) best = kLanes * i + first;
    }
    const auto spread_best = Lanes::broadcast(static_cast<std::uint8_t>(best));
    auto others = Lanes::broadcast(255);
    for (int i = 0; i < kVectors; ++i) {
      const auto apart = Lanes::max(Lanes::subtract(count.part[i], spread_best),
                                    Lanes::subtract(spread_best, count.part[i]));
      others = Lanes::min(others, Lanes::bitOr(pixel.part[i], Lanes::atLeast(one, apart)));
    }
    choice.disparity[x] = static_cast<std::uint8_t>(best);
    choice.least[x] = at[best];
    choice.below[x] = best > 0 ? at[best - 1] : std::uint8_t{255};
    choice.above[x] = best + 1 < kDisparities ? at[best + 1] : std::uint8_t{255};
    choice.second[x] = Lanes::least(others);
    right.add(x, pixel);
  }
  right.finish();
}

#define SWIFTLET_INSTANTIATE(LANES, VECTORS)                                                                \
  template void matchUpwards<disparity_lanes::LANES, VECTORS>(const MatchingRow&, const PathPenalties&,     \
                                                              std::uint8_t*, std::uint8_t*, std::uint8_t*); \
  template void addDownwards<disparity_lanes::LANES, VECTORS>(                                              \
      const MatchingRow&, const PathPenalties&, const std::uint8_t*, std::uint8_t*, std::uint8_t*);         \
  template void chooseDisparities<disparity_lanes::LANES, VECTORS>(const std::uint8_t*, int,                \
                                                                   const DisparityChoice&);
#define SWIFTLET_INSTANTIATE_ALL(LANES) \
  SWIFTLET_INSTANTIATE(LANES, 1)        \
  SWIFTLET_INSTANTIATE(LANES, 2) SWIFTLET_INSTANTIATE(LANES, 3) SWIFTLET_INSTANTIATE(LANES, 4)
SWIFTLET_INSTANTIATE_ALL(Scalar)
#ifdef SWIFTLET_DISPARITY_LANES_NATIVE
SWIFTLET_INSTANTIATE_ALL(Native)
#endif

}  // namespace swiftlet
