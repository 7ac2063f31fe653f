#include "firmware_host/lab/modules/map_slice_run.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/image_files.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Colour = std::array<double, 3>;

constexpr Colour kBlack{0, 0, 0}, kGrey{150, 150, 150}, kViolet{75, 35, 95}, kBlue{130, 175, 235};
constexpr std::array<Colour, 4> kRamp{{{110, 10, 15}, {215, 85, 20}, {250, 180, 60}, {255, 252, 215}}};

/// Colour at `part` (0 to 1) of the ramp.
Colour rampAt(double part) {
  const double at = std::clamp(part, 0.0, 1.0) * (kRamp.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(at), kRamp.size() - 2);
  const double share = at - static_cast<double>(below);
  Colour colour{};
  for (std::size_t i = 0; i < colour.size(); ++i)
    colour[i] = (1 - share) * kRamp[below][i] + share * kRamp[below + 1][i];
  return colour;
}

Colour colourOf(const MapSlice& slice, std::size_t pixel) {
  switch (slice.kind[pixel]) {
    case SliceKind::kSurface:
      return kBlack;
    case SliceKind::kBehindSurface:
      return kViolet;
    case SliceKind::kAtLeast:
      return kBlue;
    case SliceKind::kDistance:
      return rampAt(static_cast<double>(slice.distance[pixel]) / slice.reach);
    case SliceKind::kUnknown:
      break;
  }
  return kGrey;
}

/// Checks the output before the work is done.
void checkOutput(const MapSliceRequest& request, const std::string& path, const char* option) {
  std::error_code none;
  if (!fs::is_directory(fs::absolute(path).parent_path(), none) || fs::is_directory(path, none)) {
    throw InputError(path, 0, option, "is not a file in a folder that exists",
                     "Create the folder first, or give another file");
  }
  if (fs::equivalent(path, request.map, none))
    throw InputError(path, 0, option, "is the map itself", "Give another file");
}

Json summaryOf(const MapSliceRequest& request, const MapSlice& slice, const std::string& millimetres) {
  Json json;
  json["version"] = versionJson();
  json["run"] = {{"command", "map slice"}, {"map", request.map}};
  json["pictures"] = {{"colours", request.out}, {"millimetres", millimetres}};
  json["z_m"] = slice.z;
  json["pixel_m"] = slice.voxel_size;
  json["extent_m"] = {{"x", {slice.least.x(), slice.most.x()}}, {"y", {slice.least.y(), slice.most.y()}}};
  json["pixels"] = {{"width", slice.width}, {"height", slice.height}};
  const auto counts = slice.counts();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const double share = static_cast<double>(counts[i]) / static_cast<double>(slice.kind.size());
    json["kinds"][kSliceKindNames[i]] = {{"pixels", counts[i]}, {"share", share}};
  }
  json["reach_m"] = slice.reach;
  json["largest_distance_m"] = slice.largestDistance();
  return json;
}

/// Writes to temporary names first, so that a full disk leaves neither file.
void write(const MapSliceRequest& request, const MapSlice& slice, const MapSliceResult& result) {
  const std::array<std::string, 2> files{request.out, result.millimetres};
  const std::array<std::string, 2> parts{files[0] + ".part", files[1] + ".part"};
  try {
    writePngRgb8(parts[0], sliceColours(slice).data(), slice.width, slice.height);
    writePng16(parts[1], sliceMillimetres(slice).data(), slice.width, slice.height);
    if (!request.json.empty()) writeJson(request.json, result.summary);
  } catch (...) {
    std::error_code none;
    for (const std::string& part : parts) fs::remove(part, none);
    throw;
  }
  for (std::size_t i = 0; i < files.size(); ++i) commitPart(parts[i], files[i]);
}

}  // namespace

std::vector<std::uint8_t> sliceColours(const MapSlice& slice) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * slice.kind.size());
  for (std::size_t i = 0; i < slice.kind.size(); ++i) {
    for (const double value : colourOf(slice, i))
      rgb.push_back(static_cast<std::uint8_t>(std::lround(value)));
  }
  return rgb;
}

std::vector<std::uint16_t> sliceMillimetres(const MapSlice& slice) {
  std::vector<std::uint16_t> millimetres(slice.kind.size());
  for (std::size_t i = 0; i < millimetres.size(); ++i) {
    const double distance = static_cast<double>(slice.distance[i]);
    // False for NaN.
    if (distance > 0)
      millimetres[i] = static_cast<std::uint16_t>(std::clamp(std::round(1e3 * distance), 1.0, 65535.0));
  }
  return millimetres;
}

MapSliceResult runMapSlice(const MapSliceRequest& request) {
  const fs::path out(request.out);
  if (out.extension() != ".png")
    throw InputError(request.out, 0, "--out", "is not the name of a PNG file",
                     "Give a name that ends in .png");
  MapSliceResult result;
  result.millimetres = out.parent_path() / (out.stem().string() + "_mm.png");
  checkOutput(request, request.out, "--out");
  checkOutput(request, result.millimetres, "--out");
  if (!request.json.empty()) checkOutput(request, request.json, "--json");
  const std::string kept = keptVolumeOf(request.map);
  const MapSlice slice = sliceOf(kept, readKeptVolumeFile(kept), request.z);
  result.summary = summaryOf(request, slice, result.millimetres);
  write(request, slice, result);
  return result;
}

}  // namespace swiftlet
