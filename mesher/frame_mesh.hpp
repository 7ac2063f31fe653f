#pragma once
// One frame's mesh: the tracked features of camera 0, joined by Delaunay triangles in the image and lifted
// to the landmarks' places.
//
// Features without a known depth take no part but in the hull. Faces that do not follow a surface are
// removed, by these rules (docs/mesher.md has the reasons and what each buys):
//  - steep: the face's normal is within 14 degrees of being orthogonal to the line of sight: it bridges two
//    surfaces, one behind the other;
//  - long: an edge longer than 1 m, or than half of the distance from the camera;
//  - thin: the shortest height in the image is below 2 px;
//  - unknown: a vertex whose depth is known to less than a tenth (1 sigma).
// A face has the label that all of seven places in it show; across a border between labels it has none.
// Frames: camera 0, metres; raw pixels. Source: Rosinol, Sattler, Pollefeys, Carlone, "Incremental
// Visual-Inertial 3D Mesh Generation with Structural Regularities", ICRA 2019.
// Memory: 60 kB and Delaunay's, inside the object. Cost: 0.15 ms for 300 features.

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

/// What no landmark lies on for that far is unknown, not flat [m].
inline constexpr float kMaxFaceEdge = 1.0F;

/// A feature with its landmark.
struct FramePoint {
  TrackId id = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  Eigen::Vector3f p_cam = Eigen::Vector3f::Zero();
  float relative_sigma = 0;  ///< of the distance, over the distance
  std::uint8_t grey = 128;
};

enum class FaceVerdict : std::uint8_t { kKept, kSteep, kLong, kThin, kUnknown };

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
  /// All of Delaunay's; those to use are kKept.
  [[nodiscard]] const Faces& faces() const { return faces_; }

 private:
  [[nodiscard]] FaceVerdict judge(const FrameFace& face) const;
  [[nodiscard]] std::uint8_t labelOf(const FrameFace& face, const ImageView& labels) const;

  Delaunay delaunay_;
  std::array<Eigen::Vector2f, kMaxFeatures> pixels_;
  Points points_;
  Faces faces_;
};

}  // namespace swiftlet
