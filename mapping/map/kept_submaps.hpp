#pragma once
// A kept map's blocks as submaps, so that loops of a later flight move them.
//
// A kept volume is one, laid together from the submaps of its flight in the frame of its graph. From there
// each block goes with the node that is nearest to it: a deformation of space by rigid pieces, which moves
// the surface as the graph moves and leaves it as it is where the graph stays. Neighbouring nodes move alike,
// as all that may still move them are loops that are seen anew.
//
// Frames: map, that of the kept graph. Memory: 32 bytes a node. Cost: a block, linear in nodes; at most
// kMost of them count, evenly chosen. Source of the idea: Whelan et al., Kintinuous and ElasticFusion, whose
// deformation graphs are laid along the camera's way.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "mapping/map/map_submaps.hpp"

namespace swiftlet {

class KeptSubmaps {
 public:
  static constexpr std::size_t kMost = 2048;

  /// `nodes` by frame, at least one; T_world_body in the kept map. `to` outlives the use, and has taken no
  /// image.
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
