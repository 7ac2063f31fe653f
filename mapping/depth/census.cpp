#include "mapping/depth/census.hpp"

#include <cstddef>
#include <utility>

#include "mapping/depth/disparity_lanes.hpp"

namespace swiftlet {
namespace {

struct Place {
  int row = 0;
  int column = 0;
};

// The window's first half in reading order; the other place of each pair faces it across the centre.
constexpr std::array<Place, kCensusSigns> firstHalf() {
  std::array<Place, kCensusSigns> places;
  std::size_t i = 0;
  for (int row = -kCensusRowReach; row <= 0; ++row) {
    for (int column = -kCensusColumnReach; column <= kCensusColumnReach; ++column) {
      if (i < places.size()) places[i++] = {row, column};
    }
  }
  return places;
}
constexpr std::array<Place, kCensusSigns> kPlaces = firstHalf();

template <typename Lanes, int kDirection, std::size_t kSign>
typename Lanes::Bytes sign(const CensusRows& rows, int x) {
  constexpr Place kPlace = kPlaces[kSign];
  const std::uint8_t* const first = rows[static_cast<std::size_t>(kCensusRowReach + kPlace.row)];
  const std::uint8_t* const facing = rows[static_cast<std::size_t>(kCensusRowReach - kPlace.row)];
  constexpr int kColumn = kDirection * kPlace.column;
  return Lanes::bitAnd(Lanes::atLeast(Lanes::load(first + x + kColumn), Lanes::load(facing + x - kColumn)),
                       Lanes::broadcast(static_cast<std::uint8_t>(1U << (kSign % 8))));
}

template <typename Lanes, int kDirection, std::size_t kPlane, std::size_t... kBits>
typename Lanes::Bytes plane(const CensusRows& rows, int x, std::index_sequence<kBits...>) {
  auto signs = Lanes::broadcast(0);
  ((signs = Lanes::bitOr(signs, sign<Lanes, kDirection, 8 * kPlane + kBits>(rows, x))), ...);
  return signs;
}

template <typename Lanes, int kDirection, std::size_t... kPlane>
void planesOfRow(const CensusRows& rows, int width, const CensusPlanes& planes,
                 std::index_sequence<kPlane...>) {
  constexpr auto kSigns = static_cast<std::size_t>(kCensusSigns);
  for (int x = 0; x < width; x += disparity_lanes::kLanes) {
    (Lanes::store(
         planes[kPlane] + x,
         plane<Lanes, kDirection, kPlane>(
             rows, x, std::make_index_sequence<(kSigns - 8 * kPlane < 8 ? kSigns - 8 * kPlane : 8)>())),
     ...);
  }
}

}  // namespace

template <typename Lanes>
void censusRow(const CensusRows& rows, int width, bool mirrored, const CensusPlanes& planes) {
  constexpr std::make_index_sequence<kCensusPlanes> kAll;
  if (mirrored) {
    planesOfRow<Lanes, -1>(rows, width, planes, kAll);
  } else {
    planesOfRow<Lanes, 1>(rows, width, planes, kAll);
  }
}

template void censusRow<disparity_lanes::Scalar>(const CensusRows&, int, bool, const CensusPlanes&);
#ifdef SWIFTLET_DISPARITY_LANES_NATIVE
template void censusRow<disparity_lanes::Native>(const CensusRows&, int, bool, const CensusPlanes&);
#endif

}  // namespace swiftlet
