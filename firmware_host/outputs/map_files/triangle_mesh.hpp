#pragma once
// A triangle mesh as stored in files: any size, only on the host side.
//
// Metres, in the world frame of its source. A face is counter-clockwise seen from outside (true surfaces) or
// from the side it was observed from (the mesher's). `grey` has one value per vertex and `labels` one per
// face, or they are empty if there are none.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace swiftlet {

struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::uint8_t> grey;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> labels;  ///< 0: unlabelled
};

}  // namespace swiftlet
