// `swiftlet map slice`: pixels beside brute force over the volume's voxels, across the seams of windows, and
// what it refuses.

#include <png.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/lab/modules/map_slice_run.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "mapping/distance/volume_distance.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/mapping/volume_crossings.hpp"
#include "tests/mapping/volume_scene.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

namespace {

namespace fs = std::filesystem;

constexpr double kRoom = 4;  // m, radius: wider than what one window gives
constexpr double kReach = 2;
const Ball kBall{{1.5, 0.3, 0.1}, 0.5};

double ballInRoom(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  if (const double t = kBall(origin, ray); t > 0) return t;
  const double a = ray.squaredNorm(), b = origin.dot(ray), c = origin.squaredNorm() - kRoom * kRoom;
  return (-b + std::sqrt(b * b - a * c)) / a;
}

VolumeSettings roomSettings() {
  VolumeSettings settings;
  settings.memory_bytes = std::size_t{64} << 20U;
  return settings;
}

/// Seen from the room's middle in all directions, and around the ball; not what lies in the ball.
void fuseRoom(VoxelVolume& volume) {
  VolumeIntegrator integrator(volume, kSceneCamera.pixels());
  std::vector<SE3> poses = viewsAround(kBall, 1.5);
  for (const SE3& view : viewsAround({{0, 0, 0}, 0}, 1))
    poses.push_back(lookAt(Eigen::Vector3d::Zero(), view.translation));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const SceneImage image = render(poses[i], 1.0 + static_cast<double>(i), ballInRoom);
    VolumeStep step;
    REQUIRE(integrator.step(image.view(), poses[i], {}, step).ok());
  }
  REQUIRE(volume.counters().evicted + volume.counters().evicted_free == 0);
}

void keep(const std::string& path, const VoxelVolume& volume) {
  std::ofstream out(path, std::ios::binary);
  static_cast<void>(writeKeptMap(path, out, {volume}));
}

using swiftlet::test::bytesOf;
using swiftlet::test::run;

std::vector<std::uint8_t> readColours(const std::string& path, int width, int height) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&image, path.c_str()) != 0);
  CHECK(image.format == PNG_FORMAT_RGB);
  REQUIRE(image.width == static_cast<png_uint_32>(width));
  REQUIRE(image.height == static_cast<png_uint_32>(height));
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(image));
  REQUIRE(png_image_finish_read(&image, nullptr, rgb.data(), 0, nullptr) != 0);
  return rgb;
}

std::vector<std::uint16_t> readMillimetres(const std::string& path, int width, int height) {
  std::vector<std::uint16_t> pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  ImageSize found;
  REQUIRE(ImageDecoder::decode16(bytesOf(path), {width, height}, pixels.data(), found) == DecodeResult::kOk);
  return pixels;
}

enum class Shade { kGrey, kBlack, kViolet, kBlue, kWarm };

Shade shadeOf(const std::uint8_t* rgb) {
  const int r = rgb[0], g = rgb[1], b = rgb[2];
  if (r == g && g == b) return r == 0 ? Shade::kBlack : Shade::kGrey;
  if (r < 100 && b > g) return Shade::kViolet;
  return b > r ? Shade::kBlue : Shade::kWarm;
}

struct Tally {
  int unknown = 0, surface = 0, behind = 0, at_least = 0, distances = 0;
  int wrong_unknown = 0, wrong_surface = 0, wrong_behind = 0, wrong_at_least = 0, wrong_millimetres = 0;
  int beyond_half_a_voxel = 0, silent = 0;
  double most_off = 0;
};

