// `swiftlet map export`: the surface beside that of the run, each voxel beside the volume, slices as
// map_server reads them, and what is refused.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/lab/modules/map_export_run.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)

namespace {

namespace fs = std::filesystem;

using test::textOf;

const std::string kLog = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";

using swiftlet::test::run;

/// Lines of `key: value`, as a reader of another kind than ours takes them.
std::map<std::string, std::string> fieldsOf(const std::string& path) {
  std::map<std::string, std::string> fields;
  std::istringstream lines(textOf(path));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t colon = line.find(": ");
    REQUIRE(colon != std::string::npos);
    fields[line.substr(0, colon)] = line.substr(colon + 2);
  }
  return fields;
}

struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};

Picture pictureOf(const std::string& path, const nlohmann::json& size) {
  Picture picture;
  picture.width = size["width"];
  picture.height = size["height"];
  picture.pixels.resize(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  const std::string bytes = textOf(path);
  ImageSize found;
  ImageDecoder decoder;
  REQUIRE(decoder.decode({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()},
                         {picture.width, picture.height}, picture.pixels.data(), found) == DecodeResult::kOk);
  return picture;
}

/// A second of a flight, kept.
std::string keptFlight(const ScratchFolder& folder) {
  std::string kept = folder.file("kept.swm");
  REQUIRE(run({"fuse", kLog, "--out", folder.file("run"), "--until", "1", "--interval", "0.25", "--keep",
               kept}) == kExitDone);
  return kept;
}

TEST_CASE("an exported map is the run's, in other formats") {
  const ScratchFolder folder("map_export");
  const std::string kept = keptFlight(folder), out = folder.file("files");
  const nlohmann::json summary = runMapExport({kept, out + "/", {}});
  CHECK(textOf(out + "/surface.ply") == textOf(folder.file("run/map.ply")));
  CHECK(textOf(out + "/surface.glb") == textOf(folder.file("run/map.glb")));
  CHECK_FALSE(fs::exists(out + ".part"));
  // As the volume of a kept folder.
  fs::create_directory(folder.file("kept"));
  fs::copy_file(kept, folder.file("kept/volume.swm"));
  const nlohmann::json again = runMapExport({folder.file("kept"), folder.file("same"), {}});
  CHECK(again == summary);

  const VoxelVolume volume = readKeptVolumeFile(kept);
  const std::string voxels = textOf(out + "/voxels.ply");
  const std::string end = "end_header\n";
  std::size_t at = voxels.find(end);
  REQUIRE(at != std::string::npos);
  CHECK(voxels.find("element vertex " + std::to_string(summary["voxels"].get<std::size_t>()) + "\n") < at);
  at += end.size();
  constexpr std::size_t kFloats = 5, kBytes = kFloats * sizeof(float) + 5;
  REQUIRE(voxels.size() - at == kBytes * summary["voxels"].get<std::size_t>());
  std::size_t wrong = 0, twice = 0;
  std::set<std::array<int, 3>> seen;
  for (; at < voxels.size(); at += kBytes) {
    std::array<float, kFloats> values{};
    std::memcpy(values.data(), &voxels[at], sizeof values);
    const VoxelIndex voxel = volume.voxelAt({values[0], values[1], values[2]});
    twice += seen.insert({voxel.x, voxel.y, voxel.z}).second ? 0 : 1;
    const std::uint32_t slot = volume.find(blockOf(voxel));
    const VoxelBlock* const block = slot == VoxelVolume::kNone ? nullptr : volume.voxels(slot);
    float distance = 0;
    const bool same = block != nullptr && volume.distanceAt(voxel, distance) && distance == values[3] &&
                      values[4] == static_cast<float>(block->weight[offsetOf(voxel)]) / kWeightSteps &&
                      block->grey[offsetOf(voxel)] == static_cast<std::uint8_t>(voxels[at + sizeof values]);
    wrong += same ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(twice == 0);
  CHECK(seen.size() > 10'000);
  std::size_t held = 0;
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    if (const VoxelBlock* const block = volume.voxels(slot); block != nullptr)
      held += kBlockVoxels - static_cast<std::size_t>(std::ranges::count(block->weight, 0));
  }
  CHECK(held == seen.size());
}

TEST_CASE("an exported surface is drawn as that of the run, with a depth sensor's weights too") {
  const ScratchFolder folder("map_export_weight");
  const std::string stereo = keptFlight(folder), sensor = folder.file("sensor.swm");
  writeKeptMapFile(sensor, {readKeptVolumeFile(stereo), SurfaceSettings::kLeastSensorWeight});
  CHECK(keptMapSettings(stereo).least_weight == Approx(SurfaceSettings{}.least_weight));
  CHECK(keptMapSettings(sensor).least_weight == Approx(SurfaceSettings::kLeastSensorWeight));
  const auto faces = [&](const std::string& map, const char* out) {
    return runMapExport({map, folder.file(out), {}}).at("faces").get<int>();
  };
  CHECK(faces(sensor, "a") > faces(stereo, "b"));
}

TEST_CASE("slices lie where map_server puts them and say what the volume says") {
  const ScratchFolder folder("map_export_slices");
  const std::string kept = keptFlight(folder), out = folder.file("files");
  const nlohmann::json summary = runMapExport({kept, out, {}});
  const auto occupancy = fieldsOf(out + "/occupancy.yaml"), distance = fieldsOf(out + "/distance.yaml");
  CHECK(occupancy.at("mode") == "trinary");
  CHECK(distance.at("mode") == "raw");
  for (const auto& fields : {occupancy, distance}) CHECK(fields.at("negate") == "0");
  const double free_thresh = std::stod(occupancy.at("free_thresh"));
  const double occupied_thresh = std::stod(occupancy.at("occupied_thresh"));
  const double resolution = std::stod(occupancy.at("resolution"));
  double x = 0, y = 0, yaw = -1;
  REQUIRE(std::sscanf(occupancy.at("origin").c_str(), "[%lf, %lf, %lf]", &x, &y, &yaw) == 3);
  CHECK(yaw == 0);
  const Picture grid = pictureOf(out + "/" + occupancy.at("image"), summary["pixels"]);
  const Picture field = pictureOf(out + "/" + distance.at("image"), summary["pixels"]);
  const VoxelVolume volume = readKeptVolumeFile(kept);
  CHECK(resolution == volume.settings().voxel_size);
  std::array<std::size_t, 3> kinds{};
  std::size_t wrong = 0;
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const auto i = static_cast<std::size_t>(row * grid.width + column);
      // The lower left pixel's corner is the origin.
      const Eigen::Vector3d p(x + (column + 0.5) * resolution, y + (grid.height - row - 0.5) * resolution,
                              summary["z_m"].get<double>());
      float own = 0;
      const bool known = volume.distanceAt(volume.voxelAt(p), own);
      const double occupied = (255 - grid.pixels[i]) / 255.0;
      const int percent = field.pixels[i];
      if (occupied < free_thresh) {
        ++kinds[0];
        wrong += known && own >= 0 && percent <= 100 ? 0 : 1;
      } else if (occupied > occupied_thresh) {
        ++kinds[1];
        wrong += known && percent == 0 ? 0 : 1;
      } else {
        ++kinds[2];
        wrong += known ? (own < 0 && percent == 0 ? 0 : 1) : (percent == 255 ? 0 : 1);
      }
    }
  }
  CHECK(wrong == 0);
  CHECK(std::ranges::min(kinds) > 50);
}

