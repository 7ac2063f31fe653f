#pragma once
// A slice of a kept map as pictures: what `swiftlet map slice` calls.

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/modules/map_slice.hpp"

namespace swiftlet {

struct MapSliceRequest {
  std::string map;          ///< kept map: its folder, or its volume
  std::string out;          ///< picture in colours, *.png; millimetres go to *_mm.png beside it
  std::optional<double> z;  ///< m; none: the middle of the map's height
  std::string json;         ///< file for the figures; empty: none
};

struct MapSliceResult {
  nlohmann::ordered_json summary;  ///< as written to MapSliceRequest::json
  std::string millimetres;         ///< the second picture's file
};

/// By SliceKind: names in the summary and for people.
inline constexpr std::array<const char*, kSliceKinds> kSliceKindNames{"unknown", "surface", "behind_surface",
                                                                      "at_least", "distance"};

/// Red, green, blue: surface black, behind it dark violet, "at least" blue, unknown grey; distances from dark
/// red through orange to light yellow at the reach.
std::vector<std::uint8_t> sliceColours(const MapSlice& slice);
/// Distances [mm] from 1 to 65535, rounded; 0 if none is known, and on and behind a surface.
std::vector<std::uint16_t> sliceMillimetres(const MapSlice& slice);

/// Reads the map, draws and writes. InputError for bad input, with file, option and remedy; nothing is
/// written then.
MapSliceResult runMapSlice(const MapSliceRequest& request);

}  // namespace swiftlet
