// Space that a kept map knows is shown as hints while loops tie the flight to it, and not afterwards; and the
// distance is stale while the map has not taken the newest image.

#include <catch2/catch.hpp>
#include <vector>

#include "mapping/map/kept_submaps.hpp"
#include "mapping/map/map_stage.hpp"
#include "tests/mapping/memory_storage.hpp"

using namespace swiftlet;
using swiftlet::testing::MemoryStorage;

namespace {

constexpr std::uint32_t kTiedEpoch = 1U << 31;
constexpr std::uint64_t kTiedFrame = 1ULL << 63;
constexpr int kColumns = 320;
constexpr int kLines = 240;

struct Flight {
  Flight() {
    settings.labels = false;
    sensor.camera = {200, 200, 160, 120, kColumns, kLines};
    rig.camera_count = 1;
    rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, kColumns, kLines, {200, 200, 160, 120},
                                Eigen::Vector4d::Zero());
    stage = std::make_unique<MapStage>(rig, settings, &sensor, &storage);
  }

  /// An image of a wall 1 m away.
  void step(const SE3& T_map_body) {
    const std::vector<float> depth(static_cast<std::size_t>(kColumns) * kLines, 1.0F);
    MapInput input;
    input.depth = sensor;
    input.depth.depth = depth.data();
    input.stamp = Stamp{(images + 1) * 200'000'000};
    input.frame = static_cast<std::uint64_t>(images++);
    input.T_map_body = T_map_body;
    REQUIRE(stage->step(input, {}, report).ok());
  }

  /// All of a correction, and of the distance.
  void settle() {
    CorrectionStep step;
    do stage->stepCorrection({}, step);
    while (!step.done);
    stage->updateDistance({0, 0, 0}, {100'000}, report);
  }

  MapSettings settings;
  DepthImageView sensor;
  Rig rig;
  MemoryStorage storage;
  std::unique_ptr<MapStage> stage;
  MapReport report;
  std::int64_t images = 0;
};

/// Gives the map what five images of a wall 2 m before the kept node show.
void keepWall(Flight& flight) {
  const std::vector<WorldInMap> nodes{{kTiedFrame, kTiedEpoch, SE3(), SE3()}};
  KeptSubmaps kept(flight.stage->submaps(), nodes);
  VolumeSettings settings;
  settings.labels = false;
  VoxelVolume volume(settings);
  VolumeIntegrator integrator(volume, static_cast<std::size_t>(kColumns) * kLines);
  const std::vector<float> depth(static_cast<std::size_t>(kColumns) * kLines, 2.0F);
  DepthImageView image = flight.sensor;
  image.depth = depth.data();
  VolumeStep step;
  for (int i = 0; i < 5; ++i) {
    image.stamp = Stamp{(i + 1) * 100'000'000};
    REQUIRE(integrator.step(image, SE3(), {}, step).ok());
  }
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    const BlockHeader& header = volume.header(slot);
    if (header.state == BlockState::kUnused) continue;
    StoredBlock block{};
    block.index = header.index;
    block.free_parts = header.state == BlockState::kFree ? header.free_parts : 0;
    if (volume.voxels(slot) != nullptr) block.voxels = *volume.voxels(slot);
    kept.take(block);
  }
}

}  // namespace

TEST_CASE("hints of a kept map come with the tie to it and go with it, though nothing moves") {
  Flight flight;
  keepWall(flight);
  const SE3 away(Eigen::Quaterniond(Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitY())), {0, 0, 0});
  flight.step(away);
  flight.settle();
  const Eigen::Vector3d before_wall(0.02, 0.02, 1.2);
  CHECK(flight.stage->distance().query(before_wall).clearance() == 0);
  const WorldInMap own{0, 0, SE3(), SE3()};
  flight.stage->correct(std::vector<WorldInMap>{own, {kTiedFrame, kTiedEpoch, SE3(), SE3()}});
  flight.settle();
  flight.step(away);
  flight.settle();
  CHECK(flight.stage->distance().query(before_wall).clearance() > 0.2);
  flight.stage->correct(std::vector<WorldInMap>{own});
  flight.settle();
  CHECK(flight.stage->distance().query(before_wall).clearance() == 0);
}

TEST_CASE("an image that the map did not take leaves the distance stale until the next") {
  Flight flight;
  const auto stale = [&] { return flight.stage->distance().query({0, 0, 0.5}).stale; };
  flight.step({});
  CHECK_FALSE(stale());
  flight.stage->announce(Stamp{(flight.images + 1) * 200'000'000});
  CHECK(stale());
  flight.stage->updateDistance({0, 0, 0}, {}, flight.report);
  CHECK(stale());
  ++flight.images;
  flight.step({});
  CHECK_FALSE(stale());
}
