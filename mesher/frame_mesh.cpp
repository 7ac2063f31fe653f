#include "mesher/frame_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr float kMinHeight = 2.0F;  // px
constexpr float kMaxRelativeSigma = 0.1F;
// A diagonal is flipped only if the logarithms of its ends' distances then differ less by this amount;
// smaller gains are noise.
constexpr float kLeastGain = 0.1F;
// Largest tear: geometric mean of a face's extent along the line of sight and of its neighbours' disagreement
// with it, both relative to the distance. In a rendered hall and a rendered room, faces up to this limit are
// off by 1.15 and 1.33 % of their distance; a larger limit draws more faces, with larger errors.
constexpr float kMaxTear = 0.12F;
// Disagreement of a point on the other side of the camera's parallel to the plane.
constexpr float kMostDisagreement = 1.0F;
// Sine of 14 degrees. Walls and floors of a room are nearly always seen at larger angles.
constexpr float kMinSineToSight = 0.25F;

// Positions in a face at which the label image is read: spread, away from the edges.
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

FaceVerdict FrameMesh::judge(std::size_t index) const {
  const auto& vertex = triangles_[index].vertex;
  const FramePoint& a = points_[vertex[0]];
  const FramePoint& b = points_[vertex[1]];
  const FramePoint& c = points_[vertex[2]];
  if (std::max({a.relative_sigma, b.relative_sigma, c.relative_sigma}) > kMaxRelativeSigma) {
    return FaceVerdict::kUnknown;
  }
  const Eigen::Vector2f ab = b.pixel - a.pixel;
  const Eigen::Vector2f ac = c.pixel - a.pixel;
  const float twice_area = std::abs(ab.x() * ac.y() - ab.y() * ac.x());
  const float longest_px =
      std::sqrt(std::max({ab.squaredNorm(), ac.squaredNorm(), (b.pixel - c.pixel).squaredNorm()}));
  if (twice_area < kMinHeight * longest_px) return FaceVerdict::kThin;
  // NaN does not pass as a surface.
  return tear(index) <= kMaxTear ? FaceVerdict::kKept : FaceVerdict::kTorn;
}

// A surface continues beyond a face's edges: the points beyond two of them tell whether the face is on one.
// Between the straight edge of an object and the wall behind it, faces all lie in one plane but nearly along
// the line of sight: there the point beyond the third edge must agree too.
float FrameMesh::tear(std::size_t index) const {
  const DelaunayTriangle& triangle = triangles_[index];
  const auto& vertex = triangle.vertex;
  const Eigen::Vector3f& a = points_[vertex[0]].p_cam;
  Eigen::Vector3f plane = (points_[vertex[1]].p_cam - a).cross(points_[vertex[2]].p_cam - a);
  plane /= plane.dot(a);  // plane . p = 1 on it, distance over the plane's along the ray elsewhere
  FixedVector<float, 3> disagreement;
  for (std::size_t k = 0; k < 3; ++k) {
    if (triangle.neighbour[k] == DelaunayTriangle::kNoNeighbour) continue;
    const float ratio = plane.dot(points_[apexBeyond(index, k)].p_cam);
    disagreement.pushBack(ratio > 0 ? std::max(ratio, 1 / ratio) - 1 : kMostDisagreement);
  }
  std::sort(disagreement.begin(), disagreement.end());
  const Eigen::Vector3f middle = (a + points_[vertex[1]].p_cam + points_[vertex[2]].p_cam) / 3;
  const bool steep = std::abs(plane.dot(middle)) < kMinSineToSight * plane.norm() * middle.norm();
  if (disagreement.empty()) return steep ? kMostDisagreement : 0;
  const std::size_t wanted = std::min<std::size_t>(disagreement.size(), steep ? 3 : 2);
  const auto [nearest, farthest] =
      std::minmax({log_distance_[vertex[0]], log_distance_[vertex[1]], log_distance_[vertex[2]]});
  return std::sqrt((std::exp(farthest - nearest) - 1) * disagreement[wanted - 1]);
}

std::size_t FrameMesh::edgeTowards(std::size_t from, std::size_t to) const {
  const auto& neighbours = triangles_[from].neighbour;
  return static_cast<std::size_t>(std::find(neighbours.begin(), neighbours.end(), to) - neighbours.begin());
}

