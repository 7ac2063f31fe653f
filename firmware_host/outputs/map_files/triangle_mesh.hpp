#pragma once
// A triangle mesh as files hold it: any size, on the host side only.
//
// Metres, in the world of whoever made it. A face is counter-clockwise seen from outside (true
// surfaces) or from where it was seen (the mesher's). `grey` has one value for each vertex and `labels`
// one for each face, or they are empty where nobody gave any.

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
