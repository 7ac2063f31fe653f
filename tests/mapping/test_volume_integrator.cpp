// Fusing depth images of known shapes: distances, carving, masks, refusals, full pools, repeatability.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>

#include "estimator/core/random.hpp"
#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

namespace {

const Plane kWall{{-1, 0, 0}, -3};  // x = 3, seen from below it

/// A ball at x = 1.5 before the wall.
double ballBeforeWall(const Eigen::Vector3d& o, const Eigen::Vector3d& r) {
  const double near = Ball{{1.5, 0, 0}, 0.25}(o, r);
  return near > 0 ? near : kWall(o, r);
}

struct Fused {
  explicit Fused(const VolumeSettings& settings = sceneSettings())
      : volume(settings), integrator(volume, kSceneCamera.pixels()) {}
  Status add(const SceneImage& image, const SE3& pose, const VolumeEffort& effort = {}) {
    return integrator.step(image.view(), pose, effort, step);
  }
  VoxelVolume volume;
  VolumeIntegrator integrator;
  VolumeStep step;
};

Eigen::Vector3d centreOf(const VoxelVolume& volume, const BlockIndex& block, std::size_t at) {
  const Eigen::Vector3d voxel(
      static_cast<double>(block.x * kBlockSide) + static_cast<double>(at & kBlockMask),
      static_cast<double>(block.y * kBlockSide) + static_cast<double>((at >> kBlockBits) & kBlockMask),
      static_cast<double>(block.z * kBlockSide) + static_cast<double>(at >> (2 * kBlockBits)));
  return volume.settings().voxel_size * (voxel + Eigen::Vector3d::Constant(0.5));
}

/// f(position, distance [m], weight) for every observed voxel.
template <typename F>
void forObserved(const VoxelVolume& volume, const F& f) {
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    const VoxelBlock* const block = volume.voxels(slot);
    for (std::size_t i = 0; block != nullptr && i < kBlockVoxels; ++i) {
      if (block->weight[i] == 0) continue;
      f(centreOf(volume, volume.header(slot).index, i),
        static_cast<double>(volume.distanceStep()) * static_cast<double>(block->distance[i]),
        block->weight[i]);
    }
  }
}

/// f(position) for every voxel that is free without data of its own.
template <typename F>
void forFree(const VoxelVolume& volume, const F& f) {
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    const BlockHeader& header = volume.header(slot);
    for (std::size_t i = 0; header.state == BlockState::kFree && i < kBlockVoxels; ++i) {
      if ((header.free_parts & partBitAt(i)) != 0) f(centreOf(volume, header.index, i));
    }
  }
}

