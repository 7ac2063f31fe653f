// Marching cubes, the store and the stage: closed surfaces, the right places, the same from nothing.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <tuple>

#include "estimator/core/random.hpp"
#include "mapping/surface/cube_cases.hpp"
#include "mapping/surface/surface_stage.hpp"
#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

namespace {

/// Patches joined where vertices have the same position, bit by bit.
struct Joined : SurfaceSink {
  using Place = std::array<float, 3>;
  std::map<Place, std::uint32_t> at;
  std::vector<SurfaceVertex> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::map<BlockIndex, std::size_t> patches;

  void take(const SurfacePatch& patch) override {
    ++patches[patch.block];
    for (const SurfaceTriangle& t : patch.triangles) {
      std::array<std::uint32_t, 3> joined{};
      for (std::size_t i = 0; i < 3; ++i) {
        const SurfaceVertex& v = patch.vertices[t[i]];
        const Place place = {v.p_world.x(), v.p_world.y(), v.p_world.z()};
        const auto [it, fresh] = at.emplace(place, static_cast<std::uint32_t>(vertices.size()));
        if (fresh) vertices.push_back(v);
        joined[i] = it->second;
      }
      triangles.push_back(joined);
    }
  }
  /// How often each edge is walked one way more than the other; none in a closed surface.
  [[nodiscard]] std::vector<std::pair<std::uint32_t, std::uint32_t>> openEdges() const {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> walked;
    for (const auto& t : triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t a = t[i], b = t[(i + 1) % 3];
        walked[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
      }
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> open;
    for (const auto& [edge, count] : walked) {
      if (count != 0) open.push_back(edge);
    }
    return open;
  }
};

Joined surfaceOf(const VoxelVolume& volume, const SurfaceSettings& settings = {}) {
  const ConfusionModel confusion;
  BlockSurface surface(volume, confusion, settings);
  const auto patch = std::make_unique<SurfacePatch>();
  Joined joined;
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    surface.extract(slot, *patch);
    joined.take(*patch);
  }
  return joined;
}

/// Sets `side`^3 blocks around the origin from a function of the voxel.
template <typename F>
void fill(VoxelVolume& volume, int side, const F& value) {
  volume.beginChange();
  for (int z = 0; z < side; ++z) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const BlockIndex index{x - side / 2, y - side / 2, z - side / 2};
        const std::uint32_t slot = volume.obtain(index);
        VoxelBlock& block = volume.changeVoxels(slot);
        for (std::size_t i = 0; i < kBlockVoxels; ++i) {
          const VoxelIndex voxel{index.x * kBlockSide + static_cast<int>(i & kBlockMask),
                                 index.y * kBlockSide + static_cast<int>((i >> kBlockBits) & kBlockMask),
                                 index.z * kBlockSide + static_cast<int>(i >> (2 * kBlockBits))};
          block.distance[i] = value(voxel);
          block.weight[i] = 256;
        }
        volume.changeHeader(slot).sides = BlockHeader::kInFront | BlockHeader::kBehind;
        volume.markChanged(slot);
      }
    }
  }
}

const Ball kBall{{0.03, -0.02, 0.01}, 0.5};

struct Mapped {
  explicit Mapped(const VolumeSettings& settings = sceneSettings(), std::size_t store_bytes = 4 << 20)
      : volume(settings),
        integrator(volume, kSceneCamera.pixels()),
        store(store_bytes, settings.voxel_size * kBlockSide),
        stage(volume, confusion, store) {}
  void add(const SceneImage& image, const SE3& pose) {
    (void)integrator.step(image.view(), pose, {}, fused);
    REQUIRE(stage.step(pose.translation.cast<float>(), kAllSurface, drawn).ok());
  }
  Joined all() {
    Joined joined;
    const auto patch = std::make_unique<SurfacePatch>();
    store.visit(joined, *patch);
    return joined;
  }
  VoxelVolume volume;
  VolumeIntegrator integrator;
  ConfusionModel confusion;
  SurfaceStore store;
  SurfaceStage stage;
  VolumeStep fused;
  SurfaceStep drawn;
};

}  // namespace

TEST_CASE("every case of a cube is made of loops over its crossed edges") {
  for (unsigned behind = 0; behind < 256; ++behind) {
    const CubeCase& cube = kCubeCases[behind];
    std::array<bool, 12> used{};
    for (std::size_t i = 0; i < std::size_t{3} * cube.triangles; ++i) used[cube.edge[i]] = true;
    for (std::size_t e = 0; e < 12; ++e) {
      const bool crossed = ((behind >> kCubeEdges[e].from) & 1U) != ((behind >> kCubeEdges[e].to) & 1U);
      CHECK(used[e] == crossed);
    }
  }
}

