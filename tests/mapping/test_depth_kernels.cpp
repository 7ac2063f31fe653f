// The matching kernels: native instruction set against the scalar twin, and both against plain loops.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "estimator/core/random.hpp"
#include "mapping/depth/census.hpp"
#include "mapping/depth/disparity_lanes.hpp"
#include "mapping/depth/path_aggregation.hpp"

using namespace swiftlet;
using disparity_lanes::kLanes;
using disparity_lanes::Native;
using disparity_lanes::Scalar;
using Bytes = std::vector<std::uint8_t>;

namespace {

Bytes randomBytes(std::size_t count, Random& random, unsigned below = 256) {
  Bytes bytes(count);
  for (std::uint8_t& b : bytes) b = static_cast<std::uint8_t>(random.below(below));
  return bytes;
}

/// All operations on two rows of 32 bytes, results one behind the other.
template <typename Lanes>
Bytes operate(const Bytes& first, const Bytes& second) {
  Bytes out;
  const auto a = Lanes::load(first.data());
  const auto b = Lanes::load(second.data());
  const auto keep = [&](const auto& v) {
    out.resize(out.size() + kLanes);
    Lanes::store(out.data() + out.size() - kLanes, v);
  };
  keep(Lanes::broadcast(first[3]));
  keep(Lanes::min(a, b));
  keep(Lanes::max(a, b));
  keep(Lanes::add(a, b));
  keep(Lanes::subtract(a, b));
  keep(Lanes::bitAnd(a, b));
  keep(Lanes::bitOr(a, b));
  keep(Lanes::bitXor(a, b));
  keep(Lanes::atLeast(a, b));
  keep(Lanes::equal(a, b));
  keep(Lanes::select(Lanes::atLeast(a, b), a, b));
  keep(Lanes::bitCount(a));
  keep(Lanes::shiftUp(a, b));
  keep(Lanes::shiftDown(a, b));
  keep(Lanes::spreadLeast(a));
  out.push_back(Lanes::least(b));
  out.push_back(Lanes::last(a));
  out.push_back(static_cast<std::uint8_t>(Lanes::firstSet(Lanes::equal(a, b))));
  out.push_back(static_cast<std::uint8_t>(Lanes::firstSet(Lanes::equal(a, Lanes::spreadLeast(a)))));
  return out;
}

/// A row's input with its margins, and buffers.
struct RowCase {
  RowCase(int row_width, int vectors, Random& random) : width(row_width), disparities(kLanes * vectors) {
    const auto size = static_cast<std::size_t>(width);
    grey = randomBytes(size + 2, random, 40);
    grey_before = randomBytes(size + 2, random, 40);
    for (auto& plane : left) plane = randomBytes(size, random);
    for (auto& plane : right) plane = randomBytes(size + static_cast<std::size_t>(disparities), random);
    left.back() = randomBytes(size, random, 128);
    right.back() = randomBytes(size + static_cast<std::size_t>(disparities), random, 128);
    neighbours = randomBytes(size * static_cast<std::size_t>(disparities) + 2, random, 100);
    penalties.small = static_cast<std::uint8_t>(1 + random.below(20));
    penalties.outside = static_cast<std::uint8_t>(random.below(32));
    for (std::uint8_t& p : penalties.large)
      p = static_cast<std::uint8_t>(penalties.small + random.below(100));
  }
  [[nodiscard]] MatchingRow row() const {
    MatchingRow r;
    r.width = width;
    r.grey = grey.data() + 1;
    r.grey_before = grey_before.data() + 1;
    for (std::size_t p = 0; p < kCensusPlanes; ++p) {
      r.left_signs[p] = left[p].data();
      r.right_signs[p] = right[p].data();
    }
    return r;
  }
  [[nodiscard]] std::size_t cells() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(disparities);
  }

  int width;
  int disparities;
  Bytes grey, grey_before;
  std::array<Bytes, kCensusPlanes> left, right;
  Bytes neighbours;
  PathPenalties penalties;
};

struct RowResult {
  Bytes costs, sums, from_below, from_above;
  std::array<Bytes, 6> choice;
  bool operator==(const RowResult&) const = default;
};

