// Blocks laid over others: as if their images had been fused there.

#include "mapping/map/block_blend.hpp"

#include <bit>
#include <catch2/catch.hpp>
#include <random>

#include "mapping/volume/block_update.hpp"
#include "tests/mapping/memory_storage.hpp"
#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr BlockRange kAll{{-100, -100, -100}, {100, 100, 100}};

/// The true signed distance around the ball in every voxel nearer to its surface than `band` voxels.
StoredBlock ballBlock(const BlockIndex& index, const VolumeSettings& settings, double band = 3) {
  StoredBlock block;
  block.index = index;
  block.voxels.grey.fill(90);
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    const Eigen::Vector3d voxel(8.0 * index.x + static_cast<double>(at & 7U) + 0.5,
                                8.0 * index.y + static_cast<double>(at >> 3U & 7U) + 0.5,
                                8.0 * index.z + static_cast<double>(at >> 6U) + 0.5);
    const double d = (settings.voxel_size * voxel - kOffGridBall.centre).norm() - kOffGridBall.radius;
    block.voxels.distance[at] = static_cast<std::int16_t>(
        std::lround(std::clamp(d / settings.truncation, -1.0, 1.0) * kDistanceSteps));
    block.voxels.weight[at] = std::abs(d) < band * settings.voxel_size ? 512 : 0;
  }
  return block;
}

std::vector<StoredBlock> ballBlocks(const VolumeSettings& settings) {
  std::vector<StoredBlock> blocks;
  for (int z = -4; z <= 4; ++z) {
    for (int y = -4; y <= 4; ++y) {
      for (int x = -4; x <= 4; ++x) {
        const StoredBlock block = ballBlock({x, y, z}, settings);
        if (std::ranges::any_of(block.voxels.weight, [](auto w) { return w > 0; })) blocks.push_back(block);
      }
    }
  }
  return blocks;
}

double weightOf(const VoxelBlock& block) {
  double sum = 0;
  for (const std::uint16_t w : block.weight) sum += w;
  return sum;
}

}  // namespace

TEST_CASE("a block that has not moved is taken bit by bit") {
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  BlockBlend blend(volume);
  StoredBlock block = ballBlock({2, 0, -1}, volume.settings());
  block.has_labels = volume.settings().labels;
  for (std::size_t i = 0; i < kBlockVoxels; i += 3)
    block.labels.counts[i].add(static_cast<std::uint8_t>(1 + i % 31));
  blend.add(block, {}, kAll);
  REQUIRE(volume.blockCount() == 1);
  const std::uint32_t slot = volume.find(block.index);
  REQUIRE(slot != VoxelVolume::kNone);
  const VoxelBlock& got = *volume.voxels(slot);
  CHECK(got.weight == block.voxels.weight);
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    if (block.voxels.weight[i] == 0) continue;
    REQUIRE(got.distance[i] == block.voxels.distance[i]);
    REQUIRE(got.grey[i] == 90);
    if (volume.labels(slot) != nullptr)
      REQUIRE(volume.labels(slot)->counts[i].words() == block.labels.counts[i].words());
  }
  CHECK(volume.header(slot).sides == sidesOf(got));
}