TEST_CASE("random fields give closed surfaces, across blocks and in ambiguous cubes") {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    VoxelVolume volume(sceneSettings());
    Random random(seed);
    constexpr int kSide = 3;
    fill(volume, kSide, [&](const VoxelIndex& voxel) {
      constexpr int kFirst = -(kSide / 2) * kBlockSide, kLast = kFirst + kSide * kBlockSide - 1;
      const bool border =
          std::min({voxel.x, voxel.y, voxel.z}) == kFirst || std::max({voxel.x, voxel.y, voxel.z}) == kLast;
      const int value = static_cast<int>(random.below(60000)) - 30000;
      return static_cast<std::int16_t>(border ? std::abs(value) + 1 : value);
    });
    const Joined joined = surfaceOf(volume);
    CHECK(joined.triangles.size() > 10000);
    CHECK(joined.openEdges().empty());
    for (const auto& t : joined.triangles) {
      REQUIRE(t[0] != t[1]);
      REQUIRE(t[1] != t[2]);
      REQUIRE(t[0] != t[2]);
    }
  }
}

TEST_CASE("a ball: closed, in place, with normals outwards and one label") {
  Mapped map;
  double time = 1;
  for (const SE3& pose : viewsAround(kBall, 1.5)) {
    time += 1;
    SceneImage image = render(pose, time, kBall);
    image.labels.assign(image.depth.size(), 7);
    image.grey.assign(image.depth.size(), 99);
    map.add(image, pose);
  }
  const Joined joined = map.all();
  CHECK(joined.triangles.size() > 1000);
  double square = 0;
  for (const SurfaceVertex& v : joined.vertices) {
    const Eigen::Vector3d out = v.p_world.cast<double>() - kBall.centre;
    square += std::pow(out.norm() - kBall.radius, 2);
    REQUIRE(std::abs(out.norm() - kBall.radius) < 0.02);
    const Eigen::Vector3d normal(v.normal[0] / 127.0, v.normal[1] / 127.0, v.normal[2] / 127.0);
    REQUIRE(normal.norm() == Approx(1).margin(0.02));
    REQUIRE(normal.dot(out.normalized()) > 0.9);
    REQUIRE(v.label == 7);
    REQUIRE(v.probability > 220);
    REQUIRE(v.grey == 99);
  }
  // Half a pixel at 1.5 m.
  CHECK(std::sqrt(square / static_cast<double>(joined.vertices.size())) < 0.5 * 1.5 / kSceneCamera.fx);
  CHECK(joined.openEdges().empty());
  for (const auto& t : joined.triangles) {
    const Eigen::Vector3f a = joined.vertices[t[0]].p_world, b = joined.vertices[t[1]].p_world,
                          c = joined.vertices[t[2]].p_world;
    const Eigen::Vector3f across = (b - a).cross(c - a);
    if (across.norm() > 1e-5F) REQUIRE(across.dot((a - kBall.centre.cast<float>())) > 0);
  }
}

TEST_CASE("open edges lie where observation ends") {
  Mapped map;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0.2, 0.1});
  map.add(render(pose, 1, Plane{{-1, 0, 0}, -2}), pose);
  const Joined joined = map.all();
  const auto open = joined.openEdges();
  CHECK(!open.empty());
  for (const auto& [a, b] : open) {
    // Next to an open edge some voxel was not observed.
    const Eigen::Vector3d p = 0.5 * (joined.vertices[a].p_world + joined.vertices[b].p_world).cast<double>();
    const VoxelIndex at = map.volume.voxelAt(p);
    bool unknown = false;
    for (int i = 0; i < 27; ++i) {
      float distance = 0;
      unknown =
          unknown || !map.volume.distanceAt(at + VoxelIndex{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1}, distance);
    }
    REQUIRE(unknown);
  }
}

TEST_CASE("a limit on steps leaves out what only joins a thing to the free space beside it") {
  VoxelVolume volume(sceneSettings());
  fill(volume, 2, [](const VoxelIndex& v) { return static_cast<std::int16_t>(v.x < 0 ? -3000 : 32767); });
  CHECK(surfaceOf(volume).triangles.size() > 100);
  SurfaceSettings settings;
  settings.most_step = 2;
  CHECK(surfaceOf(volume, settings).triangles.empty());
}

