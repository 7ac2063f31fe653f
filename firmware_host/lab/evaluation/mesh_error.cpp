#include "firmware_host/lab/evaluation/mesh_error.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {
namespace {

// 1/g and 1/g^2 of g^3 = g + 1: the R2 sequence.
constexpr double kR2[] = {0.7548776662466927, 0.5698402909980532};
constexpr double kHigh = 0.95;

struct Corners {
  Eigen::Vector3d a;
  Eigen::Vector3d ab;
  Eigen::Vector3d ac;
  [[nodiscard]] double area() const { return 0.5 * ab.cross(ac).norm(); }
};

Corners cornersOf(const TriangleMesh& mesh, std::size_t face) {
  const auto& v = mesh.faces[face];
  const Eigen::Vector3d a = mesh.vertices[v[0]].cast<double>();
  return {a, mesh.vertices[v[1]].cast<double>() - a, mesh.vertices[v[2]].cast<double>() - a};
}

/// The k-th point of the sequence, folded into the triangle.
Eigen::Vector3d pointWithin(const Corners& corners, std::size_t k) {
  double whole = 0;
  double u = std::modf(0.5 + kR2[0] * static_cast<double>(k), &whole);
  double v = std::modf(0.5 + kR2[1] * static_cast<double>(k), &whole);
  if (u + v > 1) {
    u = 1 - u;
    v = 1 - v;
  }
  return corners.a + u * corners.ab + v * corners.ac;
}

}  // namespace

double areaOf(const TriangleMesh& mesh) {
  double area = 0;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) area += cornersOf(mesh, i).area();
  return area;
}

std::vector<SurfaceSample> sampleSurface(const TriangleMesh& mesh, double density) {
  const double area = areaOf(mesh);
  std::vector<SurfaceSample> samples;
  if (!(area > 0)) return samples;
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(area * density)));
  samples.reserve(count);
  const double step = area / static_cast<double>(count);
  double reached = 0;
  for (std::size_t i = 0; i < mesh.faces.size() && samples.size() < count; ++i) {
    const Corners corners = cornersOf(mesh, i);
    reached += corners.area();
    while (samples.size() < count && (static_cast<double>(samples.size()) + 0.5) * step < reached) {
      samples.push_back({pointWithin(corners, samples.size()), static_cast<std::uint32_t>(i)});
    }
  }
  return samples;
}

TriangleMesh moved(TriangleMesh mesh, const Alignment& alignment) {
  for (Eigen::Vector3f& p : mesh.vertices) {
    p = (alignment * Eigen::Vector3d(p.cast<double>())).cast<float>();
  }
  return mesh;
}

DistanceStatistics statisticsOf(std::vector<float> distances) {
  DistanceStatistics result;
  result.count = distances.size();
  if (distances.empty()) return result;
  const auto n = static_cast<double>(distances.size());
  double sum = 0;
  double squares = 0;
  for (const double d : distances) {
    sum += d;
    squares += d * d;
  }
  result.mean = sum / n;
  result.rmse = std::sqrt(squares / n);
  const auto quantile = [&](double q) {
    const auto at = distances.begin() + std::lround(q * (n - 1));
    std::nth_element(distances.begin(), at, distances.end());
    return static_cast<double>(*at);
  };
  result.median = quantile(0.5);
  result.percentile95 = quantile(kHigh);
  return result;
}

void SurfaceError::add(const SurfaceError& other) {
  area += other.area;
  distances.insert(distances.end(), other.distances.begin(), other.distances.end());
  labelled += other.labelled;
  label_right += other.label_right;
}

double SurfaceError::labelShare() const { return shareOf(label_right, labelled); }

double SurfaceError::unlabelledShare() const {
  return shareOf(distances.size() - labelled, distances.size());
}

SurfaceError surfaceError(const TriangleMesh& mesh, const TrueSurface& truth, double density,
                          LabelConfusion* labels) {
  SurfaceError result;
  result.area = areaOf(mesh);
  const std::vector<SurfaceSample> samples = sampleSurface(mesh, density);
  result.distances.reserve(samples.size());
  for (const SurfaceSample& sample : samples) {
    const auto nearest = truth.distance().nearest(sample.point);
    if (!nearest) continue;
    result.distances.push_back(static_cast<float>(nearest->distance));
    const std::uint8_t label = mesh.labels.empty() ? std::uint8_t{0} : mesh.labels[sample.face];
    if (labels != nullptr) labels->add(truth.label(nearest->face), label);
    if (label == 0) continue;
    ++result.labelled;
    if (truth.label(nearest->face) == label) ++result.label_right;
  }
  return result;
}

}  // namespace swiftlet
