#include "mesher/frame_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Sine of the least angle between a face and the line of sight to its middle. Walls and floors of a room are
// seen at more than 15 degrees nearly everywhere; a face from a thing to the wall behind it at less.
constexpr float kMinSineToSight = 0.25F;
// Of the distance from the camera.
constexpr float kMaxEdgeOverDepth = 0.5F;
constexpr float kMinHeight = 2.0F;  // px
constexpr float kMaxRelativeSigma = 0.1F;

// Places in a face at which the label image is read: spread, away from the edges.
struct Barycentric {
  float a, b, c;
};
constexpr std::array<Barycentric, 7> kLabelPlaces = {{{1 / 3.0F, 1 / 3.0F, 1 / 3.0F},
                                                      {0.6F, 0.2F, 0.2F},
                                                      {0.2F, 0.6F, 0.2F},
                                                      {0.2F, 0.2F, 0.6F},
                                                      {0.45F, 0.45F, 0.1F},
                                                      {0.45F, 0.1F, 0.45F},
                                                      {0.1F, 0.45F, 0.45F}}};

}  // namespace

FaceVerdict FrameMesh::judge(const FrameFace& face) const {
  const FramePoint& a = points_[face.point[0]];
  const FramePoint& b = points_[face.point[1]];
  const FramePoint& c = points_[face.point[2]];
  if (std::max({a.relative_sigma, b.relative_sigma, c.relative_sigma}) > kMaxRelativeSigma) {
    return FaceVerdict::kUnknown;
  }
  const Eigen::Vector2f ab = b.pixel - a.pixel;
  const Eigen::Vector2f ac = c.pixel - a.pixel;
  const float twice_area = std::abs(ab.x() * ac.y() - ab.y() * ac.x());
  const float longest_px =
      std::sqrt(std::max({ab.squaredNorm(), ac.squaredNorm(), (b.pixel - c.pixel).squaredNorm()}));
  if (twice_area < kMinHeight * longest_px) return FaceVerdict::kThin;
  const Eigen::Vector3f middle = (a.p_cam + b.p_cam + c.p_cam) / 3;
  const float longest =
      std::sqrt(std::max({(a.p_cam - b.p_cam).squaredNorm(), (b.p_cam - c.p_cam).squaredNorm(),
                          (c.p_cam - a.p_cam).squaredNorm()}));
  const float distance = middle.norm();
  if (longest > kMaxFaceEdge || longest > kMaxEdgeOverDepth * distance) return FaceVerdict::kLong;
  const Eigen::Vector3f normal = (b.p_cam - a.p_cam).cross(c.p_cam - a.p_cam);
  if (std::abs(normal.dot(middle)) < kMinSineToSight * normal.norm() * distance) return FaceVerdict::kSteep;
  return FaceVerdict::kKept;
}

// A face across a border between labels is of neither.
std::uint8_t FrameMesh::labelOf(const FrameFace& face, const ImageView& labels) const {
  std::uint8_t label = kNoLabel;
  for (const Barycentric& place : kLabelPlaces) {
    const Eigen::Vector2f at = place.a * points_[face.point[0]].pixel +
                               place.b * points_[face.point[1]].pixel +
                               place.c * points_[face.point[2]].pixel;
    const int x = std::clamp(static_cast<int>(std::lround(at.x())), 0, labels.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(at.y())), 0, labels.height - 1);
    const std::uint8_t read = labels.row(y)[x];
    if (&place != &kLabelPlaces.front() && read != label) return kNoLabel;
    label = read;
  }
  return label;
}

void FrameMesh::build(const Points& points, const ImageView& labels) {
  points_ = points;
  faces_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i) pixels_[i] = points_[i].pixel;
  static_cast<void>(delaunay_.build({pixels_.data(), points_.size()}));
  for (const auto& triangle : delaunay_.triangles()) {
    FrameFace face;
    // y points down in the image: what is counter-clockwise in its axes is clockwise to the eye.
    face.point = {triangle.vertex[0], triangle.vertex[2], triangle.vertex[1]};
    face.verdict = judge(face);
    if (!labels.empty()) face.label = labelOf(face, labels);
    static_cast<void>(faces_.tryPushBack(face));
  }
}

}  // namespace swiftlet
