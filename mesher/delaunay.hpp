#pragma once
// Delaunay triangulation of image points: incremental, exact, in fixed memory.
//
// A point is located by a walk from the triangle of the point before (visibility walk; it ends in every
// Delaunay triangulation: De Floriani, Falcidieni and Nagy 1991), splits the triangle it falls into, and
// edges around it are flipped until each is Delaunay (Lawson 1977, "Software for C1 surface interpolation";
// the same result as the cavities of Bowyer 1981 and Watson 1981; de Berg et al., "Computational Geometry",
// chapter 9). Outside the hull lie triangles with a vertex at infinity, one to each edge of the hull: hull
// and inside are treated alike, and no big triangle of invented points falsifies what is close to the hull.
//
// Exactness: points are snapped to a grid of 2^-12 px (predicates.hpp), and for the snapped points the result
// is exactly Delaunay, whatever their position. Four or more points on one circle leave a choice: of two
// diagonals the one is taken that does not end in the point with the largest x (and then y) of the four,
// which is a perturbation of the lifted points and hence consistent. So the set of triangles depends on the
// set of points alone, not on their order; the order of the list is fixed by the input.
//
// Counter-clockwise means positive area in the axes of the input, from x to y; in an image whose y axis
// points down it looks clockwise.

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

/// Points that one triangulation can take.
inline constexpr std::size_t kMaxDelaunayPoints = kMaxMeshVertices;
/// Triangles without infinite ones: 2 n - 2 - h, and the hull has at least three vertices.
inline constexpr std::size_t kMaxDelaunayTriangles = 2 * kMaxDelaunayPoints - 5;

struct DelaunayTriangle {
  /// Beyond this edge is the outside.
  static constexpr std::uint16_t kNoNeighbour = 0xFFFF;

  std::array<std::uint16_t, 3> vertex{};  ///< indices of the points, counter-clockwise
  /// Triangles beyond the edges from vertex[i] to vertex[(i + 1) % 3].
  std::array<std::uint16_t, 3> neighbour{};
};

/// Points that are no vertices.
struct DelaunaySkipped {
  std::uint32_t invalid = 0;        ///< not finite, or beyond kGridRange
  std::uint32_t duplicate = 0;      ///< on the grid in the place of a vertex that was there before
  std::uint32_t over_capacity = 0;  ///< after kMaxDelaunayPoints others

  [[nodiscard]] std::uint32_t total() const { return invalid + duplicate + over_capacity; }
};

/// Some 120 kB inside the object; nothing is allocated, nothing thrown. Not for several threads at a time.
class Delaunay {
 public:
  Delaunay();

  /// Triangulates `points` [px], of which the triangles name the indices; what was there before is forgotten.
  /// Of points that fall together the one of the lowest index is kept. kDegenerate: there is no triangle
  /// (fewer than three points are left, or all are on one line). kCapacityReached: points beyond the capacity
  /// were skipped. O(n) for image features, O(n^2) at worst.
  Status build(std::span<const Eigen::Vector2f> points);

  void clear();

  /// Empty when there is no triangle. Valid until the next change.
  std::span<const DelaunayTriangle> triangles();
  /// The convex hull, counter-clockwise, with the vertices inside its straight sides; empty without
  /// triangles.
  std::span<const std::uint16_t> hull();

  [[nodiscard]] std::size_t vertexCount() const { return vertex_count_; }
  [[nodiscard]] const DelaunaySkipped& skipped() const { return skipped_; }

 private:
  /// Infinite triangles included: 2 (n + 1) - 4, as on a sphere.
  static constexpr std::size_t kMaxCells = 2 * kMaxDelaunayPoints - 2;
  /// The vertex at infinity. Its point is not a number: every comparison with it is false, so that the walk
  /// ends in infinite triangles and the filter of inCircle() leaves them undecided, without a branch for
  /// them.
  static constexpr std::uint16_t kInfinite = kMaxDelaunayPoints;

  /// A triangle, infinite ones too, is three directed edges: 4 c, 4 c + 1, 4 c + 2 of cell c,
  /// counter-clockwise (and 4 c + 3 for nothing, as dividing by 4 is cheap).
  using Edge = std::uint16_t;
  // Tables 0 1 2 -> 1 2 0 and 2 0 1 of two bits each: a branch would be mispredicted every third time.
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
  /// The edge of a cell (given by its first) that comes from the infinite vertex; none: cell + 3.
  [[nodiscard]] Edge edgeFromInfinite(Edge cell) const {
    Edge edge = cell;
    while (edge < cell + 3 && origin_[edge] != kInfinite) ++edge;
    return edge;
  }

  std::array<GridPoint, kMaxDelaunayPoints + 1> point_;
  std::size_t point_count_ = 0;
  std::size_t vertex_count_ = 0;
  DelaunaySkipped skipped_;
  std::array<std::uint16_t, 4 * kMaxCells> origin_;  ///< vertex from which an edge goes
  std::array<Edge, 4 * kMaxCells> twin_;             ///< the same edge in the triangle beyond
  std::size_t cell_count_ = 0;                       ///< 0 while all vertices are on one line
  Edge last_ = 0;                                    ///< first edge of the cell where the next walk begins
  /// While there is no triangle: the vertices in the order in which they lie on their line.
  FixedVector<std::uint16_t, kMaxDelaunayPoints> line_;
  std::array<std::uint16_t, kMaxDelaunayPoints> order_;  ///< in which build() inserts

  bool collected_ = false;                     ///< what follows is of the points up to now
  std::array<std::uint16_t, kMaxCells> rank_;  ///< of a cell in triangles_
  FixedVector<DelaunayTriangle, kMaxDelaunayTriangles> triangles_;
  FixedVector<std::uint16_t, kMaxDelaunayPoints> hull_;
};

}  // namespace swiftlet
