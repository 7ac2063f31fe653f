#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"

#include <algorithm>

#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {

void MeshSequence::add(const TriangleMesh& mesh, const SeenSurface& seen) {
  ++meshes_;
  hull_share_.push_back(seen.polygon_share);
  if (truth_ != nullptr) {
    const SurfaceError error = surfaceError(mesh, *truth_, density_);
    if (!error.distances.empty()) rmse_.push_back(statisticsOf(error.distances).rmse);
    error_.add(error);
  }
  const Completeness completeness =
      completenessOf(seen, MeshDistance(mesh), truth_ == nullptr ? nullptr : &truth_->distance());
  if (completeness.seen > 0) share_.push_back(completeness.share());
  completeness_.add(completeness);
}

MeshSequenceAccuracy MeshSequence::result() const {
  MeshSequenceAccuracy result;
  result.meshes = meshes_;
  result.empty = meshes_ - rmse_.size();
  result.density = density_;
  result.area = error_.area;
  result.distance = statisticsOf(error_.distances);
  result.median_rmse = statisticsOf(rmse_).median;
  result.completeness = completeness_;
  result.median_completeness = statisticsOf(share_).median;
  result.median_hull_share = statisticsOf(hull_share_).median;
  result.label_share = error_.labelShare();
  result.unlabelled_share = error_.unlabelledShare();
  return result;
}

double sequenceDensity(double area) {
  return area * kSurfaceDensity > kMostSamples ? kMostSamples / area : kSurfaceDensity;
}

CompleteMeshAccuracy completeMeshAccuracy(const TriangleMesh& mesh, const TrueSurface& truth,
                                          const std::vector<Eigen::Vector3f>& observed) {
  CompleteMeshAccuracy result;
  result.vertices = mesh.vertices.size();
  result.faces = mesh.faces.size();
  result.density = sequenceDensity(areaOf(mesh));
  const SurfaceError error = surfaceError(mesh, truth, result.density, &result.labels);
  result.area = error.area;
  result.distance = statisticsOf(error.distances);
  result.label_share = error.labelShare();
  result.unlabelled_share = error.unlabelledShare();
  const MeshDistance distance(mesh);
  result.observed = observed.size();
  result.covered = static_cast<std::size_t>(std::ranges::count_if(observed, [&](const Eigen::Vector3f& p) {
    return distance.nearest(p.cast<double>(), kCovered).has_value();
  }));
  return result;
}

void judgeRegistered(const TriangleMesh& mesh, const TriangleMesh& true_mesh, const TrueSurface& truth,
                     CompleteMeshAccuracy& accuracy) {
  accuracy.registration = registerMesh(mesh, true_mesh, truth);
  const TriangleMesh laid = moved(mesh, accuracy.registration->motion);
  accuracy.registered = statisticsOf(surfaceError(laid, truth, accuracy.density).distances);
}

}  // namespace swiftlet