void compare(const VoxelVolume& volume, const std::vector<Eigen::Vector3d>& surface, const VoxelIndex& voxel,
             Shade shade, int millimetres, Tally& tally) {
  const double size = volume.settings().voxel_size;
  float own = 0;
  const bool known = volume.distanceAt(voxel, own);
  tally.wrong_unknown += known == (shade == Shade::kGrey) ? 1 : 0;
  tally.unknown += shade == Shade::kGrey ? 1 : 0;
  bool holds = false;
  forCrossings(volume, voxel, [&](const Eigen::Vector3d& to) { holds = holds || to.norm() <= 0.5; });
  tally.surface += shade == Shade::kBlack ? 1 : 0;
  tally.wrong_surface += holds != (shade == Shade::kBlack) ? 1 : 0;
  const bool behind = known && own < 0;
  tally.behind += shade == Shade::kViolet ? 1 : 0;
  tally.wrong_behind += !holds && behind != (shade == Shade::kViolet) ? 1 : 0;
  tally.wrong_millimetres += (!known || behind || shade == Shade::kBlue) && millimetres != 0 ? 1 : 0;
  if (!known || behind) return;

  const Eigen::Vector3d p = (Eigen::Vector3d(voxel.x, voxel.y, voxel.z).array() + 0.5) * size;
  double squared = std::numeric_limits<double>::max();
  for (const Eigen::Vector3d& point : surface) squared = std::min(squared, (point - p).squaredNorm());
  const double truth = std::sqrt(squared);
  if (shade == Shade::kBlue) {
    // One of the eight voxels around the point has no surface in reach.
    ++tally.at_least;
    tally.wrong_at_least += truth < kReach - 4 * size ? 1 : 0;
  } else if (millimetres == 0) {
    // The middle of the voxel lies on the surface.
    tally.silent += truth > 1e-3 ? 1 : 0;
  } else {
    ++tally.distances;
    const double off = std::abs(1e-3 * millimetres - truth);
    tally.most_off = std::max(tally.most_off, off);
    tally.beyond_half_a_voxel += off > 0.5 * size + 5e-4 ? 1 : 0;
  }
}

TEST_CASE("a slice gives what brute force over the volume's voxels gives, across windows") {
  VoxelVolume room(roomSettings());
  fuseRoom(room);
  const ScratchFolder folder("map_slice");
  const std::string kept = folder.file("room.swm"), json = folder.file("slice.json");
  keep(kept, room);
  REQUIRE(run({"map", "slice", kept, "--out", folder.file("slice.png"), "--json", json, "--z=-0.03"}) ==
          kExitDone);
  std::ifstream file(json);
  const nlohmann::json summary = nlohmann::json::parse(file);
  const int width = summary["pixels"]["width"], height = summary["pixels"]["height"];
  CHECK(width > 160);  // more than one window along each axis
  CHECK(height > 160);
  CHECK(summary["z_m"].get<double>() == Approx(-0.025));
  const std::vector<std::uint8_t> rgb = readColours(folder.file("slice.png"), width, height);
  const auto millimetres = readMillimetres(folder.file("slice_mm.png"), width, height);
  const double size = room.settings().voxel_size;
  const auto voxelsFrom = [&](const char* axis, std::size_t side) {
    return static_cast<int>(std::lround(summary["extent_m"][axis][side].get<double>() / size));
  };
  REQUIRE(voxelsFrom("x", 1) - voxelsFrom("x", 0) == width);
  REQUIRE(voxelsFrom("y", 1) - voxelsFrom("y", 0) == height);

  const std::vector<Eigen::Vector3d> surface = surfaceCrossings(room);
  Tally tally;
  double largest = 0;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const VoxelIndex voxel{voxelsFrom("x", 0) + column, voxelsFrom("y", 1) - 1 - row, -1};
      const auto pixel = static_cast<std::size_t>(row * width + column);
      const Shade shade = shadeOf(&rgb[3 * pixel]);
      compare(room, surface, voxel, shade, millimetres[pixel], tally);
      if (shade == Shade::kWarm) largest = std::max(largest, 1e-3 * millimetres[pixel]);
    }
  }
  std::printf("%d distances, off by at most %.1f mm; %d at least, %d surface, %d behind, %d unknown\n",
              tally.distances, 1e3 * tally.most_off, tally.at_least, tally.surface, tally.behind,
              tally.unknown);
  CHECK(tally.wrong_unknown == 0);
  CHECK(tally.wrong_surface == 0);
  CHECK(tally.wrong_behind == 0);
  CHECK(tally.wrong_at_least == 0);
  CHECK(tally.wrong_millimetres == 0);
  CHECK(tally.beyond_half_a_voxel == 0);
  CHECK(tally.silent == 0);
  CHECK(tally.distances > 10'000);
  CHECK(tally.at_least > 100);
  CHECK(tally.surface > 400);
  CHECK(tally.behind > 400);
  CHECK(tally.unknown > 1000);
  const auto& kinds = summary["kinds"];
  CHECK(kinds["unknown"]["pixels"] == tally.unknown);
  CHECK(kinds["surface"]["pixels"] == tally.surface);
  CHECK(kinds["behind_surface"]["pixels"] == tally.behind);
  CHECK(kinds["at_least"]["pixels"] == tally.at_least);
  CHECK(kinds["at_least"]["share"].get<double>() == Approx(1.0 * tally.at_least / (width * height)));
  CHECK(summary["largest_distance_m"].get<double>() == Approx(largest).margin(6e-4));
}

