// A volume whose submaps move: what leaves it, what comes back, and the whole that is laid together in the
// end.

#include "mapping/map/map_submaps.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "mapping/map/kept_submaps.hpp"
#include "mapping/surface/surface_stage.hpp"
#include "tests/mapping/memory_storage.hpp"
#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

const std::vector<SE3> kViews = viewsAround(kOffGridBall, 2.5);
/// The first frame of the half that is out of place, and by how much.
constexpr std::size_t kMoved = 13;
const SE3 kWrong{Eigen::Quaterniond::Identity(), {0.15, -0.1, 0.05}};
/// Distances that were moved are a little less exact than those that were fused.
constexpr double kMovedShare = 1.15;
const Eigen::Vector3d kBox{5, 5, 2.4};

struct Whole {
  double error = 0;   ///< mean of the vertices' distances from the ball's surface [m]
  double weight = 0;  ///< of voxels near the surface
  std::size_t vertices = 0;
};

struct Map {
  explicit Map(std::size_t bytes = std::size_t{8} << 20U)
      : volume(settingsOf(bytes)),
        integrator(volume, kSceneCamera.pixels()),
        confusion(kLabelValues, 0.9F),
        submaps(volume, &storage, MapPoses::kEstimated, kBox) {
    integrator.setOverflow(&submaps);
  }
  static VolumeSettings settingsOf(std::size_t bytes) {
    VolumeSettings settings = sceneSettings();
    settings.memory_bytes = bytes;
    return settings;
  }

  void fuse(std::size_t i, const SE3& T_map_world = {}, std::uint32_t epoch = 0) {
    // The second half comes back a while after the first.
    const SceneImage image =
        render(kViews[i], 0.1 * static_cast<double>(i) + (i < kMoved ? 1 : 21), kOffGridBall);
    VolumeStep step;
    integrator.restart();  // views are far apart
    submaps.follow({image.stamp, i, epoch, kViews[i], T_map_world, T_map_world});
    REQUIRE(integrator.step(image.view(), T_map_world * kViews[i], {}, step).code !=
            StatusCode::kInvalidInput);
  }
  void fuseAll(const SE3& second_half = {}) {
    for (std::size_t i = 0; i < kViews.size(); ++i) fuse(i, i < kMoved ? SE3{} : second_half);
  }
  [[nodiscard]] std::size_t storedVoxels() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < submaps.stored().size(); ++i) count += submaps.stored()[i].is_free ? 0 : 1;
    return count;
  }
  void settle() {
    CorrectionStep step;
    while (submaps.busy()) submaps.step({0, 0, 0}, {}, step);
  }
  Whole whole(const std::function<bool(const Submap&)>& wanted = [](const Submap&) { return true; }) {
    Whole out;
    SurfacePatch patch;
    submaps.visitWhole(wanted, [&](const VoxelVolume& tile, std::span<const std::uint32_t> slots) {
      BlockSurface surface(tile, confusion, {});
      for (const std::uint32_t slot : slots) {
        surface.extract(slot, patch);
        for (const SurfaceVertex& vertex : patch.vertices) {
          out.error +=
              std::abs((vertex.p_world.cast<double>() - kOffGridBall.centre).norm() - kOffGridBall.radius);
          ++out.vertices;
        }
        const VoxelBlock* const block = tile.voxels(slot);
        for (std::size_t i = 0; block != nullptr && i < kBlockVoxels; ++i) {
          if (std::abs(block->distance[i]) < kDistanceSteps / 2) out.weight += block->weight[i];
        }
      }
    });
    REQUIRE(out.vertices > 500);
    out.error /= static_cast<double>(out.vertices);
    return out;
  }

  MemoryStorage storage;
  VoxelVolume volume;
  VolumeIntegrator integrator;
  ConfusionModel confusion;
  MapSubmaps submaps;
};

WorldInMap worldOfView(std::size_t view, const SE3& T_map_world) {
  return {view, 0, T_map_world * kViews[view], kViews[view]};
}

