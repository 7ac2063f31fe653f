#pragma once
// The map's surface as stored in files: any size, only on the host side.
//
// Metres, map axes (z up). Triangles are counter-clockwise seen from the free side. Every list of vertex
// properties has one value per vertex. A face's label is the most frequent one of its corners, ignoring
// unlabelled corners.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace swiftlet {

struct MapMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;  ///< unit
  std::vector<std::uint8_t> grey;
  std::vector<std::uint8_t> labels;         ///< 0: unlabelled
  std::vector<std::uint8_t> probabilities;  ///< of the label, 255: certain
  std::vector<std::array<std::uint32_t, 3>> faces;

  [[nodiscard]] std::uint8_t faceLabel(std::size_t face) const {
    const auto& [a, b, c] = faces[face];
    const std::uint8_t la = labels[a];
    const std::uint8_t lb = labels[b];
    const std::uint8_t lc = labels[c];
    if (la != 0 && (la == lb || la == lc)) return la;
    if (lb != 0 && lb == lc) return lb;
    if (la != 0) return la;
    return lb != 0 ? lb : lc;
  }
};

}  // namespace swiftlet