template <typename Lanes, int kVectors>
RowResult runKernels(const RowCase& c) {
  RowResult r;
  r.costs.assign(c.cells(), 0);
  r.sums = r.costs;
  r.from_below = c.neighbours;
  r.from_above = c.neighbours;
  matchUpwards<Lanes, kVectors>(c.row(), c.penalties, r.from_below.data() + 1, r.costs.data(), r.sums.data());
  addDownwards<Lanes, kVectors>(c.row(), c.penalties, r.costs.data(), r.from_above.data() + 1, r.sums.data());
  for (Bytes& line : r.choice) line.assign(static_cast<std::size_t>(c.width), 0);
  const DisparityChoice choice{r.choice[0].data(), r.choice[1].data(), r.choice[2].data(),
                               r.choice[3].data(), r.choice[4].data(), r.choice[5].data()};
  chooseDisparities<Lanes, kVectors>(r.sums.data(), c.width, choice);
  return r;
}

/// One path's step by the equation; `before` empty at its beginning.
std::vector<int> stepOfPath(const std::vector<int>& costs, const std::vector<int>& before, int small,
                            int large) {
  std::vector<int> path = costs;
  for (std::size_t d = 0; d < costs.size() && !before.empty(); ++d) {
    int least = std::min(before[d], large);
    if (d > 0) least = std::min(least, before[d - 1] + small);
    if (d + 1 < costs.size()) least = std::min(least, before[d + 1] + small);
    path[d] += least;
  }
  return path;
}
std::vector<int> lessItsLeast(std::vector<int> path) {
  const int least = *std::min_element(path.begin(), path.end());
  for (int& v : path) v -= least;
  return path;
}

/// The row by plain loops, from the definitions.
RowResult plainRow(const RowCase& c) {
  RowResult r;
  const auto size = static_cast<std::size_t>(c.disparities);
  std::vector<std::vector<int>> costs(static_cast<std::size_t>(c.width));
  std::vector<std::vector<int>> sums(costs.size(), std::vector<int>(size, 0));
  r.from_below = r.from_above = c.neighbours;
  const auto add = [&](std::size_t x, const std::vector<int>& path) {
    for (std::size_t d = 0; d < size; ++d) sums[x][d] = std::min(sums[x][d] + path[d], 255);
  };
  const auto large = [&](std::size_t x, int other) {
    return c.penalties.large[static_cast<std::size_t>(std::abs(c.grey[x + 1] - other))];
  };
  for (std::size_t x = 0; x < costs.size(); ++x) {
    for (std::size_t d = 0; d < size; ++d) {
      int differ = 0;
      for (std::size_t p = 0; p < kCensusPlanes; ++p)
        differ += __builtin_popcount(c.left[p][x] ^ c.right[p][costs.size() - 1 - x + d]);
      costs[x].push_back(d <= x ? differ : c.penalties.outside);
      r.costs.push_back(static_cast<std::uint8_t>(costs[x][d]));
    }
    const std::ptrdiff_t at = 1 + static_cast<std::ptrdiff_t>(x * size);
    for (Bytes* const neighbours : {&r.from_below, &r.from_above}) {
      const std::vector<int> before(neighbours->begin() + at, neighbours->begin() + at + c.disparities);
      const auto path = stepOfPath(costs[x], before, c.penalties.small, large(x, c.grey_before[x + 1]));
      add(x, path);
      const auto next = lessItsLeast(path);
      for (std::size_t d = 0; d < size; ++d)
        (*neighbours)[static_cast<std::size_t>(at) + d] = static_cast<std::uint8_t>(next[d]);
    }
  }
  std::vector<int> before(size, 0);
  for (std::size_t x = costs.size(); x-- > 0;) {
    const auto path = stepOfPath(costs[x], before, c.penalties.small, large(x, c.grey[x + 2]));
    add(x, path);
    before = lessItsLeast(path);
  }
  before.assign(size, 0);
  for (std::size_t x = 0; x < costs.size(); ++x) {
    const auto path = stepOfPath(costs[x], before, c.penalties.small, large(x, c.grey[x]));
    add(x, path);
    before = lessItsLeast(path);
  }
  for (const auto& pixel : sums) {
    for (const int s : pixel) r.sums.push_back(static_cast<std::uint8_t>(s));
  }
  for (Bytes& line : r.choice) line.assign(costs.size(), 0);
  for (std::size_t x = 0; x < costs.size(); ++x) {
    const auto& s = sums[x];
    const auto best = static_cast<std::size_t>(std::min_element(s.begin(), s.end()) - s.begin());
    int second = 255;
    for (std::size_t d = 0; d < size; ++d) {
      if (d + 1 < best || d > best + 1) second = std::min(second, s[d]);
    }
    r.choice[0][x] = static_cast<std::uint8_t>(best);
    r.choice[1][x] = static_cast<std::uint8_t>(s[best]);
    r.choice[2][x] = static_cast<std::uint8_t>(best > 0 ? s[best - 1] : 255);
    r.choice[3][x] = static_cast<std::uint8_t>(best + 1 < size ? s[best + 1] : 255);
    r.choice[4][x] = static_cast<std::uint8_t>(second);
    int least = 255;
    for (std::size_t d = 0; d < size && x + d < costs.size(); ++d) {
      if (sums[x + d][d] >= least) continue;
      least = sums[x + d][d];
      r.choice[5][x] = static_cast<std::uint8_t>(d);
    }
  }
  return r;
}

