#pragma once
// Distance from points, and along rays, to the triangles of a mesh.
//
// A bounding volume hierarchy: splits by binned surface area (Wald, "On fast Construction of SAH-based
// Bounding Volume Hierarchies", RT 2007) and, below a fixed depth, halves, so that a query's stack has a
// fixed size. Nearest point of a triangle: Ericson, "Real-Time Collision Detection", 5.1.5. Rays: Moeller,
// Trumbore, 1997, both sides, with edges widened by 1e-9 of the triangle so that no ray passes between
// neighbours. Double precision. Building: O(n log n), 180 bytes per triangle; a query visits O(log n) nodes.

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

class MeshDistance {
 public:
  static constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

  struct Answer {
    double distance = 0;     ///< m; along the ray for cast()
    std::uint32_t face = 0;  ///< index in the given mesh
  };

  /// Keeps a copy of the triangles.
  explicit MeshDistance(const TriangleMesh& mesh);

  /// The triangle nearest to `p`; empty if none is within `most` (or the mesh has none).
  [[nodiscard]] std::optional<Answer> nearest(const Eigen::Vector3d& p, double most = kAnyDistance) const;

  /// The first triangle along the ray; `direction` has unit length.
  [[nodiscard]] std::optional<Answer> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                           double most = kAnyDistance) const;

  /// Unit normal of a face, by the order of its corners; zero for a face without area.
  [[nodiscard]] Eigen::Vector3d normal(std::uint32_t face) const;

 private:
  struct Triangle {
    Eigen::Vector3d a;
    Eigen::Vector3d ab;
    Eigen::Vector3d ac;
  };
  struct Box {
    Eigen::Array3d low = Eigen::Array3d::Constant(kAnyDistance);
    Eigen::Array3d high = Eigen::Array3d::Constant(-kAnyDistance);

    void add(const Box& other) {
      low = low.min(other.low);
      high = high.max(other.high);
    }
    [[nodiscard]] double halfArea() const;
    [[nodiscard]] double squaredDistance(const Eigen::Array3d& p) const;
  };
  /// Children are adjacent and follow their parent; a leaf has `count` triangles from `first`.
  struct Node {
    Box box;
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  struct Item {
    Box box;
    Eigen::Array3d centre;
    std::uint32_t face = 0;
  };
  struct Span {
    std::uint32_t node = 0;
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
    int depth = 0;
  };

  void build(std::vector<Item>& items);
  static std::uint32_t split(std::vector<Item>& items, const Span& span, const Box& centres);
  static double nearestOf(const Triangle& triangle, const Eigen::Vector3d& p);

  std::vector<Node> nodes_;
  std::vector<Triangle> triangles_;   ///< in the order of the leaves
  std::vector<std::uint32_t> faces_;  ///< index in the mesh of each triangle
  std::vector<std::uint32_t> place_;  ///< index in triangles_ of each face of the mesh
};

}  // namespace swiftlet
