#pragma once
// Distance of a mesh from the true surface, and correctness of its labels.
//
// The mesh is sampled evenly by area: at equal steps along the running sum of the faces' areas, and within
// the faces by the R2 sequence (Roberts 2018, a two-dimensional golden ratio), so the points of one mesh are
// always the same. The error of a point is its distance to the nearest true triangle. Its label is right if
// that triangle has the label of the point's face. Faces with label 0 are counted separately. Cost: about 1
// us per point.

#include <cstdint>
#include <vector>

#include "estimator/geometry/alignment.hpp"
#include "firmware_host/lab/evaluation/label_confusion.hpp"
#include "firmware_host/lab/evaluation/mesh_distance.hpp"

namespace swiftlet {

/// Sampling density [points per square metre].
inline constexpr double kSurfaceDensity = 1000;

struct SurfaceSample {
  Eigen::Vector3d point;
  std::uint32_t face = 0;
};

double areaOf(const TriangleMesh& mesh);

/// round(area * density) points, at least one if there is area.
std::vector<SurfaceSample> sampleSurface(const TriangleMesh& mesh, double density);

/// The mesh moved (and scaled) by an alignment.
TriangleMesh moved(TriangleMesh mesh, const Alignment& alignment);

/// A true surface with its labels.
class TrueSurface {
 public:
  explicit TrueSurface(const TriangleMesh& mesh) : distance_(mesh), labels_(mesh.labels) {}
  [[nodiscard]] const MeshDistance& distance() const { return distance_; }
  /// 0 if the file has no labels.
  [[nodiscard]] std::uint8_t label(std::uint32_t face) const { return labels_.empty() ? 0 : labels_[face]; }

 private:
  MeshDistance distance_;
  std::vector<std::uint8_t> labels_;
};

struct DistanceStatistics {
  std::size_t count = 0;
  double mean = 0;  ///< m
  double rmse = 0;
  double median = 0;
  double percentile95 = 0;
};
/// All zero for an empty list.
DistanceStatistics statisticsOf(std::vector<float> distances);

/// Of one mesh, or of several sampled at the same density.
struct SurfaceError {
  double area = 0;               ///< m^2
  std::vector<float> distances;  ///< m, one per sample
  std::size_t labelled = 0;      ///< samples on faces with a label
  std::size_t label_right = 0;   ///< of these, with the right label

  void add(const SurfaceError& other);
  [[nodiscard]] double labelShare() const;       ///< right labels among labelled samples; 0 without any
  [[nodiscard]] double unlabelledShare() const;  ///< unlabelled share of all samples
};

/// `mesh` in the true surface's axes. `labels`, if given, receives the samples' found and true labels.
SurfaceError surfaceError(const TriangleMesh& mesh, const TrueSurface& truth, double density,
                          LabelConfusion* labels = nullptr);

}  // namespace swiftlet
