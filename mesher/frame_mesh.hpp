#pragma once
// The mesh of one frame: tracked features of camera 0, triangulated in the image and lifted to the positions
// of their landmarks.
//
// Delaunay triangulation; then a diagonal is flipped if the other one follows the depth better (Dyn, Levin,
// Rippa, "Data Dependent Triangulations for Piecewise Linear Interpolation", IMA J. Num. Anal. 1990).
// Features of unknown depth are only used for the hull. Faces that do not follow a surface are removed by the
// following rules, which do not depend on the size of the scene (docs/mesher.md):
//  - unknown: the distance of a vertex is uncertain by more than a tenth (1 sigma);
//  - thin: the smallest height in the image is below 2 px;
//  - torn: the face extends far along the line of sight, and its neighbours are not in its plane (two
//    of them, or all if it is seen at less than 14 degrees), so it spans two surfaces.
// A face has a label if all of seven samples in it show that label; across a border between labels it has
// none.
// Frames: camera 0, metres; raw pixels. Source: Rosinol, Sattler, Pollefeys, Carlone, "Incremental
// Visual-Inertial 3D Mesh Generation with Structural Regularities", ICRA 2019.
// Memory: 70 kB and Delaunay's, inside the object. Cost: 0.2 ms for 300 features.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "mesher/delaunay.hpp"

namespace swiftlet {

/// A feature with its landmark.
struct FramePoint {
  TrackId id = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  Eigen::Vector3f p_cam = Eigen::Vector3f::Zero();
  float relative_sigma = 0;  ///< sigma of the distance over the distance
  std::uint8_t grey = 128;
};

enum class FaceVerdict : std::uint8_t { kKept, kTorn, kThin, kUnknown };

struct FrameFace {
  std::array<std::uint16_t, 3> point{};  ///< counter-clockwise as seen from the camera
  FaceVerdict verdict = FaceVerdict::kKept;
  std::uint8_t label = kNoLabel;
};

class FrameMesh {
 public:
  using Points = FixedVector<FramePoint, kMaxFeatures>;
  using Faces = FixedVector<FrameFace, 2 * kMaxFeatures>;

  /// `points`: finite, unique ids. `labels`: in the features' raw geometry, or empty. There are no faces with
  /// fewer than three points or if all are collinear.
  void build(const Points& points, const ImageView& labels);

  [[nodiscard]] const Points& points() const { return points_; }
  /// The faces cover the convex hull; use those with kKept.
  [[nodiscard]] const Faces& faces() const { return faces_; }

 private:
  void alignWithDepth();
  void turnDiagonal(std::size_t index, std::size_t edge);
  [[nodiscard]] std::size_t edgeTowards(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::uint16_t apexBeyond(std::size_t index, std::size_t edge) const;
  [[nodiscard]] FaceVerdict judge(std::size_t index) const;
  [[nodiscard]] float tear(std::size_t index) const;
  [[nodiscard]] std::uint8_t labelOf(const FrameFace& face, const ImageView& labels) const;

  Delaunay delaunay_;
  FixedVector<DelaunayTriangle, 2 * kMaxFeatures> triangles_;  ///< of faces_, with their neighbours
  std::array<Eigen::Vector2f, kMaxFeatures> pixels_;
  std::array<float, kMaxFeatures> log_distance_{};
  Points points_;
  Faces faces_;
};

}  // namespace swiftlet
