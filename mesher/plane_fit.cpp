#include "mesher/plane_fit.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

// A face with edges of 30 cm and corners off by 3 cm (1 sigma) is tilted by 8 degrees; many faces are
// thinner.
constexpr float kFaceCosine = 0.866F;  // 30 degrees
// The votes' bins are 5 cm and 3 degrees wide: the first gate must include a wall between two bins.
constexpr std::array<float, 3> kGates{0.10F, 0.07F, kPlaneGate};  // m
constexpr float kGateSigmas = 3;
constexpr int kLeastPoints = 4;  // points of a line in the plan: two more than needed
// Half thickness of the slab in which the share is measured. Around a surface there is air or furniture; in a
// cloud, a gate of 5 cm holds a quarter of the slab.
constexpr float kSlab = 0.20F;  // m
// Extent of the plane in standard deviations of its points; evenly spread points end at 1.7.
constexpr float kExtentSigmas = 2;

// Points form two parts if the widest gap between neighbours exceeds this many standard deviations. For
// twenty evenly spread points this happens in one of thirty cases.
constexpr float kGapSigmas = 1;

constexpr double kLeastSpread = 1e-6;  // m^2, for points on one vertical line

float height(const PlaneGuess& plane, const Eigen::Vector3f& p) {
  return plane.normal.dot(p) - plane.distance;
}

}  // namespace

float normalSigma(const VertexFacts& vertex, const Eigen::Vector3f& normal) {
  return std::hypot(vertex.depth_sigma * vertex.ray.dot(normal), kSurfaceSigma);
}

void PlaneFit::collect(const LocalMesh& mesh, const MeshFacts& facts, const PlaneGuess& plane, float gate,
                       bool by_noise) {
  // 1: within the gate; 2: also a corner of a face in the plane.
  for (std::size_t v = 0; v < facts.vertices.size(); ++v) {
    const VertexFacts& vertex = facts.vertices[v];
    vertex_in_[v] = 0;
    if (!vertex.finite) continue;
    const float limit = by_noise ? std::min(gate, kGateSigmas * normalSigma(vertex, plane.normal)) : gate;
    vertex_in_[v] = std::abs(height(plane, vertex.p)) <= limit ? 1 : 0;
  }
  support_ = PlaneSupport{};
  for (std::size_t f = 0; f < facts.faces.size(); ++f) {
    const FaceFacts& face = facts.faces[f];
    face_in_[f] = 0;
    if (face.area <= 0 || face.taken || face.normal.dot(plane.normal) < kFaceCosine) continue;
    const auto& corner = mesh.faces[f].vertex;
    if (vertex_in_[corner[0]] == 0 || vertex_in_[corner[1]] == 0 || vertex_in_[corner[2]] == 0) continue;
    face_in_[f] = 1;
    support_.area += face.area;
    for (const std::uint32_t v : corner) {
      support_.points += vertex_in_[v] == 1 ? 1 : 0;
      vertex_in_[v] = 2;
    }
  }
}

bool PlaneFit::solve(const MeshFacts& facts, PlaneGuess& plane) {
  double sum = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  for (std::size_t v = 0; v < facts.vertices.size(); ++v) {
    if (vertex_in_[v] != 2) continue;
    const VertexFacts& vertex = facts.vertices[v];
    const double sigma = normalSigma(vertex, plane.normal);
    const double weight = 1 / (sigma * sigma);
    const Eigen::Vector3d p = vertex.p.cast<double>();
    sum += weight;
    mean += weight * p;
    square += weight * p.head<2>() * p.head<2>().transpose();
  }
  if (!(sum > 0)) return false;
  mean /= sum;
  turn_sigma_ = 0;
  if (plane.direction == PlaneDirection::kVertical) {
    const Eigen::Matrix2d covariance = square / sum - mean.head<2>() * mean.head<2>().transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
    axes.computeDirect(covariance);
    Eigen::Vector2f normal = axes.eigenvectors().col(0).cast<float>();
    if (normal.dot(plane.normal.head<2>()) < 0) normal = -normal;
    if (!normal.allFinite()) return false;
    plane.normal << normal, 0.0F;
    turn_sigma_ = static_cast<float>(1 / std::sqrt(sum * std::max(axes.eigenvalues()[1], kLeastSpread)));
  }
  plane.distance = static_cast<float>(plane.normal.cast<double>().dot(mean));
  return std::isfinite(plane.distance);
}