bool sameBytes(const VoxelVolume& a, const VoxelVolume& b) {
  if (a.slots() != b.slots()) return false;
  for (std::uint32_t slot = 0; slot < a.slots(); ++slot) {
    const BlockHeader &ha = a.header(slot), &hb = b.header(slot);
    if (!(ha.index == hb.index) || ha.state != hb.state || ha.free_parts != hb.free_parts) return false;
    const VoxelBlock *va = a.voxels(slot), *vb = b.voxels(slot);
    if (va == nullptr) continue;
    if (std::memcmp(va, vb, sizeof(VoxelBlock)) != 0) return false;
    if (std::memcmp(a.labels(slot), b.labels(slot), sizeof(LabelBlock)) != 0) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("a plane's distances are right to a fraction of a voxel, at any angle") {
  // Up to the 84 degrees at which slopes are cut (PreparedImage::kLeastSlope): the view reaches 38 degrees to
  // the side.
  for (const double turn : {0.0, 0.4, 0.75}) {
    Fused fused;
    const Eigen::Vector3d from(3 - 2 * std::cos(turn), 2 * std::sin(turn), 0.3);
    const SE3 pose = lookAt(from, {3, 0, 0.1});
    REQUIRE(fused.add(render(pose, 1, kWall), pose).ok());
    double worst = 0;  // beyond what half a pixel's diagonal at the voxel's range explains
    std::size_t count = 0, in_front = 0;
    const double truncation = fused.volume.settings().truncation;
    forObserved(fused.volume, [&](const Eigen::Vector3d& p, double distance, std::uint16_t) {
      const double real = std::min(3 - p.x(), truncation);
      const double half_pixel = 0.75 / kSceneCamera.fx * (p - from).norm();
      worst = std::max(worst, std::abs(distance - real) - half_pixel);
      ++count;
      in_front += distance > 0 ? 1U : 0U;
      REQUIRE(distance >= -fused.volume.settings().behind - 1e-3);
    });
    CHECK(count > 10000);
    CHECK(in_front > count / 2);
    CHECK(worst < 0.002);
  }
}

TEST_CASE("a ball seen from all around") {
  Fused fused;
  const Ball ball{{0.3, -0.2, 0.1}, 0.5};
  double time = 1;
  for (const SE3& pose : viewsAround(ball, 1.5)) {
    time += 1;
    REQUIRE(fused.add(render(pose, time, ball), pose).ok());
  }
  double square = 0;
  std::size_t count = 0;
  forObserved(fused.volume, [&](const Eigen::Vector3d& p, double distance, std::uint16_t) {
    const double real = (p - ball.centre).norm() - ball.radius;
    if (std::abs(real) > 0.05) return;
    square += (distance - real) * (distance - real);
    ++count;
  });
  REQUIRE(count > 1000);
  // Half a pixel where the camera sees it.
  CHECK(std::sqrt(square / static_cast<double>(count)) < 0.5 * 1.5 / kSceneCamera.fx);
}

TEST_CASE("the update by eights is the update voxel by voxel") {
  VolumeSettings settings = sceneSettings();
  settings.truncation = 0.2;
  Random random(11);
  SceneImage image;
  for (float& d : image.depth) {
    const double kind = random.uniform();
    d = kind < 0.1 ? 0.0F : static_cast<float>(kind < 0.2 ? 20 : random.uniform(1.0, 1.5));
  }
  PreparedImage prepared(image.camera.pixels());
  PixelCounters counters;
  REQUIRE(prepared.prepare(image.view(), settings, counters).ok());
  BlockUpdate update(settings);
  const SE3 T_camera_world = lookAt({0.1, 0.05, -1.0}, {0, 0.1, 0.2}).inverse();
  update.begin(prepared, T_camera_world);
  std::size_t observed = 0, came_count = 0, beside_count = 0;
  for (const BlockIndex& index :
       {BlockIndex{0, 0, 0}, BlockIndex{-1, 0, 0}, BlockIndex{0, -1, -1}, BlockIndex{1, 1, 0}}) {
    VoxelBlock block{}, twin{};
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      twin.distance[i] = block.distance[i] =
          static_cast<std::int16_t>(static_cast<int>(random.below(60000)) - 30000);
      twin.weight[i] = block.weight[i] =
          static_cast<std::uint16_t>(random.below(3) == 0 ? 0U : random.below(2000));
    }
    const BlockUpdate::Result result = update.project(index, block, nullptr);
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const Eigen::Vector3d voxel(
          index.x * kBlockSide + static_cast<int>(i & kBlockMask) + 0.5,
          index.y * kBlockSide + static_cast<int>((i >> kBlockBits) & kBlockMask) + 0.5,
          index.z * kBlockSide + static_cast<int>(i >> (2 * kBlockBits)) + 0.5);
      const Eigen::Vector3d p = T_camera_world * Eigen::Vector3d(settings.voxel_size * voxel);
      const double u = image.camera.fx * p.x() / p.z() + image.camera.cx + 0.5;
      const double v = image.camera.fy * p.y() / p.z() + image.camera.cy + 0.5;
      // On the border between pixels single and double precision may differ.
      const bool clear = std::abs(u - std::round(u)) > 1e-3 && std::abs(v - std::round(v)) > 1e-3;
      double gain = 0, s = 0;
      if (p.z() > 0 && u >= 0 && v >= 0 && u < image.camera.width && v < image.camera.height) {
        const auto pixel = static_cast<std::size_t>(v) * 160 + static_cast<std::size_t>(u);
        const auto measured = static_cast<double>(prepared.depth()[pixel]);
        s = (std::abs(measured) - p.z()) * static_cast<double>(prepared.slope()[pixel]);
        const bool hit = measured > 0 && s > -settings.behind && measured - p.z() > -settings.behind_ray;
        const std::size_t tile = static_cast<std::size_t>(v) / 8 * 20 + static_cast<std::size_t>(u) / 8;
        // Something as near as the voxel is seen beside its pixel.
        const bool beside =
            s >= settings.truncation &&
            std::abs(static_cast<double>(prepared.nearest()[tile]) - p.z()) < settings.voxel_size;
        beside_count += beside ? 1 : 0;
        if (!beside && (hit || (measured < 0 && s >= settings.truncation))) {
          const double drop = std::min((settings.behind + s) / (settings.behind - settings.voxel_size), 1.0);
          gain = std::max(256.0 * drop, 1.0);
        }
      }
      if (!clear) continue;
      const double old = twin.distance[i], weight = twin.weight[i];
      if (gain == 0) {
        REQUIRE(block.distance[i] == twin.distance[i]);
        REQUIRE(block.weight[i] == twin.weight[i]);
        continue;
      }
      ++count;
      const double cut = std::min(s, settings.truncation) / settings.truncation * 32767;
      const double nearer = old / 32767 * settings.truncation - s;
      const bool came = s >= -settings.voxel_size && nearer > 0.5 * settings.truncation &&
                        nearer > 3 * settings.sigma_constant;
      if (std::abs(nearer - 0.5 * settings.truncation) < 1e-5) continue;
      const double kept = came ? std::min(weight, gain) : weight;
      came_count += came && weight > gain ? 1 : 0;
      REQUIRE(std::abs(block.distance[i] - (old * kept + cut * gain) / (kept + gain)) < 4);
      REQUIRE(std::abs(block.weight[i] - std::min(kept + gain, 25600.0)) < 0.51);  // rounded
    }
    observed += count;
    CHECK(result.observed >= count);
  }
  CHECK(observed > 300);
  CHECK(came_count > 5);
  CHECK(beside_count > 5);
}

