#include "mesher/horizon_mesh.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr std::uint32_t kNone = TripletTable::kNone;
// Values of joined_.
constexpr std::uint32_t kWhole = 0;
constexpr std::uint32_t kTorn = 1;
// A landmark is seen through a face if it lies behind the face by more than this share of its distance, this
// length and this many sigmas. The first two allow for faces that cut the corner of a curved surface.
constexpr float kBehindShare = 0.05F;
constexpr float kBehind = 0.05F;  // m
constexpr float kBehindSigmas = 3.0F;
// Points nearer to the camera's centre do not project well [m].
constexpr double kMinDistance = 0.1;
// If a face's longest edge has grown by this factor, its landmarks no longer form the surface that was seen.
constexpr float kMaxGrowth = 1.5F;
// Most votes of a label: this many consecutive observations of another label change a face's label.
constexpr std::uint8_t kMaxVotes = 8;

}  // namespace

HorizonMesh::HorizonMesh(const HorizonLimits& limits)
    : limits_(limits), known_(limits.faces), joined_(2 * kMaxFeatures) {
  vertices_.reserve(limits.vertices);
  merged_.reserve(limits.vertices);
  faces_.reserve(limits.faces);
  new_index_.reserve(limits.vertices);
  referenced_.reserve(limits.vertices);
  projected_.reserve(limits.vertices);
  point_of_.reserve(limits.vertices);
}

void HorizonMesh::clear() {
  vertices_.clear();
  faces_.clear();
}

void HorizonMesh::update(const FrameMesh& frame, const LandmarkLookup& landmarks, const CameraModel& camera,
                         const SE3& T_world_cam) {
  mergeVertices(frame, landmarks);
  renumberFaces();
  joinFrame(frame);
  project(camera, T_world_cam.inverse());
  review(frame);
  addFaces(frame);
}

/// Merges remaining old vertices and the frame's new ones, ordered by id.
void HorizonMesh::mergeVertices(const FrameMesh& frame, const LandmarkLookup& landmarks) {
  const FrameMesh::Points& points = frame.points();
  in_kept_face_.fill(false);
  for (const FrameFace& face : frame.faces()) {
    if (face.verdict != FaceVerdict::kKept) continue;
    for (const std::uint16_t p : face.point) in_kept_face_[p] = true;
  }
  by_id_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) by_id_[i] = static_cast<std::uint16_t>(i);
  std::sort(by_id_.begin(), by_id_.end(),
            [&points](std::uint16_t a, std::uint16_t b) { return points[a].id < points[b].id; });
  referenced_.assign(vertices_.size(), 0);
  for (const Face& face : faces_) {
    for (const std::uint32_t v : face.vertex) referenced_[v] = 1;
  }
  new_index_.assign(vertices_.size(), kNone);
  merged_.clear();
  std::size_t old = 0;
  std::size_t next = 0;
  while (old < vertices_.size() || next < by_id_.size()) {
    const FramePoint* point = next < by_id_.size() ? &points[by_id_[next]] : nullptr;
    const MeshVertex* vertex = old < vertices_.size() ? &vertices_[old] : nullptr;
    if (point != nullptr && vertex != nullptr && point->id > vertex->id) point = nullptr;
    if (point != nullptr && vertex != nullptr && point->id < vertex->id) vertex = nullptr;
    MeshVertex entry = vertex != nullptr ? *vertex : MeshVertex{point->id, {}, point->grey};
    const WindowLandmark* landmark = landmarks.find(entry.id);
    const bool stays =
        vertex != nullptr && referenced_[old] != 0 && (landmark != nullptr || limits_.keep_all);
    const bool wanted = point != nullptr && landmark != nullptr && in_kept_face_[by_id_[next]];
    if (stays || wanted) {
      if (landmark != nullptr) entry.p_world = landmark->p_world.cast<float>();
      if (merged_.size() < limits_.vertices) {
        if (vertex != nullptr) new_index_[old] = static_cast<std::uint32_t>(merged_.size());
        merged_.push_back(entry);
      } else {
        ++counters_.refused;
      }
    }
    next += point != nullptr ? 1 : 0;
    old += vertex != nullptr ? 1 : 0;
  }
  vertices_.swap(merged_);
}

void HorizonMesh::renumberFaces() {
  std::size_t kept = 0;
  for (Face face : faces_) {
    for (std::uint32_t& v : face.vertex) v = new_index_[v];
    if (std::find(face.vertex.begin(), face.vertex.end(), kNone) == face.vertex.end()) faces_[kept++] = face;
  }
  faces_.resize(kept);
}

/// Relates vertices and the frame's points in both directions, and collects the frame's triangles by their
/// points.
void HorizonMesh::joinFrame(const FrameMesh& frame) {
  point_of_.assign(vertices_.size(), kNone);
  vertex_of_.fill(kNone);
  std::size_t v = 0;
  for (const std::uint16_t p : by_id_) {
    const TrackId id = frame.points()[p].id;
    while (v < vertices_.size() && vertices_[v].id < id) ++v;
    if (v == vertices_.size()) break;
    if (vertices_[v].id != id) continue;
    point_of_[v] = p;
    vertex_of_[p] = static_cast<std::uint32_t>(v);
  }
  joined_.clear();
  for (const FrameFace& face : frame.faces()) {
    const bool torn = face.verdict == FaceVerdict::kTorn;
    joined_.insert({face.point[0], face.point[1], face.point[2]}, torn ? kTorn : kWhole);
  }
}