TEST_CASE("windows side by side give what one window around the whole map gives") {
  VoxelVolume room(roomSettings());
  fuseRoom(room);
  const MapSlice slice = sliceOf("room", room, {});
  DistanceLimits limits;
  limits.cells = {304, 304, 144};
  DistanceField field(limits);
  VolumeDistance distance(room, field);
  DistanceStep step;
  distance.step({}, Eigen::Vector3d::Zero(), {std::numeric_limits<std::size_t>::max()}, step);
  REQUIRE(step.caught_up);
  int other = 0;
  for (int row = 0; row < slice.height; ++row) {
    for (int column = 0; column < slice.width; ++column) {
      const Eigen::Vector2d across((column + 0.5) * slice.voxel_size, -(row + 0.5) * slice.voxel_size);
      const Eigen::Vector2d at = Eigen::Vector2d(slice.least.x(), slice.most.y()) + across;
      const DistanceSample sample = field.query(field.centreOf(field.cellOf({at.x(), at.y(), slice.z})));
      const float given = slice.distance[static_cast<std::size_t>(row * slice.width + column)];
      const bool measured = sample.kind == DistanceKind::kDistance;
      const bool same = measured ? given == static_cast<float>(sample.distance) : std::isnan(given);
      other += same ? 0 : 1;
    }
  }
  CHECK(other == 0);
}

TEST_CASE("colours grow lighter with the distance, millimetres stay in their 16 bits") {
  MapSlice slice;
  slice.reach = 2;
  slice.width = 100;
  slice.height = 1;
  for (int i = 0; i < slice.width; ++i) {
    slice.kind.push_back(SliceKind::kDistance);
    slice.distance.push_back(0.0002F + 0.02F * static_cast<float>(i));
  }
  slice.distance.back() = 100;
  const auto rgb = sliceColours(slice);
  const auto sum = [&](std::size_t i) { return rgb[3 * i] + rgb[3 * i + 1] + rgb[3 * i + 2]; };
  for (std::size_t i = 1; i < slice.kind.size(); ++i) CHECK(sum(i) > sum(i - 1));
  CHECK(sum(0) > 100);  // not black
  const auto millimetres = sliceMillimetres(slice);
  CHECK(millimetres.front() == 1);
  CHECK(millimetres[1] == 20);
  CHECK(millimetres.back() == 65535);
}

std::string refusal(const MapSliceRequest& request) {
  const InputError error = test::errorOf([&] { (void)runMapSlice(request); });
  CHECK_FALSE(error.remedy.empty());
  return error.what();
}