/// What loop closure says: the second half is in place after all.
std::vector<WorldInMap> rightWorlds(const SE3& second_half = {}) {
  return {worldOfView(0, {}), worldOfView(kMoved - 1, {}), worldOfView(kMoved, second_half),
          worldOfView(kViews.size() - 1, second_half)};
}

}  // namespace

TEST_CASE("a map half of whose images were out of place becomes as if they had not been") {
  Map right, wrong, never;
  right.fuseAll();
  never.fuseAll(kWrong);
  wrong.fuseAll(kWrong);
  const Whole good = right.whole();
  CHECK(never.whole().error > 5 * good.error);
  wrong.submaps.correct(rightWorlds());
  CHECK(wrong.submaps.counters().corrections == 1);
  CHECK(wrong.submaps.counters().blocks_moved > 50);
  const Whole put_right = wrong.whole();
  CHECK(put_right.error < kMovedShare * good.error);
  // Nothing is missing, and nothing in twice.
  CHECK(put_right.weight == Approx(good.weight).epsilon(0.03));
  CHECK(put_right.vertices > good.vertices * 95 / 100);
}

TEST_CASE("a volume with room for one thing of six loses none of them") {
  Map large, small(std::size_t{2} << 20U);
  for (Map* map : {&large, &small}) {
    for (int thing = 0; thing < 6; ++thing) {
      const Eigen::Vector3d at(6.0 * thing, 0, 0);
      for (std::size_t i = 0; i < kViews.size(); ++i) {
        SceneImage image = render(kViews[i], 10.0 * thing + 0.1 * static_cast<double>(i + 1), kOffGridBall);
        VolumeStep step;
        SE3 pose = kViews[i];
        pose.translation += at;
        map->integrator.restart();
        map->submaps.follow({image.stamp, static_cast<std::uint64_t>(image.stamp.ns), 0, pose, {}, {}});
        REQUIRE(map->integrator.step(image.view(), pose, {}, step).code != StatusCode::kInvalidInput);
      }
    }
  }
  REQUIRE(large.volume.counters().evicted == 0);
  REQUIRE(large.volume.blockCount() > 3 * small.volume.blockCapacity());
  REQUIRE(small.volume.counters().evicted > 2 * small.volume.blockCapacity());
  const Whole all = large.whole(), put_together = small.whole();
  CHECK(put_together.vertices == Approx(static_cast<double>(all.vertices)).epsilon(0.02));
  CHECK(put_together.weight == Approx(all.weight).epsilon(0.02));
}

TEST_CASE("a volume smaller than what one image shows loses none of its surface") {
  Map large, tiny(std::size_t{200} << 10U);
  for (Map* map : {&large, &tiny}) {
    for (std::size_t i = 0; i < kViews.size(); ++i) {
      const SceneImage image = render(kViews[i], 0.1 * static_cast<double>(i) + 1, kOffGridBall);
      VolumeStep step;
      map->integrator.restart();
      map->submaps.follow({image.stamp, i, 0, kViews[i], {}, {}});
      REQUIRE(map->integrator.step(image.view(), kViews[i], {}, step).ok());
    }
  }
  REQUIRE(large.volume.blockCount() > 5 * tiny.volume.blockCapacity());
  CHECK(tiny.submaps.counters().blocks_apart > 0);
  const Whole all = large.whole(), put_together = tiny.whole();
  CHECK(put_together.vertices == Approx(static_cast<double>(all.vertices)).epsilon(0.02));
  CHECK(put_together.error < kMovedShare * all.error);
}

TEST_CASE("what has left the volume for a correction comes back as hints, which are not stored again") {
  Map map;
  map.fuseAll(kWrong);
  const std::size_t held = map.volume.blockCount();
  map.submaps.correct(rightWorlds());
  const std::size_t left = map.volume.blockCount();
  CHECK(left < held);
  REQUIRE(map.submaps.busy());
  CorrectionStep step;
  map.submaps.step({0, 0, 0}, {.blocks = 1}, step);
  CHECK(step.blocks == 1);
  CHECK_FALSE(step.done);
  map.settle();
  CHECK(map.volume.blockCount() > held * 9 / 10);
  const std::size_t stored = map.storedVoxels();
  map.submaps.storeAll();
  CHECK(map.storedVoxels() - stored <= left);
  // Far from there nothing comes back.
  Map away;
  away.fuseAll(kWrong);
  away.submaps.correct(rightWorlds());
  const std::size_t there = away.volume.blockCount();
  while (away.submaps.busy()) away.submaps.step({50, 0, 0}, {}, step);
  CHECK(away.volume.blockCount() == there);
}