TEST_CASE("distances in percent of the reach, with their ends") {
  MapSlice slice;
  slice.reach = 2;
  slice.kind = {SliceKind::kUnknown, SliceKind::kSurface,  SliceKind::kBehindSurface,
                SliceKind::kAtLeast, SliceKind::kDistance, SliceKind::kDistance};
  const float none = std::numeric_limits<float>::quiet_NaN();
  slice.distance = {none, none, none, none, 1.0F, 2.5F};
  CHECK(distancePixels(slice) == std::vector<std::uint8_t>{255, 0, 0, 100, 50, 100});
  CHECK(occupancyPixels(slice) == std::vector<std::uint8_t>{205, 0, 205, 254, 254, 254});
}

TEST_CASE("an export that cannot be done leaves no folder") {
  using Catch::Matchers::Contains;
  const ScratchFolder folder("map_export_refused");
  const std::string kept = keptFlight(folder), out = folder.file("files");
  const auto refusal = [](const MapExportRequest& request) -> std::string {
    const InputError error = test::errorOf([&] { runMapExport(request); });
    CHECK_FALSE(error.remedy.empty());
    return error.what();
  };
  CHECK_THAT(refusal({kept, out, 99}), Contains("--z"));
  CHECK_THAT(refusal({folder.path(), out, {}}), Contains("volume.swm"));
  CHECK_THAT(refusal({kept, folder.file("run"), {}}), Contains("already exists"));
  CHECK(run({"map", "export", kept, "--out", out, "--z", "99"}) == kExitBadInput);
  CHECK_FALSE(fs::exists(out));
  CHECK_FALSE(fs::exists(out + ".part"));
  fs::resize_file(kept, fs::file_size(kept) - 1);
  CHECK_THAT(refusal({kept, out, {}}), Contains("ends at byte"));
  CHECK_FALSE(fs::exists(out));
}

}  // namespace