TEST_CASE("drawn as it changes it is what is drawn from nothing") {
  VolumeSettings settings = sceneSettings();
  settings.change_tolerance = 0;
  Mapped map(settings);
  double time = 1;
  int count = 0;
  for (const SE3& pose : viewsAround(kBall, 1.5)) {
    time += 1;
    SceneImage image = render(pose, time, kBall);
    image.labels.assign(image.depth.size(), static_cast<std::uint8_t>(1 + count++ % 3));
    map.add(image, pose);
  }
  const Joined once = surfaceOf(map.volume), followed = map.all();
  REQUIRE(once.triangles.size() == followed.triangles.size());
  REQUIRE(once.vertices.size() == followed.vertices.size());
  const auto corners = [](const Joined& joined) {
    std::vector<std::tuple<float, float, float, int, int, int, int, int>> list;
    for (const auto& v : joined.vertices) {
      list.emplace_back(v.p_world.x(), v.p_world.y(), v.p_world.z(), v.normal[0], v.normal[1], v.normal[2],
                        v.label, v.probability);
    }
    std::ranges::sort(list);
    return list;
  };
  CHECK(corners(once) == corners(followed));
}

TEST_CASE("with a tolerance what is not drawn again lies within it") {
  Mapped map;
  double time = 1;
  Random random(4);
  for (int round = 0; round < 2; ++round) {
    for (const SE3& pose : viewsAround(kBall, 1.5)) {
      time += 1;
      SceneImage image = render(pose, time, kBall);
      for (float& d : image.depth) d *= static_cast<float>(random.uniform(0.995, 1.005));
      map.add(image, pose);
    }
  }
  const Joined once = surfaceOf(map.volume), followed = map.all();
  std::size_t far = 0;
  for (const SurfaceVertex& v : followed.vertices) {
    float nearest = 1;
    for (const SurfaceVertex& w : once.vertices) nearest = std::min(nearest, (v.p_world - w.p_world).norm());
    far += nearest > 0.002F ? 1U : 0U;
  }
  CHECK(far < followed.vertices.size() / 200);
}

TEST_CASE("few blocks a step end at the same surface") {
  Mapped all, few;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0.2, 0.1});
  const SceneImage image = render(pose, 1, Plane{{-1, 0, 0}, -2});
  all.add(image, pose);
  (void)few.integrator.step(image.view(), pose, {}, few.fused);
  int steps = 0;
  while (few.stage.step({0, 0, 0}, {5}, few.drawn).code == StatusCode::kCapacityReached) {
    REQUIRE(few.drawn.drawn <= 5);
    ++steps;
  }
  CHECK(steps > 3);
  CHECK(few.all().triangles.size() == all.all().triangles.size());
}

TEST_CASE("under a bound of work the nearest come first and none waits for ever") {
  Mapped map;
  constexpr int kSide = 4;
  fill(map.volume, kSide,
       [](const VoxelIndex& v) { return static_cast<std::int16_t>((v.x & 3) < 2 ? -900 : 900); });
  const std::size_t blocks = map.volume.blockCount();
  const Eigen::Vector3f vehicle(0.9F, 0.1F, -0.3F);
  constexpr SurfaceEffort kFew{7};
  std::map<BlockIndex, int> drawn_at;
  const auto step = [&](int i) {
    CHECK(map.stage.step(vehicle, kFew, map.drawn).code == StatusCode::kCapacityReached);
    CHECK(map.drawn.drawn == kFew.blocks);
    for (const auto& [block, patches] : map.all().patches) drawn_at.try_emplace(block, i);
  };
  const std::size_t pass = (blocks + kFew.blocks - 1) / kFew.blocks;
  for (std::size_t i = 0; i < pass; ++i) {
    step(static_cast<int>(i));
    // Everything changes all the time.
    map.volume.beginChange();
    for (std::uint32_t slot = 0; slot < map.volume.slots(); ++slot) {
      if (map.volume.voxels(slot) != nullptr) map.volume.markChanged(slot);
    }
  }
  REQUIRE(drawn_at.size() == blocks);
  for (const auto& [a, first] : drawn_at) {
    for (const auto& [b, second] : drawn_at) {
      if (first < second)
        CHECK((map.volume.centreOf(a) - vehicle).norm() <= (map.volume.centreOf(b) - vehicle).norm() + 1e-5F);
    }
  }
  CHECK(map.stage.step(vehicle, kAllSurface, map.drawn).ok());
}

