// Surface on disk comes back as it went, submap by submap; without a disk it is lost, counted.

#include <catch2/catch.hpp>
#include <filesystem>
#include <vector>

#include "firmware_host/outputs/map_files/spilled_surface.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

using namespace swiftlet;

namespace {

SurfacePatch patchAt(std::int32_t x, float height) {
  SurfacePatch patch;
  patch.block = {x, -2, 7};
  for (int i = 0; i < 4; ++i) {
    SurfaceVertex vertex;
    vertex.p_world = {static_cast<float>(x), static_cast<float>(i), height};
    vertex.label = static_cast<std::uint8_t>(i);
    REQUIRE(patch.vertices.tryPushBack(vertex));
  }
  REQUIRE(patch.triangles.tryPushBack({0, 1, 2}));
  REQUIRE(patch.triangles.tryPushBack({1, 3, 2}));
  return patch;
}

struct Taken : SurfaceSink {
  void take(const SurfacePatch& patch) override { patches.push_back(patch); }
  std::vector<SurfacePatch> patches;
};

}  // namespace

TEST_CASE("patches come back by submap, in their order, and leave no file behind") {
  const ScratchFolder folder("spilled");
  SpilledSurface spilled(folder.file(""));
  CHECK(spilled.submaps().empty());
  spilled.take(patchAt(1, 0.5F));
  spilled.beginSubmap(3);
  spilled.take(patchAt(2, 1.5F));
  spilled.beginSubmap(0);
  spilled.take(patchAt(1, 2.5F));
  CHECK(spilled.submaps() == std::vector<std::uint32_t>{0, 3});
  for (int again = 0; again < 2; ++again) {
    Taken first, third, none;
    spilled.visit(0, first);
    spilled.visit(3, third);
    spilled.visit(1, none);
    REQUIRE(first.patches.size() == 2);
    REQUIRE(third.patches.size() == 1);
    CHECK(none.patches.empty());
    CHECK(first.patches[0].vertices[3].p_world.z() == 0.5F);
    CHECK(first.patches[1].vertices[3].p_world.z() == 2.5F);
    CHECK(first.patches[1].vertices[3].label == 3);
    CHECK(third.patches[0].block == BlockIndex{2, -2, 7});
    REQUIRE(third.patches[0].triangles.size() == 2);
    CHECK(third.patches[0].triangles[1] == SurfaceTriangle{1, 3, 2});
    spilled.beginSubmap(7);
    spilled.take(patchAt(9 + again, 0));  // after reading, writing goes on at the end
  }
  CHECK(spilled.lost() == 0);
  CHECK(std::filesystem::is_empty(folder.file("")));
}

TEST_CASE("without a folder to write to patches are lost, counted") {
  SpilledSurface spilled("/nowhere/at/all");
  spilled.take(patchAt(1, 0.5F));
  spilled.take(patchAt(2, 0.5F));
  CHECK(spilled.lost() == 2);
  CHECK(spilled.submaps().empty());
  Taken taken;
  spilled.visit(0, taken);
  CHECK(taken.patches.empty());
}