TEST_CASE("what comes into free space is mapped within some images, however long it was free") {
  for (const int free_images : {3, 200}) {
    INFO(free_images << " images of free space");
    Fused fused;
    const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
    int stamp = 0;
    for (int i = 0; i < free_images; ++i) REQUIRE(fused.add(render(pose, ++stamp, kWall), pose).ok());
    float distance = 1;
    int images = 0;
    while (images < 20 && distance > 0) {
      REQUIRE(fused.add(render(pose, ++stamp, ballBeforeWall), pose).ok());
      ++images;
      REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({1.28, 0.02, 0.02}), distance));
    }
    CHECK(images <= 8);
    // It goes, and comes again.
    for (int i = 0; i < 20; ++i) REQUIRE(fused.add(render(pose, ++stamp, ballBeforeWall), pose).ok());
    for (int i = 0; i < 60; ++i) REQUIRE(fused.add(render(pose, ++stamp, kWall), pose).ok());
    REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({1.28, 0.02, 0.02}), distance));
    CHECK(distance > 0);
    for (images = 0; images < 20 && distance > 0; ++images) {
      REQUIRE(fused.add(render(pose, ++stamp, ballBeforeWall), pose).ok());
      REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({1.28, 0.02, 0.02}), distance));
    }
    CHECK(images <= 8);
    // One image alone is not believed.
    Fused once;
    for (int i = 0; i < free_images; ++i) REQUIRE(once.add(render(pose, i + 1, kWall), pose).ok());
    REQUIRE(once.add(render(pose, free_images + 1, ballBeforeWall), pose).ok());
    REQUIRE(once.volume.distanceAt(once.volume.voxelAt({1.28, 0.02, 0.02}), distance));
    CHECK(distance > 0);
  }
}

TEST_CASE("what has gone is carved away, and blocks in front are free") {
  Fused fused;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  REQUIRE(fused.add(render(pose, 1, ballBeforeWall), pose).ok());
  float distance = 0;
  const VoxelIndex inside = fused.volume.voxelAt({1.26, 0.02, 0.02});
  REQUIRE(fused.volume.distanceAt(inside, distance));
  CHECK(distance < 0.02F);
  for (int i = 0; i < 30; ++i) REQUIRE(fused.add(render(pose, 2 + i, kWall), pose).ok());
  REQUIRE(fused.volume.distanceAt(inside, distance));
  CHECK(distance > 0.14F);
  CHECK(fused.volume.freeCount() > 0);
  // Free is only what lies in front of the wall.
  forFree(fused.volume, [&](const Eigen::Vector3d& p) { CHECK(p.x() < 3 - 0.15 - 0.025); });
  CHECK_FALSE(fused.volume.distanceAt(fused.volume.voxelAt({4, 0, 0}), distance));
}

