#pragma once
// Delaunay triangulation of image points: incremental, exact, in fixed memory.
//
// A point is located by a visibility walk from the triangle of the previous point, which terminates in every
// Delaunay triangulation (De Floriani, Falcidieni and Nagy 1991). It splits the triangle that contains it,
// and edges around it are flipped until each is Delaunay (Lawson 1977, "Software for C1 surface
// interpolation"; the same result as the cavities of Bowyer 1981 and Watson 1981; de Berg et al.,
// "Computational Geometry", chapter 9). Outside the hull are triangles with a vertex at infinity, one for
// each edge of the hull. Hull and interior are thus treated alike, without a large enclosing triangle that
// distorts results near the hull.
//
// Exactness: points are snapped to a grid of 2^-12 px (predicates.hpp), and the result is exactly Delaunay
// for the snapped points. Four or more points on one circle leave a choice of diagonal: the one is taken that
// does not end in the point with the largest x (then y) of the four. This is a perturbation of the lifted
// points and hence consistent. The set of triangles depends only on the set of points, not on their order;
// the order of the list depends on the input.
//
// Counter-clockwise means positive area in the axes of the input, from x to y. In an image with the y axis
// pointing down it looks clockwise.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/status.hpp"
#include "mesher/predicates.hpp"

namespace swiftlet {

/// Capacity for points.
inline constexpr std::size_t kMaxDelaunayPoints = kMaxMeshVertices;
/// Largest number of finite triangles: 2 n - 2 - h, with at least three vertices on the hull.
inline constexpr std::size_t kMaxDelaunayTriangles = 2 * kMaxDelaunayPoints - 5;

struct DelaunayTriangle {
  /// No triangle beyond this edge.
  static constexpr std::uint16_t kNoNeighbour = 0xFFFF;

  std::array<std::uint16_t, 3> vertex{};  ///< indices of the points, counter-clockwise
  /// The triangles beyond the edges from vertex[i] to vertex[(i + 1) % 3].
  std::array<std::uint16_t, 3> neighbour{};
};

/// Points that did not become vertices.
struct DelaunaySkipped {
  std::uint32_t invalid = 0;        ///< not finite, or beyond kGridRange
  std::uint32_t duplicate = 0;      ///< on the grid at the position of an earlier vertex
  std::uint32_t over_capacity = 0;  ///< beyond kMaxDelaunayPoints

  [[nodiscard]] std::uint32_t total() const { return invalid + duplicate + over_capacity; }
};

/// Memory: some 120 kB inside the object; no allocation, no exceptions. Not thread safe.
class Delaunay {
 public:
  Delaunay();

  /// Replaces the triangulation by that of `points` [px]; triangles hold indices into `points`. Of coincident
  /// points the one with the lowest index is kept. kDegenerate: there is no triangle (fewer than three points
  /// are left, or all are collinear). kCapacityReached: points beyond the capacity were skipped. O(n) for
  /// image features, O(n^2) at worst.
  Status build(std::span<const Eigen::Vector2f> points);

  void clear();

  /// Empty if there is no triangle. Valid until the next change.
  std::span<const DelaunayTriangle> triangles();
  /// The convex hull, counter-clockwise, with the vertices inside its straight sides; empty without
  /// triangles.
  std::span<const std::uint16_t> hull();

  [[nodiscard]] const DelaunaySkipped& skipped() const { return skipped_; }

 private:
  /// Infinite triangles included: 2 (n + 1) - 4, as on a sphere.
  static constexpr std::size_t kMaxCells = 2 * kMaxDelaunayPoints - 2;
  /// The vertex at infinity. Its coordinates are NaN, so every comparison with it is false. The walk thus
  /// ends in infinite triangles, and the filter of inCircle() leaves them undecided, without extra branches.
  static constexpr std::uint16_t kInfinite = kMaxDelaunayPoints;

  /// A triangle, finite or infinite, is three directed edges of cell c, counter-clockwise: 4 c, 4 c + 1 and
  /// 4 c + 2. 4 c + 3 is unused, because dividing by 4 is cheap.
  using Edge = std::uint16_t;
  // Tables 0 1 2 -> 1 2 0 and 2 0 1 of two bits each; a branch would be mispredicted every third time.
  static constexpr Edge nextOf(Edge edge) { return turned(edge, 0b00'10'01); }
  static constexpr Edge previousOf(Edge edge) { return turned(edge, 0b01'00'10); }
  static constexpr Edge turned(Edge edge, std::uint32_t table) {
    const std::uint32_t side = edge & 3U;
    return static_cast<Edge>((edge ^ side) | ((table >> (2 * side)) & 3U));
  }
  static constexpr Edge firstOf(Edge edge) { return static_cast<Edge>(edge & ~3U); }

  Status place(std::uint16_t index);
  Status placeOnLine(std::uint16_t index);
  void startWith(std::uint16_t a, std::uint16_t b, std::uint16_t c);
  Status placeInPlane(std::uint16_t index);
  bool locate(const GridPoint& p, Edge& cell) const;
  void split(Edge cell, std::uint16_t p);
  void flipAround(Edge cell, std::uint16_t p);
  [[nodiscard]] bool mustFlipUndecided(Edge edge, std::uint16_t p, std::uint16_t d) const;
  void flip(Edge edge, std::uint16_t p);
  void sortAlongCurve(std::size_t count);
  void collect();
  void collectHull(Edge from_infinite);

  void setVertices(Edge cell, std::uint16_t a, std::uint16_t b, std::uint16_t c) {
    origin_[cell] = a;
    origin_[cell + 1U] = b;
    origin_[cell + 2U] = c;
  }
  void join(Edge edge, Edge twin) {
    twin_[edge] = twin;
    twin_[twin] = edge;
  }
  /// The edge of a cell (given by its first edge) that starts at the infinite vertex; cell + 3 if there is
  /// none.
  [[nodiscard]] Edge edgeFromInfinite(Edge cell) const {
    Edge edge = cell;
    while (edge < cell + 3 && origin_[edge] != kInfinite) ++edge;
    return edge;
  }

  std::array<GridPoint, kMaxDelaunayPoints + 1> point_;
  std::size_t point_count_ = 0;
  std::size_t vertex_count_ = 0;
  DelaunaySkipped skipped_;
  std::array<std::uint16_t, 4 * kMaxCells> origin_;  ///< vertex where an edge starts
  std::array<Edge, 4 * kMaxCells> twin_;             ///< the same edge in the triangle beyond
  std::size_t cell_count_ = 0;                       ///< 0 while all vertices are collinear
  Edge last_ = 0;                                    ///< first edge of the cell where the next walk begins
  /// While there is no triangle: the vertices in order along their line.
  FixedVector<std::uint16_t, kMaxDelaunayPoints> line_;
  std::array<std::uint16_t, kMaxDelaunayPoints> order_;  ///< order in which build() inserts

  bool collected_ = false;                     ///< the following members are up to date
  std::array<std::uint16_t, kMaxCells> rank_;  ///< of a cell in triangles_
  FixedVector<DelaunayTriangle, kMaxDelaunayTriangles> triangles_;
  FixedVector<std::uint16_t, kMaxDelaunayPoints> hull_;
};

}  // namespace swiftlet