TEST_CASE("a ball moved by any motion is the moved ball, to its bend") {
  const VolumeSettings settings = sceneSettings();
  const std::vector<StoredBlock> blocks = ballBlocks(settings);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> along(-1, 1);
  for (int trial = 0; trial < 8; ++trial) {
    const Eigen::Vector3d axis = Eigen::Vector3d(along(random), along(random), along(random)).normalized();
    const SE3 motion(Eigen::Quaterniond(Eigen::AngleAxisd(trial == 0 ? 0 : 3 * along(random), axis)),
                     0.3 * Eigen::Vector3d(along(random), along(random), along(random)));
    VoxelVolume volume(settings);
    volume.beginChange();
    BlockBlend blend(volume);
    double weight_before = 0;
    for (const StoredBlock& block : blocks) {
      blend.add(block, motion, kAll);
      weight_before += weightOf(block.voxels);
    }
    const Eigen::Vector3d centre = motion * kOffGridBall.centre;
    // Half a diagonal of way over a surface of the least radius that is looked at.
    const double bend = 0.75 * settings.voxel_size * settings.voxel_size / (2 * 0.9 * kOffGridBall.radius);
    double weight = 0, squares = 0;
    std::size_t count = 0, off = 0;
    for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
      const VoxelBlock* const block = volume.voxels(slot);
      if (block == nullptr) continue;
      weight += weightOf(*block);
      const BlockIndex index = volume.header(slot).index;
      for (std::size_t at = 0; at < kBlockVoxels; ++at) {
        if (block->weight[at] == 0) continue;
        // Each voxel comes from one block alone.
        REQUIRE(block->weight[at] == 512);
        const Eigen::Vector3d p =
            settings.voxel_size * Eigen::Vector3d(8.0 * index.x + static_cast<double>(at & 7U) + 0.5,
                                                  8.0 * index.y + static_cast<double>(at >> 3U & 7U) + 0.5,
                                                  8.0 * index.z + static_cast<double>(at >> 6U) + 0.5);
        const double d = (p - centre).norm() - kOffGridBall.radius;
        if (std::abs(d) > 0.6 * settings.truncation) continue;  // cut within its neighbourhood
        const double error = std::abs(static_cast<double>(volume.distanceStep()) * block->distance[at] - d);
        squares += error * error;
        ++count;
        off += error > bend + 0.02 * settings.voxel_size ? 1 : 0;
      }
    }
    // As much surface as there was; the edges of the band fall to one side or the other.
    CHECK(weight == Approx(weight_before).epsilon(0.03));
    // At the corners of a block a voxel may be the only one that is known along an axis.
    CHECK(static_cast<double>(off) < 0.02 * static_cast<double>(count));
    CHECK(std::sqrt(squares / static_cast<double>(count)) < 0.04 * settings.voxel_size);
  }
}

TEST_CASE("two blocks of one place average by weight") {
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  BlockBlend blend(volume);
  StoredBlock a, b;
  a.voxels.distance.fill(1000);
  a.voxels.weight.fill(100);
  a.voxels.grey.fill(0);  // free so far
  b.voxels.distance.fill(-2000);
  b.voxels.weight.fill(200);
  b.voxels.grey.fill(50);
  b.voxels.weight[7] = 0;
  blend.add(a, {}, kAll);
  blend.add(b, {}, kAll);
  const VoxelBlock& got = *volume.voxels(volume.find({}));
  CHECK(got.distance[0] == -1000);
  CHECK(got.weight[0] == 300);
  CHECK(got.grey[0] == 50);
  CHECK(got.distance[7] == 1000);
  CHECK(got.weight[7] == 100);
  a.voxels.weight.fill(65000);
  blend.add(a, {}, kAll);
  CHECK(got.weight[0] == static_cast<int>(volume.settings().most_weight * kWeightSteps));
}

TEST_CASE("what is free later ends what stood there; a mismatch of little weight does not") {
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  BlockBlend blend(volume);
  StoredBlock thing, free, mismatch;
  thing.voxels.distance.fill(-9000);
  thing.voxels.weight.fill(1000);
  thing.voxels.grey.fill(10);
  free.voxels.distance.fill(32767);
  free.voxels.weight.fill(300);
  free.voxels.grey.fill(0);
  mismatch = thing;
  mismatch.voxels.weight.fill(20);
  blend.add(thing, {}, kAll);
  const VoxelBlock& got = *volume.voxels(volume.find({}));
  blend.add(free, {}, kAll);
  CHECK(got.distance[0] == 32767);
  CHECK(got.weight[0] == 300);
  CHECK(got.grey[0] == 0);
  blend.add(thing, {}, kAll);
  CHECK(got.distance[0] == -9000);
  CHECK(got.weight[0] == 1000);
  mismatch.voxels.distance.fill(32767);
  blend.add(mismatch, {}, kAll);
  CHECK(got.distance[0] < -8000);
  CHECK(got.weight[0] == 1020);
  // Without voxels of its own, by parts.
  StoredBlock seen_free;
  seen_free.free_parts = partBit(0, 0, 0);
  blend.add(seen_free, {}, kAll);
  CHECK(got.weight[0] == 0);
  CHECK(got.weight[2] == 1020);
  CHECK(got.weight[offsetOf({1, 1, 1})] == 0);
}