TEST_CASE("free space moves with its submaps, in the whole and in the volume") {
  struct Free {
    std::size_t parts = 0;
    double nearest = 10;  ///< m, of a part's middle to the ball's
    void add(const VoxelVolume& volume, std::uint32_t slot) {
      const BlockHeader& header = volume.header(slot);
      for (int i = 0; i < 64; ++i) {
        if ((header.free_parts >> static_cast<unsigned>(i) & 1U) == 0) continue;
        ++parts;
        const Eigen::Vector3d part(i % 4, i / 4 % 4, i / 16);
        const Eigen::Vector3d block(header.index.x, header.index.y, header.index.z);
        const Eigen::Vector3d p =
            volume.settings().voxel_size * (8 * block + 2 * part + Eigen::Vector3d::Ones());
        nearest = std::min(nearest, (p - kOffGridBall.centre).norm());
      }
    }
  };
  const auto freeWhole = [](Map& map) {
    Free free;
    map.submaps.visitWhole([](const Submap&) { return true; },
                           [&](const VoxelVolume& tile, std::span<const std::uint32_t> slots) {
                             for (const std::uint32_t slot : slots) free.add(tile, slot);
                           });
    return free;
  };
  const auto freeHeld = [](const Map& map) {
    Free free;
    for (std::uint32_t slot = 0; slot < map.volume.slots(); ++slot) free.add(map.volume, slot);
    return free;
  };
  // By whole parts: of others only what is free around them too stays.
  const SE3 by_parts{Eigen::Quaterniond::Identity(), {0, -0.1, 0}};
  Map right, wrong;
  for (std::size_t i = kMoved; i < kViews.size(); ++i) {
    right.fuse(i);
    wrong.fuse(i, by_parts);
  }
  const Free all = freeWhole(right);
  REQUIRE(all.parts > 1000);
  wrong.submaps.correct(rightWorlds());
  const Free left = freeHeld(wrong), moved = freeWhole(wrong);
  // Less than all: blocks with voxels of other places have room for them.
  CHECK(moved.parts > all.parts * 2 / 5);
  CHECK(moved.nearest > all.nearest - 0.5 * right.volume.settings().voxel_size);
  wrong.settle();
  const Free back = freeHeld(wrong);
  CHECK(left.parts < all.parts / 10);
  CHECK(back.parts > all.parts * 2 / 5);
  CHECK(back.nearest > all.nearest - 0.5 * right.volume.settings().voxel_size);
  // Hints are not stored.
  wrong.submaps.storeAll();
  CHECK(freeWhole(wrong).parts == moved.parts);
  // Those of before go when something moves again.
  wrong.submaps.correct(rightWorlds({Eigen::Quaterniond::Identity(), {0.1, 0, 0}}));
  const Free again = freeHeld(wrong);
  CHECK(again.parts < all.parts / 10);
  wrong.settle();
  CHECK(freeHeld(wrong).parts > all.parts * 2 / 5);
}

TEST_CASE("a second correction ends where both lead") {
  Map right, map;
  right.fuseAll();
  map.fuseAll(kWrong);
  map.submaps.correct(rightWorlds({Eigen::Quaterniond::Identity(), {-0.2, 0.1, 0}}));
  CorrectionStep step;
  map.submaps.step({0, 0, 0}, {.blocks = 10}, step);
  map.submaps.correct(rightWorlds());
  map.settle();
  CHECK(map.whole().error < kMovedShare * right.whole().error);
}

TEST_CASE("less than half a voxel leaves the volume as it is, and still counts in the whole") {
  Map map, right;
  map.fuseAll();
  right.fuseAll();
  const double voxel = sceneSettings().voxel_size;
  const SE3 little(Eigen::Quaterniond::Identity(), {0.4 * voxel, 0, 0});
  map.submaps.correct(std::vector<WorldInMap>{worldOfView(0, little)});
  CHECK(map.submaps.counters().blocks_moved == 0);
  const double before = right.whole().error;
  CHECK(map.whole().error > before + 0.1 * voxel);
  map.submaps.correct(std::vector<WorldInMap>{worldOfView(0, {})});
  CHECK(map.whole().error < kMovedShare * before);
}

