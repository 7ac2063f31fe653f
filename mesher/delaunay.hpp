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
// Exactness: points are snapped to a grid of 2^-14 px (predicates.hpp), and for the snapped points the result
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
  std::array<std::uint16_t, 3>
      neighbour{};  ///< triangle beyond the edge from vertex[i] to vertex[(i + 1) % 3]
};

/// Points that are no vertices.
struct DelaunaySkipped {
  std::uint32_t invalid = 0;        ///< not finite, or beyond kGridRange
  std::uint32_t duplicate = 0;      ///< on the grid in the place of a vertex that was there before
  std::uint32_t over_capacity = 0;  ///< after kMaxDelaunayPoints others

  [[nodiscard]] std::uint32_t total() const { return invalid + duplicate + over_capacity; }
};

/// Some 100 kB inside the object; nothing is allocated, nothing thrown. Not for several threads at a time.
class Delaunay {
 public:
  /// Triangulates `points` [px], of which the triangles name the indices; what was there before is forgotten.
  /// Of points that fall together the one of the lowest index is kept. kDegenerate: there is no triangle
  /// (fewer than three points are left, or all are on one line). kCapacityReached: points beyond the capacity
  /// were skipped. O(n) for image features, O(n^2) at worst.
  Status build(std::span<const Eigen::Vector2f> points);

  /// Adds one point [px]; its index is the number of points given before, skipped ones included.
  /// kInvalidInput: skipped, as it is invalid or a duplicate. kCapacityReached: skipped, and it has no index.
  Status insert(const Eigen::Vector2f& point);

  void clear();

  /// Triangles of all points up to now, empty while these are on one line. Valid until the next change.
  std::span<const DelaunayTriangle> triangles();
  /// The convex hull, counter-clockwise, with the vertices inside its straight sides; empty without
  /// triangles.
  std::span<const std::uint16_t> hull();

  [[nodiscard]] std::size_t vertexCount() const { return vertex_count_; }
  [[nodiscard]] const DelaunaySkipped& skipped() const { return skipped_; }

 private:
  /// Infinite triangles included: 2 (n + 1) - 4, as on a sphere.
  static constexpr std::size_t kMaxCells = 2 * kMaxDelaunayPoints - 2;
  /// The vertex at infinity.
  static constexpr std::uint16_t kInfinite = 0xFFFF;

  /// A triangle, infinite ones too. Edge i runs from vertex i to vertex (i + 1) % 3; its twin is the same
  /// edge as the neighbour has it, as 4 x cell + edge.
  struct Cell {
    std::array<std::uint16_t, 3> vertex;
    std::array<std::uint16_t, 3> twin;
  };

  Status place(std::uint16_t index);
  Status placeOnLine(std::uint16_t index);
  void startWith(std::uint16_t a, std::uint16_t b, std::uint16_t c);
  Status placeInPlane(std::uint16_t index);
  bool locate(const GridPoint& p, std::uint16_t& cell) const;
  [[nodiscard]] bool isVertexOf(const Cell& cell, const GridPoint& p) const;
  void split(std::uint16_t cell, std::uint16_t p);
  void flipAround(std::uint16_t cell, std::uint16_t p);
  [[nodiscard]] bool mustFlip(std::uint16_t a, std::uint16_t b, std::uint16_t p, std::uint16_t d) const;
  void flip(std::uint16_t cell, std::uint16_t p);
  void join(std::uint16_t edge, std::uint16_t twin);
  void sortAlongCurve(std::size_t count);
  void collect();
  void collectHull(std::uint16_t infinite_cell);

  static bool isInfinite(const Cell& cell) {
    return cell.vertex[0] == kInfinite || cell.vertex[1] == kInfinite || cell.vertex[2] == kInfinite;
  }

  std::array<GridPoint, kMaxDelaunayPoints> point_;
  std::size_t point_count_ = 0;
  std::size_t vertex_count_ = 0;
  DelaunaySkipped skipped_;
  std::array<Cell, kMaxCells> cell_;
  std::size_t cell_count_ = 0;  ///< 0 while all vertices are on one line
  std::uint16_t last_ = 0;      ///< where the next walk begins
  /// While there is no triangle: the vertices in the order in which they lie on their line.
  FixedVector<std::uint16_t, kMaxDelaunayPoints> line_;
  std::array<std::uint16_t, kMaxDelaunayPoints> order_;  ///< in which build() inserts

  bool collected_ = false;                     ///< what follows is of the points up to now
  std::array<std::uint16_t, kMaxCells> rank_;  ///< of a cell in triangles_
  FixedVector<DelaunayTriangle, kMaxDelaunayTriangles> triangles_;
  FixedVector<std::uint16_t, kMaxDelaunayPoints> hull_;
};

}  // namespace swiftlet