TEST_CASE("a later pass that is sure ends what stood there, however often that was seen") {
  for (const int images : {2, 3}) {
    VoxelVolume volume(sceneSettings());
    volume.beginChange();
    BlockBlend blend(volume);
    StoredBlock thing, free;
    thing.voxels.distance.fill(-9000);
    thing.voxels.weight.fill(static_cast<std::uint16_t>(volume.settings().most_weight * kWeightSteps));
    thing.voxels.grey.fill(10);
    free.voxels.distance.fill(32767);
    free.voxels.weight.fill(static_cast<std::uint16_t>(static_cast<float>(images) * kWeightSteps));
    free.voxels.grey.fill(0);
    blend.add(thing, {}, kAll);
    blend.add(free, {}, kAll);
    CHECK((volume.voxels(volume.find({}))->distance[0] > 0) == (images == 3));
  }
}

TEST_CASE("free parts move with their blocks: those of which every voxel's middle falls into one") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const VolumeSettings settings = sceneSettings();
  for (int round = 0; round < 10; ++round) {
    SE3 motion{Eigen::Quaterniond(1, unit(random), unit(random), unit(random)).normalized(),
               {unit(random), unit(random), unit(random)}};
    if (round == 0) motion = {};
    // Neighbours, so that parts lie across their border.
    std::vector<StoredBlock> blocks(4);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      blocks[i].index = {static_cast<int>(i % 2), static_cast<int>(i / 2), 0};
      blocks[i].free_parts = i == 0 ? kAllParts : random() | std::uint64_t{random()} << 32U;
    }
    VoxelVolume volume(settings);
    volume.beginChange();
    // A block with voxels stays one.
    const BlockIndex taken = blockOf(volume.voxelAt(motion * Eigen::Vector3d::Constant(0.1)));
    REQUIRE(volume.obtain(taken) != VoxelVolume::kNone);
    BlockBlend blend(volume);
    const BlockRange range{{-12, -12, -12}, {12, 12, 12}};
    blend.beginFree(range);
    for (const StoredBlock& block : blocks) blend.addFree(block, motion);
    blend.endFree();
    const SE3 back = motion.inverse();
    const auto isFree = [&](const VoxelIndex& voxel) {
      const Eigen::Vector3d middle =
          settings.voxel_size * (Eigen::Vector3d(voxel.x, voxel.y, voxel.z).array() + 0.5);
      const VoxelIndex from = volume.voxelAt(back * middle);
      for (const StoredBlock& block : blocks) {
        if (block.index == blockOf(from)) return (block.free_parts & partBitAt(offsetOf(from))) != 0;
      }
      return false;
    };
    std::size_t wrong = 0, free = 0;
    for (int z = -12; z <= 12; ++z) {
      for (int y = -12; y <= 12; ++y) {
        for (int x = -12; x <= 12; ++x) {
          const BlockIndex index{x, y, z};
          std::uint64_t parts = kAllParts;
          for (int at = 0; at < static_cast<int>(kBlockVoxels); ++at) {
            const VoxelIndex voxel{8 * x + at % 8, 8 * y + at / 8 % 8, 8 * z + at / 64};
            if (!isFree(voxel)) parts &= ~partBitAt(static_cast<std::size_t>(at));
          }
          const std::uint32_t slot = volume.find(index);
          const std::uint64_t got = slot == VoxelVolume::kNone ? 0 : volume.header(slot).free_parts;
          wrong += got != (index == taken ? 0 : parts) ? 1 : 0;
          free += static_cast<std::size_t>(std::popcount(got));
        }
      }
    }
    CHECK(wrong == 0);
    CHECK(free > 10);
  }
}

