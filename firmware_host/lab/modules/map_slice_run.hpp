#pragma once
// Draws a slice of a kept map as images: called by `swiftlet map slice`.

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/modules/map_slice.hpp"

namespace swiftlet {

struct MapSliceRequest {
  std::string map;          ///< kept map: its folder or its volume
  std::string out;          ///< colour image, *.png; millimetres go to *_mm.png beside it
  std::optional<double> z;  ///< m; empty: the middle of the map's height
  std::string json;         ///< file for the figures; empty: none
};

struct MapSliceResult {
  nlohmann::ordered_json summary;  ///< as written to MapSliceRequest::json
  std::string millimetres;         ///< file of the second image
};

/// Names in the summary and for users, by SliceKind.
inline constexpr std::array<const char*, kSliceKinds> kSliceKindNames{"unknown", "surface", "behind_surface",
                                                                      "at_least", "distance"};

/// Red, green, blue: surface black, behind it dark violet, "at least" blue, unknown grey; distances from dark
/// red through orange to light yellow at the reach.
std::vector<std::uint8_t> sliceColours(const MapSlice& slice);
/// Distances [mm] from 1 to 65535, rounded; 0 if none is known, and on and behind a surface.
std::vector<std::uint16_t> sliceMillimetres(const MapSlice& slice);

/// Reads the map, draws and writes. InputError for bad input, with file, option and remedy; then nothing is
/// written.
MapSliceResult runMapSlice(const MapSliceRequest& request);

}  // namespace swiftlet
