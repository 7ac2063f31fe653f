#pragma once
// The blocks of a kept map as submaps, so that loops of a later flight move them.
//
// A kept volume combines all submaps of its flight in the frame of its graph. In a later flight each block
// moves with the node nearest to it: space is deformed by rigid pieces, and the surface follows the graph.
// Neighbouring nodes move alike, because only new loops can still move them.
//
// Frames: map, that of the kept graph. Memory: 16 bytes a node. Cost of a block: linear in nodes; at most
// kMost of them are used, evenly chosen. Source of the idea: Whelan et al., Kintinuous and ElasticFusion,
// whose deformation graphs follow the camera's path.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "mapping/map/map_submaps.hpp"

namespace swiftlet {

class KeptSubmaps {
 public:
  static constexpr std::size_t kMost = 2048;

  /// `nodes`: by frame, at least one; T_world_body in the kept map. `to` must outlive this object and have
  /// taken no image.
  KeptSubmaps(MapSubmaps& to, std::span<const WorldInMap> nodes);

  void take(StoredBlock& block);

 private:
  struct Anchor {
    Eigen::Vector3f p_map;
    SubmapId submap = 0;
  };

  MapSubmaps& to_;
  std::vector<Anchor> anchors_;
};

}  // namespace swiftlet