template <int kVectors>
void compareRows(Random& random) {
  for (const int width : {1, 7, 32, 101, 200}) {
    const RowCase c(width, kVectors, random);
    const RowResult scalar = runKernels<Scalar, kVectors>(c);
    INFO("width " << width << ", disparities " << c.disparities);
    CHECK((runKernels<Native, kVectors>(c) == scalar));
    const RowResult plain = plainRow(c);
    CHECK(scalar.costs == plain.costs);
    CHECK(scalar.sums == plain.sums);
    CHECK(scalar.from_below == plain.from_below);
    CHECK(scalar.from_above == plain.from_above);
    CHECK(scalar.choice == plain.choice);
  }
}

}  // namespace

TEST_CASE("depth: native lanes are the scalar twin's") {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const unsigned below = round % 3 == 0 ? 4 : 256;
    const Bytes a = randomBytes(kLanes, random, below);
    const Bytes b = randomBytes(kLanes, random, below);
    REQUIRE(operate<Native>(a, b) == operate<Scalar>(a, b));
  }
}

TEST_CASE("depth: census signs are those of facing pixels, mirrored or not") {
  Random random(2);
  constexpr int kWidth = 75;
  constexpr int kBefore = kCensusColumnReach;
  constexpr int kBehind = kCensusColumnReach + kLanes;
  std::array<Bytes, kCensusRows> rows, mirrored_rows;
  CensusRows at{}, mirrored_at{};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i] = randomBytes(kBefore + kWidth + kBehind, random, 8);
    mirrored_rows[i] = rows[i];
    std::reverse_copy(rows[i].begin(), rows[i].begin() + kBefore + kWidth + kCensusColumnReach,
                      mirrored_rows[i].begin());
    at[i] = rows[i].data() + kBefore;
    mirrored_at[i] = mirrored_rows[i].data() + kBefore;
  }
  const auto signs = [](const CensusRows& from, bool mirrored, auto lanes) {
    std::array<Bytes, kCensusPlanes> planes;
    CensusPlanes to{};
    for (std::size_t p = 0; p < planes.size(); ++p) {
      planes[p].assign(kWidth + kLanes, 0);
      to[p] = planes[p].data();
    }
    censusRow<decltype(lanes)>(from, kWidth, mirrored, to);
    for (Bytes& plane : planes) plane.resize(kWidth);
    return planes;
  };
  const auto scalar = signs(at, false, Scalar{});
  CHECK(signs(at, false, Native{}) == scalar);
  CHECK(signs(mirrored_at, true, Native{}) == signs(mirrored_at, true, Scalar{}));
  auto turned = signs(mirrored_at, true, Scalar{});
  for (Bytes& plane : turned) std::reverse(plane.begin(), plane.end());
  CHECK(turned == scalar);
  for (int x = 0; x < kWidth; ++x) {
    std::size_t i = 0;
    for (int row = -kCensusRowReach; row <= 0; ++row) {
      for (int column = -kCensusColumnReach; column <= kCensusColumnReach; ++column) {
        if (row == 0 && column >= 0) break;
        const bool sign = at[static_cast<std::size_t>(kCensusRowReach + row)][x + column] >=
                          at[static_cast<std::size_t>(kCensusRowReach - row)][x - column];
        const int kept = scalar[i / 8][static_cast<std::size_t>(x)] >> (i % 8) & 1;
        REQUIRE(kept == (sign ? 1 : 0));
        ++i;
      }
    }
    REQUIRE(i == kCensusSigns);
  }
}

TEST_CASE("depth: costs, paths and choice are the scalar twin's and those of plain loops") {
  Random random(3);
  compareRows<1>(random);
  compareRows<2>(random);
  compareRows<3>(random);
  compareRows<4>(random);
}