/// A wall seen once, and free blocks beside it.
void keepWall(const std::string& path, const std::vector<BlockIndex>& free = {}) {
  VoxelVolume volume(sceneSettings());
  VolumeIntegrator integrator(volume, kSceneCamera.pixels());
  const SE3 pose = lookAt(Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX());
  VolumeStep step;
  REQUIRE(
      integrator.step(render(pose, 1, Plane{-Eigen::Vector3d::UnitX(), -1.5}).view(), pose, {}, step).ok());
  for (const BlockIndex& block : free) volume.addFree(block, kAllParts, Eigen::Vector3f::Zero());
  keep(path, volume);
}

TEST_CASE("what cannot be drawn is refused with file, option and remedy, and nothing is written") {
  using Catch::Matchers::Contains;
  const ScratchFolder folder("map_slice_refused");
  const std::string kept = folder.file("wall.swm"), cut = folder.file("cut.swm"),
                    flipped = folder.file("flipped.swm"), empty = folder.file("empty.swm"),
                    free = folder.file("free.swm");
  keepWall(kept);
  fs::copy_file(kept, cut);
  fs::resize_file(cut, fs::file_size(cut) - 1);
  std::vector<std::uint8_t> bytes = bytesOf(kept);
  bytes[bytes.size() / 2] ^= 1U;
  std::ofstream(flipped, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  keep(empty, VoxelVolume(sceneSettings()));
  VoxelVolume seen_free(sceneSettings());
  seen_free.beginChange();
  seen_free.addFree({1, 2, 3}, kAllParts, Eigen::Vector3f::Zero());
  keep(free, seen_free);
  const std::string gap = folder.file("gap.swm"), wide = folder.file("wide.swm");
  keepWall(gap, {{3, 0, 20}});
  keepWall(wide, {{2000, 0, 0}});
  const auto files = [&] {
    return std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator());
  };
  const auto before = files();

  const std::string out = folder.file("slice.png"), json = folder.file("slice.json");
  const auto with = [&](const std::string& map, std::optional<double> z = {}) {
    return refusal({map, out, z, json});
  };
  const std::string missing = folder.file("missing.swm");
  CHECK_THAT(with(missing), Contains(missing) && Contains("cannot be opened") && Contains("--keep"));
  CHECK_THAT(with(cut), Contains(cut) && Contains("ends at byte"));
  CHECK_THAT(with(flipped), Contains(flipped) && Contains("damaged"));
  CHECK_THAT(with(folder.path()), Contains("volume.swm") && Contains("cannot be opened"));
  CHECK_THAT(with(empty), Contains(empty) && Contains("no surface"));
  CHECK_THAT(with(free), Contains(free) && Contains("no surface"));
  for (const double z : {-9.0, 9.0, 1e300, std::nan("")}) {
    CHECK_THAT(with(kept, z), Contains(kept) && Contains("--z") && Contains("outside the map") &&
                                  Contains("Give a height from"));
  }
  CHECK_THAT(with(gap, 5), Contains(gap) && Contains("--z") && Contains("nothing is known at 5.025 m"));
  CHECK_THAT(with(wide, 0.1), Contains(wide) && Contains("voxels wide") && Contains("map.voxel_size"));
  CHECK_THAT(refusal({kept, folder.file("slice.jpg"), {}, ""}), Contains("--out") && Contains(".png"));
  CHECK_THAT(refusal({kept, folder.file("no/slice.png"), {}, ""}), Contains("--out") && Contains("folder"));
  CHECK_THAT(refusal({kept, out, {}, folder.file("no/slice.json")}),
             Contains("--json") && Contains("folder"));
  CHECK_THAT(refusal({kept, out, {}, kept}), Contains("--json") && Contains("the map itself"));
  CHECK(run({"map", "slice", kept, "--out", out, "--z", "9"}) == kExitBadInput);
  CHECK(run({"map", "slice", kept}) == kExitBadInput);
  CHECK(run({"map"}) == kExitBadInput);
  CHECK(files() == before);

  CHECK(run({"map", "slice", kept, "--out", out}) == kExitDone);
  CHECK(files() == before + 2);
}

}  // namespace
