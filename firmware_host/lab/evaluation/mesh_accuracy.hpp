#pragma once
// Accuracy of a run's meshes: of its frames, pooled, and of the whole flight.
//
// Pooled: all samples of all meshes at one density, so that every square metre of mesh has the same weight;
// all seen pixels of all frames. Medians: over the meshes, each evaluated alone.

#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/evaluation/mesh_completeness.hpp"
#include "firmware_host/lab/evaluation/mesh_error.hpp"
#include "firmware_host/lab/evaluation/mesh_registration.hpp"

namespace swiftlet {

/// Step of the pixel grid for completeness [px]: 5640 rays for an image of 752 x 480.
inline constexpr int kGridStep = 8;
/// Most samples of a sequence: beyond it, all meshes are sampled with a lower density than kSurfaceDensity.
inline constexpr double kMostSamples = 4e6;

struct MeshSequenceAccuracy {
  std::size_t meshes = 0;
  std::size_t empty = 0;  ///< of these, without area: they count only for completeness
  double density = 0;     ///< samples per m^2
  double area = 0;        ///< m^2, all meshes together
  DistanceStatistics distance;
  double median_rmse = 0;  ///< m, over meshes with area
  Completeness completeness;
  double median_completeness = 0;  ///< over frames that saw surface in their hull
  double median_hull_share = 0;    ///< of the image
  double label_share = 0;
  double unlabelled_share = 0;
};

/// Collects the meshes of a sequence, each in the true surface's axes, with what its frame saw. Without a
/// true surface (null), only the coverage of the hull is evaluated.
class MeshSequence {
 public:
  MeshSequence(const TrueSurface* truth, double density) : truth_(truth), density_(density) {}
  void add(const TriangleMesh& mesh, const SeenSurface& seen);
  [[nodiscard]] MeshSequenceAccuracy result() const;

 private:
  const TrueSurface* truth_;
  double density_;
  std::size_t meshes_ = 0;
  SurfaceError error_;
  Completeness completeness_;
  std::vector<double> rmse_;
  std::vector<double> share_;
  std::vector<double> hull_share_;
};

/// Sampling density for a sequence of `area` [m^2].
double sequenceDensity(double area);

struct CompleteMeshAccuracy {
  std::string file;
  std::size_t vertices = 0;
  std::size_t faces = 0;
  double area = 0;     ///< m^2
  double density = 0;  ///< samples per m^2
  DistanceStatistics distance;
  double label_share = 0;
  double unlabelled_share = 0;
  std::size_t observed = 0;  ///< observed points of the true surface; 0: unknown
  std::size_t covered = 0;   ///< of these, with mesh within kCovered
  LabelConfusion labels;     ///< labels of the samples
  /// Of a map: the accuracy after registration to the true surface.
  std::optional<MeshRegistration> registration;
  DistanceStatistics registered;
};
/// Classes with a smaller share of the samples are not part of the mean over classes.
inline constexpr double kLeastClassShare = 0.01;

/// Adds the distances of the mesh from the truth after registration to `accuracy`.
void judgeRegistered(const TriangleMesh& mesh, const TriangleMesh& true_mesh, const TrueSurface& truth,
                     CompleteMeshAccuracy& accuracy);

/// `observed` may be empty.
CompleteMeshAccuracy completeMeshAccuracy(const TriangleMesh& mesh, const TrueSurface& truth,
                                          const std::vector<Eigen::Vector3f>& observed);

struct MeshAccuracy {
  std::string truth;               ///< file of the true surface
  std::string alignment;           ///< how the run was moved onto the truth
  std::size_t frames = 0;          ///< in the selected section
  std::size_t without_truth = 0;   ///< of these, without a true pose: omitted
  std::size_t keyframes_bare = 0;  ///< of the rest, keyframes without a frame mesh
  std::optional<MeshSequenceAccuracy> frame;
  std::optional<MeshSequenceAccuracy> horizon;
  std::optional<CompleteMeshAccuracy> complete;
  std::optional<CompleteMeshAccuracy> map;  ///< map.ply
};

}  // namespace swiftlet
