#include "mapping/place/fast_score.hpp"

#include <array>

namespace swiftlet {
namespace {

constexpr std::size_t kCircle = 16;
struct Offset {
  int x, y;
};
// The circle of radius 3, clockwise from the pixel below the centre.
constexpr std::array<Offset, kCircle> kOffsets = {{{0, 3},
                                                   {1, 3},
                                                   {2, 2},
                                                   {3, 1},
                                                   {3, 0},
                                                   {3, -1},
                                                   {2, -2},
                                                   {1, -3},
                                                   {0, -3},
                                                   {-1, -3},
                                                   {-2, -2},
                                                   {-3, -1},
                                                   {-3, 0},
                                                   {-3, 1},
                                                   {-2, 2},
                                                   {-1, 3}}};

// Largest of the minima over nine neighbours in a row. Two arcs that begin next to each other share eight
// values: only arcs of eight that begin at odd places are needed.
template <typename Lanes>
typename Lanes::Bytes bestArc(const std::array<typename Lanes::Bytes, kCircle>& d) {
  std::array<typename Lanes::Bytes, kCircle / 2> two, four;
  const auto at = [](std::size_t i) { return i % kCircle; };
  for (std::size_t h = 0; h < kCircle / 2; ++h) two[h] = Lanes::min(d[2 * h + 1], d[at(2 * h + 2)]);
  for (std::size_t h = 0; h < kCircle / 2; ++h) four[h] = Lanes::min(two[h], two[(h + 1) % (kCircle / 2)]);
  auto best = Lanes::zero();
  for (std::size_t h = 0; h < kCircle / 2; ++h) {
    const auto eight = Lanes::min(four[h], four[(h + 2) % (kCircle / 2)]);  // 2h + 1 .. 2h + 8
    const auto ninth = Lanes::max(d[2 * h], d[at(2 * h + 9)]);
    best = Lanes::max(best, Lanes::min(eight, ninth));
  }
  return best;
}

}  // namespace

template <typename Lanes>
void fastScoreRow(const std::uint8_t* row, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                  std::uint8_t* score) {
  static_assert(Lanes::kWidth + 3 <= kFastScoreOverrun);
  using Bytes = typename Lanes::Bytes;
  std::array<std::ptrdiff_t, kCircle> to;
  for (std::size_t i = 0; i < kCircle; ++i) to[i] = kOffsets[i].y * stride + kOffsets[i].x;
  for (int x = begin; x < end; x += Lanes::kWidth) {
    const std::uint8_t* here = row + x;
    const Bytes centre = Lanes::load(here);
    // An arc of nine holds at least one of every two opposite pixels.
    Bytes bright = Lanes::max(Lanes::load(here + to[0]), Lanes::load(here + to[8]));
    bright = Lanes::min(bright, Lanes::max(Lanes::load(here + to[4]), Lanes::load(here + to[12])));
    Bytes dark = Lanes::min(Lanes::load(here + to[0]), Lanes::load(here + to[8]));
    dark = Lanes::max(dark, Lanes::min(Lanes::load(here + to[4]), Lanes::load(here + to[12])));
    if (!Lanes::anyAbove(Lanes::max(Lanes::above(bright, centre), Lanes::above(centre, dark)), least)) {
      Lanes::store(score + x, Lanes::zero());
      continue;
    }
    std::array<Bytes, kCircle> brighter, darker;
    for (std::size_t i = 0; i < kCircle; ++i) {
      const Bytes value = Lanes::load(here + to[i]);
      brighter[i] = Lanes::above(value, centre);
      darker[i] = Lanes::above(centre, value);
    }
    Lanes::store(score + x, Lanes::max(bestArc<Lanes>(brighter), bestArc<Lanes>(darker)));
  }
}

template <typename Lanes>
void peaksOfRow(const std::uint8_t* scores, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                std::uint8_t* peaks) {
  using Bytes = typename Lanes::Bytes;
  const Bytes one = Lanes::broadcast(1);
  const Bytes below_least = Lanes::broadcast(static_cast<std::uint8_t>(least - 1));
  for (int x = begin; x < end; x += Lanes::kWidth) {
    const std::uint8_t* here = scores + x;
    const std::uint8_t* up = here - stride;
    const std::uint8_t* down = here + stride;
    const Bytes before = Lanes::max(Lanes::max(Lanes::load(up - 1), Lanes::load(up)),
                                    Lanes::max(Lanes::load(up + 1), Lanes::load(here - 1)));
    const Bytes after = Lanes::max(Lanes::max(Lanes::load(down - 1), Lanes::load(down)),
                                   Lanes::max(Lanes::load(down + 1), Lanes::load(here + 1)));
    // A peak is above the neighbours before it and at least equal to those after it (above them less one).
    const Bytes limit = Lanes::max(Lanes::max(before, below_least), Lanes::above(after, one));
    Lanes::store(peaks + x, Lanes::above(Lanes::load(here), limit));
  }
}

template void peaksOfRow<byte_lanes::Native>(const std::uint8_t*, std::ptrdiff_t, int, int, std::uint8_t,
                                             std::uint8_t*);
template void peaksOfRow<byte_lanes::Scalar>(const std::uint8_t*, std::ptrdiff_t, int, int, std::uint8_t,
                                             std::uint8_t*);
template void fastScoreRow<byte_lanes::Native>(const std::uint8_t*, std::ptrdiff_t, int, int, std::uint8_t,
                                               std::uint8_t*);
template void fastScoreRow<byte_lanes::Scalar>(const std::uint8_t*, std::ptrdiff_t, int, int, std::uint8_t,
                                               std::uint8_t*);

}  // namespace swiftlet