TEST_CASE("parts of a block are free where some image saw them, though none saw the whole block") {
  // Two views that overlap by less than a block, so that the blocks between are seen in parts alone.
  Fused fused;
  const SE3 left = lookAt({0, 0, 0}, {1, 0.7, 0}), right = lookAt({0, 0, 0}, {1, -0.7, 0});
  REQUIRE(fused.add(render(left, 1, kWall), left).ok());
  REQUIRE(fused.add(render(right, 2, kWall), right).ok());
  const auto sees = [&](const SE3& view, const Eigen::Vector3d& p, double margin) {
    const Eigen::Vector3d c = view.inverse() * p;
    const PinholeIntrinsics& k = kSceneCamera;
    const double u = k.fx * c.x() / c.z() + k.cx, v = k.fy * c.y() / c.z() + k.cy,
                 pixels = margin * k.fx / c.z();
    return c.z() > 0.05 + margin && std::min({u, v, k.width - 1 - u, k.height - 1 - v}) > pixels;
  };
  std::size_t unseen = 0, whole = 0, parts = 0;
  forFree(fused.volume,
          [&](const Eigen::Vector3d& p) { unseen += sees(left, p, 0) || sees(right, p, 0) ? 0U : 1U; });
  CHECK(unseen == 0);
  for (std::uint32_t slot = 0; slot < fused.volume.slots(); ++slot) {
    const BlockHeader& header = fused.volume.header(slot);
    if (header.state != BlockState::kFree) continue;
    (header.isWhollyFree() ? whole : parts) += 1;
  }
  CHECK(whole > 20);
  CHECK(parts > 20);
  // Everything that a view sees with a part around it is known, as far as the bundles of rays, 16 pixels
  // apart, are less than half a block apart.
  std::size_t missing = 0, all = 0;
  const double margin = 2 * std::sqrt(3.0) * kPartVoxels * fused.volume.settings().voxel_size;
  for (double x = 0.3; x < 1.2; x += 0.03) {
    for (double y = -2; y < 2; y += 0.07) {
      for (double z = -1; z < 1; z += 0.07) {
        const Eigen::Vector3d p(x, y, z);
        if (!sees(left, p, margin) && !sees(right, p, margin)) continue;
        float distance = 0;
        ++all;
        missing += fused.volume.distanceAt(fused.volume.voxelAt(p), distance) ? 0U : 1U;
      }
    }
  }
  CHECK(all > 5000);
  CHECK(missing == 0);
}

TEST_CASE("masked labels give no surface and carve up to themselves only") {
  VolumeSettings settings = sceneSettings();
  settings.masked_labels = 1U << 5U;
  settings.label_count = 8;
  Fused fused(settings);
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  const Ball ball{{1.5, 0, 0}, 0.25};
  SceneImage image = render(pose, 1, kWall);
  image.labels.assign(image.depth.size(), 3);
  const SceneImage with = render(pose, 1, ball);
  for (std::size_t i = 0; i < image.depth.size(); ++i) {
    if (with.depth[i] <= 0) continue;
    image.depth[i] = with.depth[i];
    image.labels[i] = 5;
  }
  image.labels[0] = 200;
  REQUIRE(fused.add(image, pose).ok());
  CHECK(fused.integrator.counters().pixels.masked > 100);
  CHECK(fused.integrator.counters().pixels.bad_label == 1);
  std::size_t behind = 0;
  forObserved(fused.volume, [&](const Eigen::Vector3d& p, double distance, std::uint16_t) {
    behind += distance < 0.1 && p.x() < 2.5 ? 1U : 0U;
    // In the ball's shadow nothing is known.
    const Eigen::Vector3d at = 1.5 / p.x() * p;
    if (p.x() > 1.5) CHECK(std::hypot(at.y(), at.z()) > 0.2);
  });
  CHECK(behind == 0);
  for (std::uint32_t slot = 0; slot < fused.volume.slots(); ++slot) {
    const LabelBlock* const labels = fused.volume.labels(slot);
    for (std::size_t i = 0; labels != nullptr && i < kBlockVoxels; ++i) {
      if (!labels->counts[i].empty()) REQUIRE(labels->counts[i].label(0) == 3);
    }
  }
}

