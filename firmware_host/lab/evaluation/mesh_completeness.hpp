#pragma once
// Which share of the true surface that a camera saw has mesh near it.
//
// Seen: rays through a grid of raw pixels inside a polygon, from the true camera pose by the lens model
// to the first true triangle. A point is covered when mesh lies within kCovered of it. Every pixel
// weighs the same (the main figure); beside it, every point weighs the area of surface that stands for
// it: solid angle * distance^2 / cos(incidence), the cosine not below kLeastCosine, so that a few
// glancing pixels do not stand for everything.
// Cost: about 1 us a pixel for the ray and as much for each mesh judged.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"
#include "firmware_host/lab/evaluation/mesh_distance.hpp"

namespace swiftlet {

inline constexpr double kCovered = 0.10;     ///< m
inline constexpr double kLeastCosine = 0.1;  ///< 84 degrees off the normal

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
  /// Pixels of the grid, those without a ray (the lens model has no inverse there) included.
  [[nodiscard]] std::size_t pixels() const { return pixels_; }

 private:
  std::vector<Ray> rays_;
  std::size_t pixels_ = 0;
};

struct SeenPoint {
  Eigen::Vector3d point;  ///< in the true surface's axes
  double area = 0;        ///< m^2 of surface it stands for
};

struct SeenSurface {
  std::vector<SeenPoint> points;
  double polygon_share = 0;  ///< of the image's grid pixels, inside the polygon
};

/// A polygon [raw px] of fewer than three corners has nothing inside.
SeenSurface seenSurface(const RayGrid& grid, std::span<const Eigen::Vector2f> polygon, const SE3& T_world_cam,
                        const MeshDistance& truth);

struct Completeness {
  std::size_t seen = 0;
  std::size_t covered = 0;
  double seen_area = 0;     ///< m^2
  double covered_area = 0;  ///< m^2

  void add(const Completeness& other);
  [[nodiscard]] double share() const;      ///< 0 when nothing was seen
  [[nodiscard]] double areaShare() const;  ///< the same by area
};

/// `mesh` in the true surface's axes.
Completeness completenessOf(std::span<const SeenPoint> points, const MeshDistance& mesh);

}  // namespace swiftlet