TEST_CASE("images from before and after a correction do not share a block") {
  Map map;
  map.fuse(0, kWrong);
  REQUIRE(map.submaps.stored().size() == 0);
  map.submaps.correct(
      std::vector<WorldInMap>{worldOfView(0, SE3(Eigen::Quaterniond::Identity(), {0.14, -0.1, 0.05}))});
  CHECK(map.submaps.counters().blocks_moved == 0);  // 1 cm
  // The same view, better placed.
  map.fuse(1, SE3(Eigen::Quaterniond::Identity(), {0.14, -0.1, 0.05}));
  CHECK(map.submaps.submaps().size() == 2);
  CHECK(map.submaps.stored().size() > 10);
}

TEST_CASE("what vanishes while nobody looks leaves no ghost once its place is seen again") {
  Map map(std::size_t{1} << 20U);
  double time = 1;
  const auto see = [&](const SE3& pose, const auto& shape) {
    const SceneImage image = render(pose, time += 1, shape);
    VolumeStep step;
    map.integrator.restart();
    map.submaps.follow({image.stamp, static_cast<std::uint64_t>(time), 0, pose, {}, {}});
    REQUIRE(map.integrator.step(image.view(), pose, {}, step).code != StatusCode::kInvalidInput);
  };
  const auto wall = [&](double x, double y, double z = 0) {
    see(lookAt({x, y, z}, {3, y, z}), Plane{{-1, 0, 0}, -3});
  };
  const auto ghosts = [&] {
    std::size_t count = 0;
    SurfacePatch patch;
    map.submaps.visitWhole([](const Submap&) { return true; },
                           [&](const VoxelVolume& tile, std::span<const std::uint32_t> slots) {
                             BlockSurface surface(tile, map.confusion, {});
                             for (const std::uint32_t slot : slots) {
                               surface.extract(slot, patch);
                               for (const SurfaceVertex& v : patch.vertices)
                                 count += v.p_world.cast<double>().norm() < kOffGridBall.radius + 0.1 ? 1 : 0;
                             }
                           });
    return count;
  };
  for (const SE3& pose : viewsAround(kOffGridBall, 1.5)) see(pose, kOffGridBall);
  for (int i = 4; i < 40; ++i) wall(1.5, 0.25 * i);
  REQUIRE(map.volume.counters().evicted > 20);
  REQUIRE(ghosts() > 500);  // the ball, which nobody has missed yet
  // It went: the wall behind it is seen through its place.
  for (int i = 0; i < 6; ++i) {
    for (const double z : {-0.5, -0.25, 0.0, 0.25, 0.5}) {
      for (const double y : {-0.6, -0.2, 0.2, 0.6}) wall(-1.5, y, z);
    }
  }
  CHECK(ghosts() == 0);
}

TEST_CASE("epochs that nothing ties are drawn each by itself") {
  Map map, right;
  right.fuseAll();
  for (std::size_t i = 0; i < kViews.size(); ++i) {
    if (i == kMoved) {
      map.submaps.storeAll();
      map.volume.clear();
    }
    map.fuse(i, i < kMoved ? SE3{} : kWrong, i < kMoved ? 0 : 1);
  }
  // Nor do blocks of the one come back into the other, until they are tied.
  const std::size_t held = map.volume.blockCount();
  map.settle();
  CHECK(map.volume.blockCount() == held);
  CHECK(map.submaps.counters().blocks_back == 0);
  const Whole first = map.whole([](const Submap& submap) { return submap.epoch == 0; });
  CHECK(first.error < 2 * right.whole().error);
  const Whole second = map.whole([](const Submap& submap) { return submap.epoch == 1; });
  CHECK(second.error > 5 * first.error);
}