TEST_CASE("bad pixels are skipped and counted") {
  Fused fused;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  SceneImage image = render(pose, 1, kWall);
  image.depth[5] = std::numeric_limits<float>::quiet_NaN();
  image.depth[6] = -1;
  image.depth[7] = std::numeric_limits<float>::infinity();
  image.depth[8] = 0;
  image.depth[9] = 0.01F;
  image.depth[10] = 50;
  REQUIRE(fused.add(image, pose).ok());
  CHECK(fused.integrator.counters().pixels.unmeasured == 5);
  CHECK(fused.integrator.counters().pixels.beyond_range == 1);
  forObserved(fused.volume, [](const Eigen::Vector3d& p, double distance, std::uint16_t) {
    REQUIRE(p.allFinite());
    REQUIRE(std::isfinite(distance));
  });
}

TEST_CASE("bad images are refused and change nothing") {
  Fused fused;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  const SceneImage good = render(pose, 1, kWall);
  DepthImageView view = good.view();
  const auto refused = [&](const DepthImageView& image, const SE3& at) {
    return fused.integrator.step(image, at, {}, fused.step).code == StatusCode::kInvalidInput;
  };
  view.camera.width = 0;
  CHECK(refused(view, pose));
  fused.integrator.restart();
  view = good.view();
  view.camera.height = 5000;
  CHECK(refused(view, pose));
  fused.integrator.restart();
  view = good.view();
  view.camera.fx = std::numeric_limits<double>::quiet_NaN();
  CHECK(refused(view, pose));
  fused.integrator.restart();
  view = good.view();
  view.depth = nullptr;
  CHECK(refused(view, pose));
  fused.integrator.restart();
  SE3 broken = pose;
  broken.translation.x() = std::numeric_limits<double>::infinity();
  CHECK(refused(good.view(), broken));
  CHECK(fused.volume.blockCount() == 0);
  CHECK(fused.integrator.counters().refused == 5);
  CHECK(fused.integrator.counters().bad_poses == 1);
  REQUIRE(fused.add(good, pose).ok());
  CHECK(refused(good.view(), pose));
  CHECK(fused.integrator.counters().bad_stamps == 1);
}

TEST_CASE("a pose jump costs one image") {
  Fused fused;
  const SE3 here = lookAt({0, 0, 0}, {1, 0, 0}), there = lookAt({0, 20, 0}, {1, 20, 0});
  const SE3 turned = lookAt({0, 20, 0}, {-1, 20, 0});
  REQUIRE(fused.add(render(here, 1.0, kWall), here).ok());
  CHECK(fused.add(render(there, 1.1, kWall), there).code == StatusCode::kInvalidInput);
  CHECK(fused.add(render(there, 1.2, kWall), there).ok());
  CHECK(fused.add(render(turned, 1.25, kWall), turned).code == StatusCode::kInvalidInput);
  CHECK(fused.integrator.counters().pose_jumps == 2);
  CHECK(fused.integrator.counters().images == 2);
}

TEST_CASE("effort bounds the work, nearest first") {
  Fused all, some;
  const SE3 pose = lookAt({0, 0, 0}, {1, 0.7, 0});
  const SceneImage image = render(pose, 1, kWall);
  REQUIRE(all.add(image, pose).ok());
  REQUIRE(all.step.band > 60);
  CHECK(some.add(image, pose, {40}).code == StatusCode::kCapacityReached);
  CHECK(some.step.updated + some.step.carved <= 40);
  CHECK(some.step.left_out > 0);
  float farthest = 0;
  for (std::uint32_t slot = 0; slot < some.volume.slots(); ++slot) {
    if (some.volume.voxels(slot) != nullptr)
      farthest = std::max(farthest, some.volume.centreOf(some.volume.header(slot).index).norm());
  }
  std::size_t nearer = 0;
  for (std::uint32_t slot = 0; slot < all.volume.slots(); ++slot) {
    nearer += all.volume.voxels(slot) != nullptr &&
                      all.volume.centreOf(all.volume.header(slot).index).norm() < farthest
                  ? 1U
                  : 0U;
  }
  CHECK(nearer < 40);
}