TEST_CASE("only blocks of the range are reached") {
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  BlockBlend blend(volume);
  const StoredBlock block = ballBlock({2, 0, -1}, volume.settings());
  const SE3 half(Eigen::Quaterniond::Identity(),
                 Eigen::Vector3d::Constant(0.5 * static_cast<double>(volume.blockSize())));
  blend.add(block, half, {{2, 0, -1}, {2, 0, 0}});
  CHECK(volume.blockCount() <= 2);
  CHECK(volume.find({3, 0, -1}) == VoxelVolume::kNone);
}

TEST_CASE("a hint fills the unknown with the least weight, and nothing that is known") {
  VoxelVolume volume(sceneSettings());
  volume.beginChange();
  BlockBlend blend(volume);
  StoredBlock known = ballBlock({2, 0, -1}, volume.settings()), other = known;
  for (std::size_t i = 0; i < kBlockVoxels; i += 2) known.voxels.weight[i] = 0;
  blend.add(known, {}, kAll);
  other.voxels.distance.fill(123);
  blend.hint(other, {}, {0, 0, 0});
  const std::uint32_t slot = volume.find(known.index);
  const VoxelBlock& got = *volume.voxels(slot);
  CHECK(volume.header(slot).hinted);
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const bool own = known.voxels.weight[i] > 0, hinted = !own && other.voxels.weight[i] > 0;
    REQUIRE(got.weight[i] == (own ? known.voxels.weight[i] : hinted ? kHintWeight : 0));
    if (own) REQUIRE(got.distance[i] == known.voxels.distance[i]);
    if (hinted) REQUIRE(got.distance[i] == 123);
  }
  // Hints are not the block's own: they are not stored with it.
  MemoryStorage storage;
  StoredBlocks stored(volume.settings(), &storage, [](auto...) { return true; });
  volume.changeHeader(slot).observed = true;
  stored.put(volume, slot);
  REQUIRE(stored.size() == 1);
  StoredBlock back;
  REQUIRE(stored.read(0, back));
  CHECK(back.voxels.weight == known.voxels.weight);
}

TEST_CASE("label counts of two voxels add up; the four most frequent labels stay") {
  std::mt19937 random(3);
  for (int trial = 0; trial < 500; ++trial) {
    LabelCounts both, other;
    std::array<unsigned, 32> seen{};
    for (LabelCounts* counts : {&both, &other}) {
      // At most four labels each, so that counting is exact.
      std::array<std::uint8_t, 4> labels{};
      for (auto& label : labels) label = static_cast<std::uint8_t>(1 + random() % 7);
      for (auto i = random() % 200; i > 0; --i) {
        const std::uint8_t label = labels[random() % 4];
        counts->add(label);
        ++seen[label];
      }
    }
    both.add(other);
    LabelCounts check;
    REQUIRE(check.setWords(both.words()));
    std::array<unsigned, 32> sorted = seen;
    std::ranges::sort(sorted, std::greater());
    for (int slot = 0; slot < LabelCounts::kSlots; ++slot) {
      REQUIRE(both.count(slot) == sorted[static_cast<std::size_t>(slot)]);
      if (both.count(slot) > 0) REQUIRE(seen[both.label(slot)] == both.count(slot));
    }
  }
  // Beyond the most that can be counted shares stay.
  LabelCounts many, more;
  for (int i = 0; i < 2000; ++i) many.add(3);
  for (int i = 0; i < 1000; ++i) more.add(4);
  for (int i = 0; i < 1000; ++i) more.add(3);
  many.add(more);
  CHECK(many.label(0) == 3);
  CHECK(many.count(0) == 1500);
  CHECK(many.count(1) == 500);
}