TEST_CASE("a storage that is full or missing costs blocks, counted, and nothing else") {
  Map map(std::size_t{512} << 10U);
  map.storage.most = 100'000;
  map.fuseAll();
  CHECK(map.submaps.stored().size() > 0);
  CHECK(map.submaps.stored().lost() > 0);
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  const std::uint32_t slot = volume.obtain({1, 2, 3});
  volume.changeVoxels(slot).weight.fill(7);
  volume.changeHeader(slot).observed = true;
  StoredBlocks nowhere(volume.settings(), nullptr, [](auto...) { return true; });
  nowhere.put(volume, slot);
  CHECK(nowhere.size() == 0);
  CHECK(nowhere.lost() == 1);
}

TEST_CASE("blocks that cannot be read are counted; what comes after them is stored") {
  Map map;
  map.fuse(0);
  map.submaps.storeAll();
  const std::size_t stored = map.storedVoxels();
  REQUIRE(stored > 0);
  map.volume.clear();
  map.storage.readable = false;
  map.settle();
  CHECK(map.submaps.stored().readsFailed() == stored);
  // It would be merged with what is there.
  map.fuse(1);
  map.submaps.storeAll();
  CHECK(map.submaps.stored().readsFailed() > stored);
  CHECK(map.submaps.stored().lost() == 0);
  map.storage.readable = true;
  CHECK(map.whole().error < 0.01);
}

TEST_CASE("a block that finds no room for its labels leaves what was stored before") {
  MemoryStorage storage;
  StoredBlocks stored(sceneSettings(), &storage, [](auto...) { return true; });
  StoredBlock block{}, read{};
  block.index = {1, 2, 3};
  block.submap = 4;
  block.voxels.weight.fill(7);
  stored.put(block);
  storage.most = storage.bytes.size();
  block.submap = 5;
  block.has_labels = true;
  stored.put(block);
  CHECK(stored.lost() == 1);
  REQUIRE(stored.size() == 1);
  REQUIRE(stored.read(0, read));
  CHECK(read.submap == 4);
  CHECK_FALSE(read.has_labels);
  CHECK(read.voxels.weight == block.voxels.weight);
  CHECK(stored.bytesStored() == storage.bytes.size());
}

TEST_CASE("a place that is seen again and again takes no more room, and gathers weight") {
  Map once, often;
  for (int round = 0; round < 5; ++round) {
    for (Map* map : {&once, &often}) {
      if (map == &once && round > 0) continue;
      SceneImage image = render(kViews[0], 20.0 * round + 1, kOffGridBall);
      VolumeStep step;
      map->integrator.restart();
      map->submaps.follow({image.stamp, static_cast<std::uint64_t>(round), 0, kViews[0], {}, {}});
      REQUIRE(map->integrator.step(image.view(), kViews[0], {}, step).ok());
    }
  }
  CHECK(often.submaps.submaps().size() == 5);
  const Whole one = once.whole(), five = often.whole();
  for (Map* map : {&once, &often}) map->submaps.storeAll();
  CHECK(often.submaps.stored().size() == once.submaps.stored().size());
  CHECK(often.storage.bytes.size() == once.storage.bytes.size());
  CHECK(five.weight == Approx(5 * one.weight).epsilon(0.01));
  CHECK(five.error == Approx(one.error).epsilon(0.01));
}

TEST_CASE("the same input gives the same bytes in the storage") {
  std::vector<std::byte> bytes[2];
  for (auto& run : bytes) {
    Map map(std::size_t{512} << 10U);
    map.fuseAll(kWrong);
    map.submaps.correct(rightWorlds());
    map.settle();
    map.submaps.storeAll();
    run = map.storage.bytes;
  }
  CHECK(bytes[0].size() > 0);
  CHECK(bytes[0] == bytes[1]);
}