TEST_CASE("a full pool keeps what is near, drops what is far, and counts") {
  VolumeSettings settings = sceneSettings();
  settings.memory_bytes = 150 * 8000;
  Fused fused(settings);
  const std::size_t bytes = fused.volume.bytes();
  CHECK(bytes <= settings.memory_bytes + 4096);
  const std::size_t capacity = fused.volume.blockCapacity();
  for (int i = 0; i < 40; ++i) {
    const double y = 0.25 * i;
    const SE3 pose = lookAt({1.5, y, 0}, {3, y, 0});
    (void)fused.add(render(pose, 1 + i, kWall), pose);
    REQUIRE(fused.volume.blockCount() <= capacity);
    REQUIRE(fused.volume.bytes() == bytes);
    // The wall right ahead is whole.
    for (double dy = -0.5; dy <= 0.5; dy += 0.1) {
      float distance = 0;
      REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({2.98, y + dy, 0.1}), distance));
      REQUIRE(std::abs(distance) < 0.06F);
    }
  }
  CHECK(fused.volume.counters().evicted > 0);
  float distance = 0;
  CHECK_FALSE(fused.volume.distanceAt(fused.volume.voxelAt({2.98, -0.8, 0}), distance));
}

TEST_CASE("a pool that one image overfills keeps the nearest blocks") {
  VolumeSettings settings = sceneSettings();
  settings.memory_bytes = 30 * 8000;
  Fused fused(settings);
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  CHECK(fused.add(render(pose, 1, kWall), pose).code == StatusCode::kCapacityReached);
  CHECK(fused.volume.counters().refused > 0);
  float distance = 0;
  CHECK(fused.volume.distanceAt(fused.volume.voxelAt({2.98, 0, 0}), distance));
}

TEST_CASE("the same images give the same bytes") {
  VolumeSettings settings = sceneSettings();
  settings.memory_bytes = 200 * 8000;
  Fused a(settings), b(settings);
  const Ball ball{{0, 0, 0}, 0.6};
  double time = 1;
  for (const SE3& pose : viewsAround(ball, 1.6)) {
    time += 1;
    SceneImage image = render(pose, time, ball);
    image.labels.assign(image.depth.size(), 2);
    image.grey.assign(image.depth.size(), 77);
    (void)a.add(image, pose);
    (void)b.add(image, pose);
  }
  CHECK(a.volume.blockCount() > 50);
  CHECK(sameBytes(a.volume, b.volume));
  for (std::uint32_t slot = 0; slot < a.volume.slots(); ++slot) {
    const VoxelBlock* const block = a.volume.voxels(slot);
    for (std::size_t i = 0; block != nullptr && i < kBlockVoxels; ++i) {
      REQUIRE((block->grey[i] == 77 || block->grey[i] == 0));
    }
  }
}

TEST_CASE("surer pixels count for more") {
  VolumeSettings settings = sceneSettings();
  Fused fused(settings);
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  SceneImage image = render(pose, 1, kWall);
  std::vector<float> sigma(image.depth.size(), 0.01F);
  DepthImageView view = image.view();
  view.sigma = sigma.data();
  REQUIRE(fused.integrator.step(view, pose, {}, fused.step).ok());
  SceneImage farther = render(pose, 2, Plane{{-1, 0, 0}, -3.04});
  std::fill(sigma.begin(), sigma.end(), 0.02F);
  view = farther.view();
  view.sigma = sigma.data();
  REQUIRE(fused.integrator.step(view, pose, {}, fused.step).ok());
  float distance = 0;
  REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({2.975, 0.025, 0.025}), distance));
  // Weights 1 and 1/4.
  CHECK(static_cast<double>(distance) == Approx(0.025 + 0.2 * 0.04).margin(0.004));
}

TEST_CASE("a measurement too uncertain for a surface still says what is free before it") {
  const SE3 pose = lookAt({0, 0, 0}, {1, 0, 0});
  for (const double sigma_of_all : {0.29, 0.31}) {
    Fused fused;
    const bool sure = sigma_of_all < fused.volume.settings().most_sigma;
    const SceneImage image = render(pose, 1, kWall);
    const std::vector<float> sigma(image.depth.size(), static_cast<float>(sigma_of_all));
    DepthImageView view = image.view();
    view.sigma = sigma.data();
    REQUIRE(fused.integrator.step(view, pose, {}, fused.step).ok());
    CHECK(fused.integrator.counters().pixels.uncertain == (sure ? 0 : image.depth.size()));
    CHECK((fused.volume.blockCount() > 0) == sure);
    float distance = 0;
    REQUIRE(fused.volume.distanceAt(fused.volume.voxelAt({1.2, 0, 0}), distance));
    CHECK(static_cast<double>(distance) == Approx(fused.volume.settings().truncation));
    // Within three deviations of the wall at 3 m nothing is known.
    CHECK(fused.volume.distanceAt(fused.volume.voxelAt({2.6, 0, 0}), distance) == sure);
  }
}
