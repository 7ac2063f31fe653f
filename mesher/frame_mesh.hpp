#pragma once
// One frame's mesh: the tracked features of camera 0, joined by triangles in the image and lifted to the
// landmarks' places.
//
// Delaunay's triangles, whose diagonals are then turned where the others follow the depth better (Dyn, Levin,
// Rippa, "Data Dependent Triangulations for Piecewise Linear Interpolation", IMA J. Num. Anal. 1990).
// Features without a known depth take no part but in the hull. Faces that do not follow a surface are
// removed, by these rules, none of which knows how large the room is (docs/mesher.md says what each buys):
//  - unknown: a vertex whose distance is known to less than a tenth (1 sigma);
//  - thin: the shortest height in the image is below 2 px;
//  - torn: it reaches far along the line of sight, and those beside it do not lie in its plane (two of them,
//    or all where it is seen at less than 14 degrees): it hangs between two surfaces.
// A face has the label that all of seven places in it show; across a border between labels it has none.
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
  float relative_sigma = 0;  ///< of the distance, over the distance
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

  /// `points`: finite, ids unique. `labels`: in the features' raw geometry, or empty. No faces with fewer
  /// than three points, or all of them on a line.
  void build(const Points& points, const ImageView& labels);

  [[nodiscard]] const Points& points() const { return points_; }
  /// They cover the convex hull; those to use are kKept.
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
