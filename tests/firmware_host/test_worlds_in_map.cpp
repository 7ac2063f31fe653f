// The map's nodes: where the odometry's world lies in the map of a long flight; frames that are not mapped.

#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>

#include "firmware_host/graph/loop_node.hpp"
#include "firmware_host/graph/mapping_node.hpp"

namespace swiftlet {
namespace {

Rig oneCamera() {
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 160, 120, {100, 100, 80, 60}, {0, 0, 0, 0});
  return rig;
}

/// A dense graph of an earlier flight, whose nodes leave first when there is no room.
KeptGraph keptGraph(std::size_t nodes) {
  KeptGraph graph;
  graph.camera = oneCamera().camera[0];
  for (std::size_t i = 0; i < nodes; ++i) {
    KeptNode node;
    node.stamp = Stamp{static_cast<std::int64_t>(i) * 1'000'000};
    node.T_map_body.translation = {0, 0.01 * static_cast<double>(i), 0};
    node.linked = i > 0;
    node.T_previous_this.translation = {0, 0.01, 0};
    node.covariance = 1e-6 * Matrix6d::Identity();
    graph.nodes.push_back(node);
  }
  return graph;
}

/// A flight along x that extends the kept graph, with a node for each keyframe.
std::unique_ptr<LoopStage> flown(std::uint64_t nodes, const KeptGraph& kept) {
  LoopLimits limits;
  limits.nodes += kept.nodes.size();
  auto stage = std::make_unique<LoopStage>(oneCamera(), LoopSettings{}, limits);
  REQUIRE(stage->takeIn(kept, KeptUse::kExtend).ok());
  TrackedFrame tracked;
  SmoothedWindow window;
  KeyframeLink link;
  LoopReport report;
  for (std::uint64_t i = 1; i <= nodes; ++i) {
    tracked.index = i;
    tracked.stamp = Stamp{static_cast<std::int64_t>(i) * 300'000'000};
    WindowPose pose;
    pose.frame_index = i;
    pose.stamp = tracked.stamp;
    pose.T_world_body.translation.x() = 0.3 * static_cast<double>(i);
    window.poses.clear();
    REQUIRE(window.poses.tryPushBack(pose));
    link.linked = i > 1;
    link.previous = i - 1;
    link.T_previous_this.translation.x() = 0.3;
    link.covariance = 1e-6 * Matrix6d::Identity();
    LoopInput input;
    input.tracks = &tracked;
    input.window = &window;
    input.link = &link;
    REQUIRE(stage->step(input, {}, report).ok());
  }
  REQUIRE(stage->nodeCount() - stage->keptCount() == nodes);
  return stage;
}

TEST_CASE("the map is told of the newest keyframes of any flight that extends a kept map, evenly",
          "[worlds_in_map]") {
  constexpr std::uint64_t kMost = decltype(WorldsInMap::keyframes)::capacity();
  const KeptGraph kept = keptGraph(1600);
  for (const std::uint64_t nodes : {std::uint64_t{10}, kMost, kMost + kMost / 4}) {
    const auto stage = flown(nodes, kept);
    const auto worlds = std::make_unique<WorldsInMap>();
    listWorlds(*stage, *worlds);
    INFO(nodes << " nodes, " << stage->keptCount() << " kept");
    const auto& listed = worlds->keyframes;
    REQUIRE(listed.size() >= std::min(nodes, kMost / 2));
    CHECK(listed.back().frame == nodes);
    CHECK(std::ranges::adjacent_find(listed, [&](const WorldInMap& a, const WorldInMap& b) {
            return b.frame - a.frame != listed[1].frame - listed[0].frame;
          }) == listed.end());
  }
}

TEST_CASE("a frame whose depth or images are gone is listed as not mapped") {
  Settings settings;
  settings.map_stage.volume_mib = 1;
  DepthImageView sensor;
  sensor.camera = {100, 100, 80, 60, 160, 120};
  GraphContext context{oneCamera(), {}, settings, {}, {}};
  context.options.depth_sensor = &sensor;
  MappingNode node(context);
  const std::vector<std::uint8_t> pixels(160 * 120, 100);
  KeyframeImages images;
  images.image[0] = {pixels.data(), 160, 120, 160};
  for (const bool seen : {true, false}) {
    node.images.tell(seen ? &images : nullptr);
    MapMessage* message = node.frames.begin();
    REQUIRE(message != nullptr);
    *message = {};
    node.frames.commit();
    REQUIRE(node.turn());
  }
  std::map<std::string, std::uint64_t> losses;
  node.addLosses(losses);
  CHECK(losses["frames_unmapped"] == 2);
}

}  // namespace
}  // namespace swiftlet