bool PlaneFit::refine(const LocalMesh& mesh, const MeshFacts& facts, PlaneGuess& plane, bool known) {
  const Eigen::Vector3f guessed = plane.normal;
  for (const float gate : kGates) {
    if (known && gate > kPlaneGate) continue;  // otherwise it would include neighbouring surfaces
    collect(mesh, facts, plane, gate, gate == kPlaneGate);
    if (support_.points < kLeastPoints || !solve(facts, plane)) return false;
    if (plane.normal.dot(guessed) < kFaceCosine) return false;  // it has turned into something else
  }
  collect(mesh, facts, plane, kPlaneGate, true);
  if (support_.points < kLeastPoints) return false;
  judge(facts, plane);
  return true;
}

void PlaneFit::judge(const MeshFacts& facts, const PlaneGuess& plane) {
  const bool level = plane.direction == PlaneDirection::kHorizontal;
  const Eigen::Vector3f across = level ? Eigen::Vector3f(Eigen::Vector3f::UnitX())
                                       : Eigen::Vector3f(-plane.normal.y(), plane.normal.x(), 0.0F);
  const Eigen::Vector3f along = plane.normal.cross(across);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double distances = 0;
  double chi_squared = 0;
  for (std::size_t v = 0; v < facts.vertices.size(); ++v) {
    if (vertex_in_[v] != 2) continue;
    const VertexFacts& vertex = facts.vertices[v];
    const Eigen::Vector2d q(across.dot(vertex.p), along.dot(vertex.p));
    const double r = height(plane, vertex.p);
    const double sigma = normalSigma(vertex, plane.normal);
    support_.known += sigma <= 0.5 * static_cast<double>(kPlaneGate) ? 1 : 0;
    mean += q;
    square += q * q.transpose();
    centre += vertex.p.cast<double>();
    distances += r * r;
    chi_squared += r * r / (sigma * sigma);
  }
  const double count = support_.points;
  mean /= count;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
  axes.computeDirect(Eigen::Matrix2d(square / count - mean * mean.transpose()));
  const Eigen::Vector2d spread = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  support_.turn_sigma = turn_sigma_;
  support_.narrow = static_cast<float>(spread[0]);
  const Eigen::Vector2f axis = axes.eigenvectors().col(0).cast<float>();
  narrow_axis_ = axis.x() * across + axis.y() * along;
  support_.rms = static_cast<float>(std::sqrt(distances / count));
  support_.chi_squared = static_cast<float>(chi_squared / count);
  support_.centre = (centre / count).cast<float>();
  int near = 0;
  int on = 0;
  for (const VertexFacts& vertex : facts.vertices) {
    if (!vertex.finite) continue;
    const float r = std::abs(height(plane, vertex.p));
    if (r > kSlab || normalSigma(vertex, plane.normal) > kPlaneGate) continue;
    const Eigen::Vector2d q =
        axes.eigenvectors().transpose() * (Eigen::Vector2d(across.dot(vertex.p), along.dot(vertex.p)) - mean);
    if (std::abs(q[0]) > kExtentSigmas * spread[0] || std::abs(q[1]) > kExtentSigmas * spread[1]) continue;
    ++near;
    on += r <= kPlaneGate ? 1 : 0;
  }
  support_.share = near == 0 ? 0.0F : static_cast<float>(on) / static_cast<float>(near);
}

float PlaneFit::narrowOfLargerPart(const MeshFacts& facts) {
  std::size_t count = 0;
  for (std::size_t v = 0; v < facts.vertices.size(); ++v) {
    if (vertex_in_[v] == 2) places_[count++] = narrow_axis_.dot(facts.vertices[v].p);
  }
  std::sort(places_.begin(), places_.begin() + static_cast<std::ptrdiff_t>(count));
  std::size_t cut = 0;
  for (std::size_t i = 1; i < count; ++i) {
    if (cut == 0 || places_[i] - places_[i - 1] > places_[cut] - places_[cut - 1]) cut = i;
  }
  if (cut == 0 || places_[cut] - places_[cut - 1] <= kGapSigmas * support_.narrow) return support_.narrow;
  const std::size_t begin = 2 * cut > count ? 0 : cut;
  const std::size_t end = 2 * cut > count ? cut : count;
  double mean = 0;
  double square = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const double q = places_[i];
    mean += q;
    square += q * q;
  }
  const auto points = static_cast<double>(end - begin);
  mean /= points;
  return static_cast<float>(std::sqrt(std::max(square / points - mean * mean, 0.0)));
}

}  // namespace swiftlet