void HorizonMesh::project(const CameraModel& camera, const SE3& T_cam_world) {
  projected_.resize(vertices_.size());
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    const Eigen::Vector3d p = T_cam_world * vertices_[v].p_world.cast<double>();
    const double distance = p.norm();
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
    const bool projects = distance > kMinDistance && camera.project(p, pixel);
    projected_[v] = {pixel.cast<float>(), projects ? static_cast<float>(1 / distance) : 0.0F};
  }
}

/// Removes old faces that the frame contradicts.
void HorizonMesh::review(const FrameMesh& frame) {
  std::size_t kept = 0;
  for (const Face& face : faces_) {
    const TripletTable::Triplet points = {point_of_[face.vertex[0]], point_of_[face.vertex[1]],
                                          point_of_[face.vertex[2]]};
    const bool tracked = std::find(points.begin(), points.end(), kNone) == points.end();
    if (longestEdge(face) > kMaxGrowth * face.edge) continue;
    if (tracked && joined_.find(points) != kWhole) {
      ++counters_.replaced;
      continue;
    }
    if (!tracked && seenThrough(face, frame)) {
      ++counters_.refuted;
      continue;
    }
    faces_[kept++] = face;
  }
  faces_.resize(kept);
}

void HorizonMesh::addFaces(const FrameMesh& frame) {
  known_.clear();
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    known_.insert(faces_[i].vertex, static_cast<std::uint32_t>(i));
  }
  for (const FrameFace& seen : frame.faces()) {
    if (seen.verdict != FaceVerdict::kKept) continue;
    Face face{{vertex_of_[seen.point[0]], vertex_of_[seen.point[1]], vertex_of_[seen.point[2]]},
              seen.label,
              static_cast<std::uint8_t>(seen.label == kNoLabel ? 0 : 1)};
    if (std::find(face.vertex.begin(), face.vertex.end(), kNone) != face.vertex.end()) continue;
    face.edge = longestEdge(face);
    const std::uint32_t index = known_.find(face.vertex);
    if (index == kNone) {
      if (faces_.size() == limits_.faces) {
        ++counters_.refused;
        continue;
      }
      known_.insert(face.vertex, static_cast<std::uint32_t>(faces_.size()));
      faces_.push_back(face);
    } else if (seen.label != kNoLabel) {
      Face& known = faces_[index];
      if (known.label == seen.label) {
        known.votes = std::min<std::uint8_t>(static_cast<std::uint8_t>(known.votes + 1), kMaxVotes);
      } else if (known.votes > 0) {
        --known.votes;
      } else {
        known.label = seen.label;
        known.votes = 1;
      }
    }
  }
}

/// Whether a landmark of the frame lies behind the face, on a line of sight through it.
bool HorizonMesh::seenThrough(const Face& face, const FrameMesh& frame) const {
  const Projected& a = projected_[face.vertex[0]];
  const Projected& b = projected_[face.vertex[1]];
  const Projected& c = projected_[face.vertex[2]];
  if (a.inverse_distance <= 0 || b.inverse_distance <= 0 || c.inverse_distance <= 0) return false;
  const Eigen::Vector2f low = a.pixel.cwiseMin(b.pixel).cwiseMin(c.pixel);
  const Eigen::Vector2f high = a.pixel.cwiseMax(b.pixel).cwiseMax(c.pixel);
  const auto cross = [](const Eigen::Vector2f& u, const Eigen::Vector2f& v) {
    return u.x() * v.y() - u.y() * v.x();
  };
  const float area = cross(b.pixel - a.pixel, c.pixel - a.pixel);
  if (std::abs(area) < 1) return false;
  for (const FramePoint& point : frame.points()) {
    const Eigen::Vector2f& p = point.pixel;
    if (p.x() < low.x() || p.y() < low.y() || p.x() > high.x() || p.y() > high.y()) continue;
    const float wb = cross(p - a.pixel, c.pixel - a.pixel) / area;
    const float wc = cross(b.pixel - a.pixel, p - a.pixel) / area;
    const float wa = 1 - wb - wc;
    if (wa <= 0 || wb <= 0 || wc <= 0) continue;
    const float inverse = wa * a.inverse_distance + wb * b.inverse_distance + wc * c.inverse_distance;
    const float distance = point.p_cam.norm();
    const float margin =
        std::max({kBehind, kBehindShare * distance, kBehindSigmas * point.relative_sigma * distance});
    if (distance - 1 / inverse > margin) return true;
  }
  return false;
}

float HorizonMesh::longestEdge(const Face& face) const {
  const Eigen::Vector3f& a = vertices_[face.vertex[0]].p_world;
  const Eigen::Vector3f& b = vertices_[face.vertex[1]].p_world;
  const Eigen::Vector3f& c = vertices_[face.vertex[2]].p_world;
  return std::sqrt(std::max({(a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()}));
}

}  // namespace swiftlet
