// The map's stage as a whole: depth, labels and grey values of a wall through to its surface and the distance
// field.

#include "mapping/map/map_stage.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

#include "tests/mapping/memory_storage.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr float kWall = 1.5F;  // m in front of the camera
constexpr std::uint8_t kLeft = 3;
constexpr std::uint8_t kRight = 7;

/// One camera that looks along the body's x, and a depth sensor at its place.
struct Wall {
  Wall() {
    Eigen::Matrix3d R;
    R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    rig.camera_count = 1;
    rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 160, 120, {110, 110, 79.5, 59.5}, {0, 0, 0, 0});
    rig.T_body_cam[0] = SE3(R, Eigen::Vector3d::Zero());
    sensor.camera = {110, 110, 79.5, 59.5, 160, 120};
    sensor.T_body_camera = rig.T_body_cam[0];
    depth.assign(sensor.camera.pixels(), kWall);
    grey.assign(sensor.camera.pixels(), 90);
    labels.assign(sensor.camera.pixels(), kLeft);
    for (std::size_t i = 0; i < labels.size(); ++i) {
      if (i % 160 >= 80) labels[i] = kRight;
    }
  }

  MapInput at(int i) {
    MapInput input;
    input.stamp = Stamp{100'000'000LL * (i + 1)};
    input.depth = sensor;
    input.depth.depth = depth.data();
    input.image[0] = {grey.data(), 160, 120, 160};
    input.labels = {labels.data(), 160, 120, 160};
    return input;
  }

  Rig rig;
  DepthImageView sensor;
  std::vector<float> depth;
  std::vector<std::uint8_t> grey;
  std::vector<std::uint8_t> labels;
};

MapSettings smallSettings() {
  MapSettings settings;
  settings.volume_mib = 8;
  settings.surface_mib = 4;
  return settings;
}

struct Count : SurfaceSink {
  void take(const SurfacePatch& patch) override {
    triangles += patch.triangles.size();
    for (const SurfaceVertex& vertex : patch.vertices) {
      worst = std::max(worst, std::abs(vertex.p_world.x() - kWall));
      if (vertex.label == kLeft) left += 1;
      if (vertex.label == kRight) right += 1;
      wrong_side += (vertex.label == kLeft && vertex.p_world.y() < -0.1F) ||
                            (vertex.label == kRight && vertex.p_world.y() > 0.1F)
                        ? 1
                        : 0;
      grey_off += std::abs(vertex.grey - 90) > 2 ? 1 : 0;
    }
  }
  std::size_t triangles = 0, left = 0, right = 0, wrong_side = 0, grey_off = 0;
  float worst = 0;
};

Count countOf(MapStage& map) {
  Count count;
  map.visitSurface(count);
  return count;
}

}  // namespace

