#pragma once
// How far a mesh lies from the true surface, and whether it carries the true labels.
//
// The mesh is sampled evenly by area: along the running sum of the faces' areas at equal steps, and
// within the faces by the R2 sequence (Roberts 2018, a two-dimensional golden ratio), so the points of
// one mesh are always the same. The error of a point is its distance to the nearest true triangle; its
// label is right when that triangle has the label of the point's face. Faces with label 0 are counted
// apart. Cost: about 1 us a point.

#include <cstdint>
#include <vector>

#include "estimator/geometry/alignment.hpp"
#include "firmware_host/lab/evaluation/label_confusion.hpp"
#include "firmware_host/lab/evaluation/mesh_distance.hpp"

namespace swiftlet {

/// Points per square metre at which a surface is judged.
inline constexpr double kSurfaceDensity = 1000;

struct SurfaceSample {
  Eigen::Vector3d point;
  std::uint32_t face = 0;
};

double areaOf(const TriangleMesh& mesh);

/// round(area * density) points, at least one where there is area.
std::vector<SurfaceSample> sampleSurface(const TriangleMesh& mesh, double density);

/// The mesh moved (and scaled) by an alignment.
TriangleMesh moved(TriangleMesh mesh, const Alignment& alignment);

/// A true surface with its labels.
class TrueSurface {
 public:
  explicit TrueSurface(const TriangleMesh& mesh) : distance_(mesh), labels_(mesh.labels) {}
  [[nodiscard]] const MeshDistance& distance() const { return distance_; }
  /// 0 where the file has none.
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

/// Of one mesh, or of several sampled at one density.
struct SurfaceError {
  double area = 0;               ///< m^2
  std::vector<float> distances;  ///< m, one a sample
  std::size_t labelled = 0;      ///< samples on faces with a label
  std::size_t label_right = 0;   ///< of them

  void add(const SurfaceError& other);
  [[nodiscard]] double labelShare() const;       ///< right among the labelled; 0 without any
  [[nodiscard]] double unlabelledShare() const;  ///< of all samples
};

/// `mesh` in the true surface's axes. `labels`, when given, gets the samples' labels beside the true ones.
SurfaceError surfaceError(const TriangleMesh& mesh, const TrueSurface& truth, double density,
                          LabelConfusion* labels = nullptr);

}  // namespace swiftlet
