#pragma once
// How much of the true surface seen by a camera a mesh covers.
//
// Rays go through a grid of raw pixels inside a polygon, from the true camera pose, by the lens model.
//  - Complete: of the points where rays meet the true surface, those with mesh within kCovered. Every pixel
//    has the same weight (the main figure). In addition, every point is weighted by the area of surface that
//    it stands for: solid angle * distance^2 / cos(incidence), the cosine not below kLeastCosine, so that a
//    few glancing pixels do not dominate.
//  - Drawn: of all rays, those that meet the mesh anywhere. Needs no true surface.
//  - Relative error: where rays meet the mesh, the distance to the nearest true surface over the distance
//    from the camera.
// Cost: about 1 us per pixel for the ray, and twice as much for each mesh.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"
#include "firmware_host/lab/evaluation/mesh_distance.hpp"

namespace swiftlet {

inline constexpr double kCovered = 0.10;     ///< m
inline constexpr double kLeastCosine = 0.1;  ///< 84 degrees from the normal

/// The rays of a camera through every `step`-th pixel in both directions, from step/2 on.
class RayGrid {
 public:
  struct Ray {
    Eigen::Vector2d pixel;
    Eigen::Vector3d bearing;  ///< unit, in the camera frame
    double solid_angle = 0;   ///< of the grid cell around it [sr]
  };

  RayGrid(const CameraModel& camera, int step);
  [[nodiscard]] const std::vector<Ray>& rays() const { return rays_; }
  /// Number of pixels of the grid, including those without a ray (where the lens model has no inverse).
  [[nodiscard]] std::size_t pixels() const { return pixels_; }

 private:
  std::vector<Ray> rays_;
  std::size_t pixels_ = 0;
};

/// A ray inside the polygon.
struct SeenRay {
  Eigen::Vector3d direction;  ///< unit, in the true surface's axes
  double distance = 0;        ///< m, to the true surface; 0: no intersection
  double area = 0;            ///< m^2 of surface represented by the ray
};

struct SeenSurface {
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();  ///< centre, in the true surface's axes
  std::vector<SeenRay> rays;
  double polygon_share = 0;  ///< share of the image's grid pixels inside the polygon
};

/// A polygon [raw px] with fewer than three corners has nothing inside. `truth` may be null.
SeenSurface seenSurface(const RayGrid& grid, std::span<const Eigen::Vector2f> polygon, const SE3& T_world_cam,
                        const MeshDistance* truth);

struct Completeness {
  std::size_t rays = 0;
  std::size_t drawn = 0;      ///< rays that meet the mesh
  double squared_errors = 0;  ///< sum over these rays, relative to the distance from the camera
  std::size_t seen = 0;       ///< rays that meet the true surface
  std::size_t covered = 0;
  double seen_area = 0;     ///< m^2
  double covered_area = 0;  ///< m^2

  void add(const Completeness& other);
  [[nodiscard]] double share() const;      ///< 0 if nothing was seen
  [[nodiscard]] double areaShare() const;  ///< the same by area
  [[nodiscard]] double drawnShare() const;
  [[nodiscard]] double relativeRmse() const;  ///< over the distance from the camera
};

/// `mesh` in the true surface's axes; `truth` may be null.
Completeness completenessOf(const SeenSurface& seen, const MeshDistance& mesh, const MeshDistance* truth);

}  // namespace swiftlet