TEST_CASE("a wall becomes a surface where it stands, with its labels and grey values, and a distance to it") {
  Wall wall;
  MapStage map(wall.rig, smallSettings(), &wall.sensor);
  MapReport report;
  for (int i = 0; i < 5; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
  CHECK(report.from_sensor);
  CHECK(report.with_labels);
  const Count count = countOf(map);
  CHECK(count.triangles > 1000);
  CHECK(count.worst < 0.005F);
  CHECK(count.left > 200);
  CHECK(count.right > 200);
  CHECK(count.wrong_side == 0);
  CHECK(count.grey_off == 0);
  const DistanceSample sample = map.distance().query({1.0, 0, 0});
  CHECK(sample.space == Space::kFree);
  CHECK(sample.distance == Approx(kWall - 1.0).margin(0.01));
}

TEST_CASE("a wall beyond the range is not mapped, and what lies before it within the range is free") {
  Wall wall;
  MapSettings settings = smallSettings();
  settings.most_range = 1;
  MapStage map(wall.rig, settings, &wall.sensor);
  MapReport report;
  for (int i = 0; i < 5; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
  CHECK(countOf(map).triangles == 0);
  CHECK(map.distance().query({0.6, 0, 0}).space == Space::kFree);
  CHECK(map.distance().query({1.2, 0, 0}).space == Space::kUnknown);
}

TEST_CASE("labels of moving things leave no surface") {
  Wall wall;
  MapSettings settings = smallSettings();
  settings.moving_labels = "7";
  MapStage map(wall.rig, settings, &wall.sensor);
  MapReport report;
  for (int i = 0; i < 5; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
  const Count count = countOf(map);
  CHECK(count.left > 200);
  CHECK(count.right == 0);
}

TEST_CASE("a thing that moves and is masked leaves the map as it is without it, to a voxel") {
  constexpr std::uint8_t kMoving = 9;
  constexpr int kFrames = 30, kRadius = 18;  // pixels
  const auto worst = [&](bool there, const char* masked) {
    Wall wall;
    MapSettings settings = smallSettings();
    settings.moving_labels = masked;
    MapStage map(wall.rig, settings, &wall.sensor);
    for (int frame = 0; frame < kFrames; ++frame) {
      MapInput input = wall.at(frame);
      Wall scene;
      // A disc half a metre before the wall, from one side of the view to the other.
      for (int v = 0; there && v < 120; ++v) {
        for (int u = 0; u < 160; ++u) {
          if (std::hypot(u - 5 * frame - 5, v - 60) > kRadius) continue;
          scene.depth[static_cast<std::size_t>(v * 160 + u)] = kWall - 0.5F;
          scene.labels[static_cast<std::size_t>(v * 160 + u)] = kMoving;
        }
      }
      input.depth.depth = scene.depth.data();
      input.labels.data = scene.labels.data();
      MapReport report;
      REQUIRE(map.step(input, {}, report).ok());
    }
    map.drawRest();
    const Count count = countOf(map);
    CHECK(count.triangles > 1000);
    return count.worst;
  };
  const auto voxel = static_cast<float>(smallSettings().voxel_size);
  const float without = worst(false, "");
  CHECK(worst(true, "9") <= without + voxel);
  // Else the test proves nothing.
  CHECK(worst(true, "") > without + 4 * voxel);
}

TEST_CASE("what does not fit is refused or left out, and counted") {
  Wall wall;
  MapStage map(wall.rig, smallSettings(), &wall.sensor);
  MapReport report;
  MapInput nothing;
  nothing.stamp = Stamp{1};
  CHECK(map.step(nothing, {}, report).code == StatusCode::kInvalidInput);
  CHECK(map.counters().without_depth == 1);

  MapInput small = wall.at(0);
  small.depth.camera.width = 80;
  CHECK(map.step(small, {}, report).code == StatusCode::kInvalidInput);
  CHECK(map.counters().without_depth == 2);

  MapInput labels = wall.at(1);
  labels.labels.height = 60;
  CHECK(map.step(labels, {}, report).ok());
  CHECK_FALSE(report.with_labels);
  CHECK(map.counters().wrong_size == 1);

  MapInput jump = wall.at(2);
  jump.T_map_body.translation.x() = 50;
  CHECK(map.step(jump, {}, report).code == StatusCode::kInvalidInput);
  CHECK(map.integrator().counters().pose_jumps == 1);
  CHECK(map.counters().taken == 1);
}

TEST_CASE("a new epoch is a world of its own; the surface of the old is drawn apart from it") {
  Wall wall;
  MemoryStorage storage;
  MapStage map(wall.rig, smallSettings(), &wall.sensor, &storage);
  MapReport report;
  REQUIRE(map.step(wall.at(0), {}, report).ok());
  const std::size_t before = countOf(map).triangles;
  MapInput next = wall.at(1);
  next.epoch = 1;
  next.T_map_body.translation.x() = -20;
  REQUIRE(map.step(next, {}, report).ok());
  CHECK(map.counters().epochs == 1);
  CHECK(map.submaps().stored().lost() == 0);
  CHECK(countOf(map).triangles > before / 2);
  CHECK(map.distance().query({1.0, 0, 0}).kind == DistanceKind::kUnknown);
  Count old;
  map.visitWholeSurface([](std::uint32_t epoch) { return epoch == 0; }, old);
  CHECK(old.triangles == before);
  CHECK(old.worst < 0.005F);
  Count both;
  map.visitWholeSurface([](std::uint32_t /*epoch*/) { return true; }, both);
  CHECK(both.triangles > before * 3 / 2);
}

TEST_CASE("a map without a submap left refuses the frames of a new epoch, and mixes them into no other") {
  Wall wall;
  MemoryStorage storage;
  MapStage map(wall.rig, smallSettings(), &wall.sensor, &storage);
  MapReport report;
  REQUIRE(map.step(wall.at(0), {}, report).ok());
  Submap later;
  for (std::uint64_t i = 1; i < Submaps::kMost; ++i) {
    later.stamp = wall.at(0).stamp + Duration::fromSeconds(3.0 * static_cast<double>(i));
    later.frame = i;
    map.submaps().follow(later);
  }
  REQUIRE(map.submaps().submaps().size() == Submaps::kMost);
  Count before;
  map.visitWholeSurface([](std::uint32_t /*epoch*/) { return true; }, before);
  REQUIRE(before.triangles > 0);
  for (int i = 1; i < 3; ++i) {
    MapInput next = wall.at(i);
    next.epoch = 1;
    next.T_map_body.translation.x() = -20;
    CHECK(map.step(next, {}, report).code == StatusCode::kInvalidInput);
    CHECK(std::string_view(report.status.what) == "the map is full: frames of this epoch are not mapped");
  }
  CHECK(map.counters().taken == 1);
  CHECK(map.counters().without_submap == 2);
  // Nor does surface of the old world stay around the vehicle.
  CHECK(map.volume().blockCount() == 0);
  CHECK(countOf(map).triangles == 0);
  Count after;
  map.visitWholeSurface([](std::uint32_t epoch) { return epoch == 0; }, after);
  CHECK(after.triangles == before.triangles);
  CHECK(after.worst < 0.005F);
}

TEST_CASE(
    "the whole surface of a map that nothing moved is that of its volume, bit by bit, without storage too") {
  struct Patches : SurfaceSink {
    void take(const SurfacePatch& patch) override {
      for (const SurfaceVertex& v : patch.vertices) {
        // The probability of a label that stays is not drawn anew.
        vertices.push_back({v.p_world.x(), v.p_world.y(), v.p_world.z(), static_cast<float>(v.label),
                            static_cast<float>(v.grey)});
      }
    }
    std::vector<std::array<float, 5>> vertices;
  } drawn, whole;
  Wall wall;
  MapStage map(wall.rig, smallSettings(), &wall.sensor);
  MapReport report;
  for (int i = 0; i < 5; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
  map.drawRest();
  map.visitSurface(drawn);
  map.visitWholeSurface([](std::uint32_t /*epoch*/) { return true; }, whole);
  std::ranges::sort(drawn.vertices);
  std::ranges::sort(whole.vertices);
  REQUIRE(drawn.vertices.size() > 1000);
  REQUIRE(drawn.vertices.size() == whole.vertices.size());
  std::size_t differ = 0;
  for (std::size_t i = 0; i < whole.vertices.size(); ++i)
    differ += drawn.vertices[i] != whole.vertices[i] ? 1 : 0;
  CHECK(differ == 0);
}

TEST_CASE("surface that is shown moves with its submap") {
  Wall wall;
  MemoryStorage storage;
  MapStage map(wall.rig, smallSettings(), &wall.sensor, &storage);
  MapReport report;
  for (int i = 0; i < 3; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
  CHECK(countOf(map).worst < 0.005F);
  const std::size_t triangles = countOf(map).triangles;
  map.correct(std::vector<WorldInMap>{{0, 0, SE3(Eigen::Quaterniond::Identity(), {0.3, 0, 0}), {}}});
  const Count moved = countOf(map);
  CHECK(moved.triangles == triangles);
  CHECK(moved.worst == Approx(0.3F).margin(0.005));
}

TEST_CASE("a frame that is not mapped is no anchor of what is mapped after it") {
  Wall wall;
  MemoryStorage storage;
  MapStage map(wall.rig, smallSettings(), &wall.sensor, &storage);
  MapReport report;
  const auto bad = GENERATE(std::numeric_limits<double>::quiet_NaN(), 500.0);
  REQUIRE(map.step(wall.at(0), {}, report).ok());
  for (int i = 30; i < 35; ++i) {
    MapInput input = wall.at(i);
    input.frame = static_cast<std::uint64_t>(i);
    input.T_map_body.translation.y() = -20;  // another part of the wall
    if (i == 30) input.T_map_body.translation.x() = bad;
    const bool refused = map.step(input, {}, report).code == StatusCode::kInvalidInput;
    CHECK((refused || i > 30));
  }
  REQUIRE(map.counters().taken >= 3);
  // The smoother has found where that frame was.
  const SE3 found{Eigen::Quaterniond::Identity(), {0, -20, 0}};
  map.correct(std::vector<WorldInMap>{{0, 0, {}, {}}, {30, 0, found, found}});
  const Submaps& submaps = map.submaps().submaps();
  for (std::size_t i = 0; i < submaps.size(); ++i) CHECK(submaps[i].T_map_world.translation.allFinite());
  Count whole;
  map.visitWholeSurface([](std::uint32_t /*epoch*/) { return true; }, whole);
  CHECK(whole.triangles > 1000);
  CHECK(whole.worst < 0.005F);
}

TEST_CASE("the same input gives the same bytes") {
  std::vector<double> distances[2];
  std::size_t triangles[2];
  for (int run = 0; run < 2; ++run) {
    Wall wall;
    MapStage map(wall.rig, smallSettings(), &wall.sensor);
    MapReport report;
    for (int i = 0; i < 3; ++i) REQUIRE(map.step(wall.at(i), {}, report).ok());
    triangles[run] = countOf(map).triangles;
    for (int x = 0; x < 30; ++x)
      distances[run].push_back(map.distance().query({0.05 * x, 0.1, 0.1}).distance);
  }
  CHECK(distances[0] == distances[1]);
  CHECK(triangles[0] == triangles[1]);
}

TEST_CASE("moving labels are a list of numbers from 1 to 31") {
  CHECK(labelMask("") == 0U);
  CHECK(labelMask("1") == 2U);
  CHECK(labelMask("10,12") == ((1U << 10U) | (1U << 12U)));
  for (const char* bad : {"0", "32", "a", "1,,2", "1, 2", "-3", "1.5"}) CHECK_FALSE(labelMask(bad));
}
