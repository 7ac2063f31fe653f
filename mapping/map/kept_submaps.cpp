#include "mapping/map/kept_submaps.hpp"

#include <algorithm>

namespace swiftlet {

KeptSubmaps::KeptSubmaps(MapSubmaps& to, std::span<const WorldInMap> nodes) : to_(to) {
  const std::size_t each = nodes.size() / kMost + 1;
  anchors_.reserve(nodes.size() / each + 1);
  for (std::size_t i = 0; i < nodes.size(); i += each) {
    const WorldInMap& node = nodes[i];
    // Identity with the rounding of WorldInMap::T_map_world(), so that a node that stays has not moved.
    const SE3 T_map_world = node.T_world_body * node.T_world_body.inverse();
    if (!to.addKept({{}, node.frame, node.epoch, node.T_world_body, T_map_world, T_map_world})) break;
    anchors_.push_back({node.T_world_body.translation.cast<float>(), to.submaps().newest()});
  }
}

void KeptSubmaps::take(StoredBlock& block) {
  const Eigen::Vector3f centre = to_.volume().centreOf(block.index);
  const auto squared = [&](const Anchor& anchor) { return (anchor.p_map - centre).squaredNorm(); };
  block.submap = std::ranges::min_element(anchors_, {}, squared)->submap;
  to_.store(block);
}

}  // namespace swiftlet