TEST_CASE("evicted surface stays in the store") {
  VolumeSettings settings = sceneSettings();
  settings.memory_bytes = 150 * 8000;
  Mapped map(settings);
  for (int i = 0; i < 40; ++i) {
    const double y = 0.25 * i;
    const SE3 pose = lookAt({1.5, y, 0}, {3, y, 0});
    map.add(render(pose, 1 + i, Plane{{-1, 0, 0}, -3}), pose);
  }
  REQUIRE(map.volume.counters().evicted > 20);
  const Joined joined = map.all();
  CHECK(joined.patches.size() > map.volume.blockCapacity() / 2);
  // The whole wall that was passed, in steps of a voxel; a seam of a voxel may be open.
  std::size_t missing = 0;
  for (double y = -0.5; y <= 10; y += 0.05) {
    bool covered = false;
    for (const SurfaceVertex& v : joined.vertices) {
      covered = covered ||
                (std::abs(static_cast<double>(v.p_world.y()) - y) < 0.06 && std::abs(v.p_world.z()) < 0.06F);
    }
    missing += covered ? 0U : 1U;
  }
  CHECK(missing == 0);
  for (const SurfaceVertex& v : joined.vertices) REQUIRE(std::abs(v.p_world.x() - 3) < 0.02F);
}

namespace {

SurfacePatch patchAt(std::int32_t x, std::size_t triangles, std::uint8_t grey) {
  SurfacePatch patch;
  patch.block = {x, 0, 0};
  for (std::size_t i = 0; i < triangles + 2; ++i) {
    SurfaceVertex v;
    v.p_world = Eigen::Vector3f(static_cast<float>(x), static_cast<float>(i), 0.5F);
    v.grey = grey;
    (void)patch.vertices.tryPushBack(v);
  }
  for (std::size_t i = 0; i < triangles; ++i) {
    (void)patch.triangles.tryPushBack({static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(i + 1),
                                       static_cast<std::uint16_t>(i + 2)});
  }
  return patch;
}

bool same(const SurfacePatch& a, const SurfacePatch& b) {
  if (!(a.block == b.block) || a.vertices.size() != b.vertices.size() ||
      a.triangles.size() != b.triangles.size())
    return false;
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    if (a.vertices[i].p_world != b.vertices[i].p_world || a.vertices[i].grey != b.vertices[i].grey)
      return false;
  }
  return std::equal(a.triangles.begin(), a.triangles.end(), b.triangles.begin());
}

}  // namespace

TEST_CASE("the store gives back what was put, newest first in its place") {
  SurfaceStore store(1 << 20, 0.4);
  const auto read = std::make_unique<SurfacePatch>();
  std::map<std::int32_t, SurfacePatch> oracle;
  Random random(6);
  for (int i = 0; i < 2000; ++i) {
    const auto x = static_cast<std::int32_t>(random.below(60));
    const std::size_t triangles = random.below(4) == 0 ? 0 : random.below(200) + 1;
    const SurfacePatch patch = patchAt(x, triangles, static_cast<std::uint8_t>(i));
    store.put(patch, Eigen::Vector3f::Zero());
    if (triangles == 0) {
      oracle.erase(x);
    } else {
      oracle[x] = patch;
    }
    REQUIRE(store.patches() == oracle.size());
  }
  for (const auto& [x, patch] : oracle) {
    const std::uint32_t entry = store.find({x, 0, 0});
    REQUIRE(entry != SurfaceStore::kNone);
    REQUIRE(store.read(entry, *read));
    REQUIRE(same(*read, patch));
  }
  CHECK(store.counters().dropped == 0);
  store.clear();
  CHECK(store.patches() == 0);
  CHECK(store.pagesUsed() == 0);
}

TEST_CASE("a full store drops the farthest and keeps the nearest") {
  SurfaceStore store(40 * 3000, 0.4);
  const std::size_t bytes = store.bytes();
  for (std::int32_t x = 0; x < 300; ++x)
    store.put(patchAt(x, 150, 1), Eigen::Vector3f(0.4F * static_cast<float>(x), 0, 0));
  CHECK(store.counters().dropped > 200);
  CHECK(store.counters().dropped + store.patches() == 300);
  CHECK(store.find({299, 0, 0}) != SurfaceStore::kNone);
  CHECK(store.find({0, 0, 0}) == SurfaceStore::kNone);
  CHECK(store.bytes() == bytes);
  // One that is itself the farthest goes at once, unless there is room.
  const std::uint64_t dropped = store.counters().dropped;
  for (std::int32_t x = -500; x < -495; ++x) store.put(patchAt(x, 150, 1), Eigen::Vector3f(120, 0, 0));
  CHECK(store.counters().dropped > dropped);
  CHECK(store.find({299, 0, 0}) != SurfaceStore::kNone);
}