std::uint16_t FrameMesh::apexBeyond(std::size_t index, std::size_t edge) const {
  const std::size_t beyond = triangles_[index].neighbour[edge];
  return triangles_[beyond].vertex[(edgeTowards(beyond, index) + 2) % 3];
}

// Delaunay triangulation ignores depth. Of the two possible diagonals of two triangles, the one is taken
// whose ends are at more similar distances: along the edge of an object, not from it to the background.
void FrameMesh::alignWithDepth() {
  const auto twiceArea = [this](std::uint16_t a, std::uint16_t b, std::uint16_t c) {
    const Eigen::Vector2f ab = pixels_[b] - pixels_[a];
    const Eigen::Vector2f ac = pixels_[c] - pixels_[a];
    return ab.x() * ac.y() - ab.y() * ac.x();
  };
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (triangles_[t].neighbour[k] == DelaunayTriangle::kNoNeighbour) continue;
      const std::uint16_t a = triangles_[t].vertex[k];
      const std::uint16_t b = triangles_[t].vertex[(k + 1) % 3];
      const std::uint16_t c = triangles_[t].vertex[(k + 2) % 3];
      const std::uint16_t d = apexBeyond(t, k);
      const float gain =
          std::abs(log_distance_[a] - log_distance_[b]) - std::abs(log_distance_[c] - log_distance_[d]);
      const float least = kMinHeight * (pixels_[c] - pixels_[d]).norm();
      if (gain < kLeastGain || twiceArea(a, d, c) < least || twiceArea(d, b, c) < least) continue;
      turnDiagonal(t, k);
      break;
    }
  }
}

// Triangles a b c and b a d become a d c and d b c.
void FrameMesh::turnDiagonal(std::size_t index, std::size_t edge) {
  DelaunayTriangle& near = triangles_[index];
  const std::uint16_t beyond = near.neighbour[edge];
  DelaunayTriangle& far = triangles_[beyond];
  const std::size_t back = edgeTowards(beyond, index);
  const auto self = static_cast<std::uint16_t>(index);
  const std::uint16_t d = far.vertex[(back + 2) % 3];
  const std::uint16_t a = near.vertex[edge];
  const std::uint16_t b = near.vertex[(edge + 1) % 3];
  const std::uint16_t c = near.vertex[(edge + 2) % 3];
  const std::uint16_t past_bc = near.neighbour[(edge + 1) % 3];
  const std::uint16_t past_ca = near.neighbour[(edge + 2) % 3];
  const std::uint16_t past_ad = far.neighbour[(back + 1) % 3];
  const std::uint16_t past_db = far.neighbour[(back + 2) % 3];
  if (past_bc != DelaunayTriangle::kNoNeighbour) {
    triangles_[past_bc].neighbour[edgeTowards(past_bc, index)] = beyond;
  }
  if (past_ad != DelaunayTriangle::kNoNeighbour) {
    triangles_[past_ad].neighbour[edgeTowards(past_ad, beyond)] = self;
  }
  near = {{a, d, c}, {past_ad, beyond, past_ca}};
  far = {{d, b, c}, {past_db, past_bc, self}};
}

// A face across a border between labels has none.
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
  for (std::size_t i = 0; i < points_.size(); ++i) {
    pixels_[i] = points_[i].pixel;
    log_distance_[i] = std::log(points_[i].p_cam.norm());
  }
  static_cast<void>(delaunay_.build({pixels_.data(), points_.size()}));
  triangles_.clear();
  for (const DelaunayTriangle& triangle : delaunay_.triangles()) {
    static_cast<void>(triangles_.tryPushBack(triangle));
  }
  alignWithDepth();
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const DelaunayTriangle& triangle = triangles_[i];
    FrameFace face;
    // y points down in the image: counter-clockwise in its axes looks clockwise.
    face.point = {triangle.vertex[0], triangle.vertex[2], triangle.vertex[1]};
    face.verdict = judge(i);
    if (!labels.empty()) face.label = labelOf(face, labels);
    static_cast<void>(faces_.tryPushBack(face));
  }
}

}  // namespace swiftlet
