#pragma once
// The triangles of a marching cube for each of the 256 cases of corners in front of and behind the surface,
// derived at compile time.
//
// Corner i is at (i & 1, i >> 1 & 1, i >> 2 & 1); bit i of a case is set if corner i is behind the surface.
// On a walk around a face, each run of corners behind is cut off by one line, from the edge where the run
// begins to the edge where it ends; two opposite corners behind are thus separated. Both cubes of a face have
// the same corners and draw the same lines, so the surface has no holes, in ambiguous cases too. The lines
// join into loops, and each loop is triangulated as a fan, counter-clockwise seen from the front. (Cubes:
// Lorensen, Cline, SIGGRAPH 1987; ambiguity: Nielson, Hamann, Visualization 1991.)

#include <array>
#include <cstddef>
#include <cstdint>

namespace swiftlet {

/// Edge `axis * 4 + k` runs along `axis` from the corner whose other two coordinates are the bits of k (lower
/// axis first).
struct CubeEdge {
  std::uint8_t axis = 0;
  std::uint8_t from = 0;  ///< corners
  std::uint8_t to = 0;
};

inline constexpr std::array<CubeEdge, 12> kCubeEdges = [] {
  std::array<CubeEdge, 12> edges{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    const unsigned first = axis == 0 ? 1 : 0, second = axis == 2 ? 1 : 2;
    for (unsigned k = 0; k < 4; ++k) {
      const unsigned from = ((k & 1U) << first) | ((k >> 1U) << second);
      edges[axis * 4 + k] = {static_cast<std::uint8_t>(axis), static_cast<std::uint8_t>(from),
                             static_cast<std::uint8_t>(from | (1U << axis))};
    }
  }
  return edges;
}();

struct CubeCase {
  static constexpr std::size_t kMostTriangles = 6;
  std::uint8_t triangles = 0;
  std::array<std::uint8_t, 3 * kMostTriangles> edge{};
};

namespace cube_cases {

constexpr std::uint8_t edgeBetween(unsigned a, unsigned b) {
  for (std::uint8_t e = 0; e < 12; ++e) {
    const bool same = (kCubeEdges[e].from == a && kCubeEdges[e].to == b) ||
                      (kCubeEdges[e].from == b && kCubeEdges[e].to == a);
    if (same) return e;
  }
  return 12;
}

/// The corners of a face, counter-clockwise seen from outside the cube.
constexpr std::array<unsigned, 4> faceCorners(unsigned axis, bool high) {
  const unsigned u = 1U << ((axis + 1) % 3), v = 1U << ((axis + 2) % 3);
  const unsigned base = high ? 1U << axis : 0;
  if (high) return {base, base | u, base | u | v, base | v};
  return {base, base | v, base | u | v, base | u};
}

constexpr CubeCase derive(unsigned behind) {
  constexpr std::uint8_t kNone = 12;
  std::array<std::uint8_t, 12> next{};
  for (std::uint8_t& n : next) n = kNone;
  const auto isBehind = [behind](unsigned corner) { return ((behind >> corner) & 1U) != 0; };
  for (unsigned face = 0; face < 6; ++face) {
    const std::array<unsigned, 4> corner = faceCorners(face / 2, face % 2 == 1);
    for (unsigned i = 0; i < 4; ++i) {
      if (isBehind(corner[i]) || !isBehind(corner[(i + 1) % 4])) continue;
      unsigned j = i + 1;
      while (isBehind(corner[(j + 1) % 4])) ++j;
      const std::uint8_t enters = edgeBetween(corner[i], corner[(i + 1) % 4]);
      next[enters] = edgeBetween(corner[j % 4], corner[(j + 1) % 4]);
    }
  }
  CubeCase result;
  for (std::uint8_t first = 0; first < 12; ++first) {
    if (next[first] == kNone) continue;
    std::uint8_t previous = next[first];
    next[first] = kNone;
    while (next[previous] != first && next[previous] != kNone) {
      const std::uint8_t current = next[previous];
      const std::size_t at = std::size_t{3} * result.triangles;
      result.edge[at] = first;
      result.edge[at + 1] = previous;
      result.edge[at + 2] = current;
      ++result.triangles;
      next[previous] = kNone;
      previous = current;
    }
    next[previous] = kNone;
  }
  return result;
}

}  // namespace cube_cases

inline constexpr std::array<CubeCase, 256> kCubeCases = [] {
  std::array<CubeCase, 256> cases{};
  for (unsigned behind = 0; behind < 256; ++behind) cases[behind] = cube_cases::derive(behind);
  return cases;
}();

}  // namespace swiftlet