namespace {

constexpr std::uint64_t kKeptFrame = 1000;
constexpr std::uint32_t kKeptEpoch = 100;

/// The node of a kept map at a view, as it was and as it is by now.
WorldInMap keptNode(std::size_t view, const SE3& T_kept_map, const SE3& moved = {}) {
  const SE3 T_world_body = T_kept_map * kViews[view];
  return {kKeptFrame + view, kKeptEpoch, moved * T_world_body, T_world_body};
}

std::vector<WorldInMap> keptNodes(const SE3& T_kept_map, const SE3& moved = {}) {
  std::vector<WorldInMap> nodes;
  for (std::size_t i = 0; i < kViews.size(); ++i) nodes.push_back(keptNode(i, T_kept_map, moved));
  return nodes;
}

/// All that another flight, out of place by T_kept_map, has mapped.
void takeKept(Map& map, const SE3& T_kept_map = {}) {
  Map before;
  for (std::size_t i = 0; i < kViews.size(); ++i) before.fuse(i, T_kept_map);
  const VoxelVolume whole = before.submaps.wholeVolume([](const Submap&) { return true; });
  KeptSubmaps kept(map.submaps, keptNodes(T_kept_map));
  StoredBlock block;
  for (std::uint32_t slot = 0; slot < whole.slots(); ++slot) {
    // As a file has it: whether an image saw it is not said.
    const BlockHeader& header = whole.header(slot);
    block.index = header.index;
    block.free_parts = header.state == BlockState::kFree ? header.free_parts : 0;
    if (header.state == BlockState::kVoxels) block.voxels = *whole.voxels(slot);
    block.setLabels(whole.labels(slot));
    if (header.state != BlockState::kUnused) kept.take(block);
  }
  REQUIRE(map.submaps.stored().lost() == 0);
}

}  // namespace

TEST_CASE("a kept map lies around the vehicle for as long as the flight is located in it") {
  Map full;
  full.fuseAll();
  const std::size_t all = full.volume.blockCount();
  Map map;
  takeKept(map);
  CHECK(map.submaps.submaps().size() == kViews.size());
  // Nobody knows where this is, least of all that it is 3 m from there.
  const SE3 elsewhere{Eigen::Quaterniond::Identity(), {3, 0, 0}};
  map.fuse(0, elsewhere);
  map.settle();
  const std::size_t own = map.volume.blockCount();
  CHECK(own < all / 2);

  const auto located = [&](const SE3& T_map_world) {
    std::vector<WorldInMap> worlds = keptNodes({});
    worlds.insert(worlds.begin(), worldOfView(0, T_map_world));
    map.submaps.correct(worlds);
    map.settle();
  };
  located({});
  CHECK(map.volume.blockCount() > all * 9 / 10);
  // Hints are in the flight's own blocks, which leave when it moves.
  located({Eigen::Quaterniond::Identity(), {0.05, 0, 0}});
  CHECK(map.volume.blockCount() > all * 9 / 10);
  // Taken back, and found again.
  map.submaps.correct(std::vector<WorldInMap>{worldOfView(0, elsewhere)});
  map.settle();
  CHECK(map.volume.blockCount() <= own);
  located({});
  CHECK(map.volume.blockCount() > all * 9 / 10);
}

TEST_CASE("a kept map is moved by the nodes of its graph") {
  Map right, map;
  right.fuseAll();
  takeKept(map, kWrong);
  map.fuse(0);
  const auto is_kept = [](const Submap& submap) { return submap.epoch == kKeptEpoch; };
  CHECK(map.whole(is_kept).error > 5 * right.whole().error);
  std::vector<WorldInMap> worlds = keptNodes(kWrong, kWrong.inverse());
  worlds.insert(worlds.begin(), worldOfView(0, {}));
  map.submaps.correct(worlds);
  const Whole moved = map.whole(is_kept);
  CHECK(moved.error < kMovedShare * right.whole().error);
  CHECK(moved.vertices > right.whole().vertices * 95 / 100);
}

TEST_CASE("a map of more nodes than there can be submaps is taken with some of them") {
  Map map;
  std::vector<WorldInMap> nodes;
  for (std::size_t i = 0; i < 3 * KeptSubmaps::kMost; ++i) {
    nodes.push_back(keptNode(i % kViews.size(), {}));
    nodes.back().frame = kKeptFrame + i;
  }
  const KeptSubmaps kept(map.submaps, nodes);
  CHECK(map.submaps.submaps().size() <= KeptSubmaps::kMost);
  CHECK(map.submaps.submaps().size() > KeptSubmaps::kMost / 2);
}
