#pragma once
// Renders the image of one camera of a rig during its flight, with its lens, exposure time and motion.
//
// Every pixel is the mean of `samples` rays, each at another instant of the exposure and another position
// within the pixel: motion blur and anti-aliasing in one. Textures are filtered by footprint. Radiance 1 is
// white in full light; image_sensor.hpp converts it to grey values. Each row of a rolling shutter is seen at
// its own time; the image's time is that of its middle row. The result does not depend on the number of
// threads. Cost: about 40 ns per ray; 752 x 480 with 4 samples takes 60 ms on one core, twice that with a
// rolling shutter.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/simulated/ray_table.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/simulated/textured_world.hpp"
#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

struct RenderSettings {
  int samples = 4;          ///< rays per pixel: 1, 4 or, in fast motion, up to 8
  double exposure = 0.004;  ///< s
  double readout = 0;       ///< s from the first row to the last; 0: global shutter
  int threads = 2;
};

/// Depth and class per pixel, row-major.
struct GeometryImage {
  std::vector<float> depth;         ///< m along the optical axis; 0: no surface
  std::vector<std::uint8_t> label;  ///< Label
  std::vector<std::int32_t> patch;  ///< index of the world's patch, -1: no surface
};

class CameraRenderer {
 public:
  /// The world must outlive this. `T_body_cam`: the true extrinsics.
  CameraRenderer(const TexturedWorld& world, const CameraModel& camera, const SE3& T_body_cam);

  [[nodiscard]] const CameraModel& camera() const { return camera_; }

  /// Radiance per pixel at mid-exposure time `seconds` of the trajectory (of the middle row).
  void renderImage(const SplineTrajectory& trajectory, double seconds, const RenderSettings& settings,
                   std::vector<float>& radiance) const;

  /// Geometry at pixel centres at one instant.
  void renderGeometry(const SE3& T_world_body, int threads, GeometryImage& geometry) const;

  struct Sample {
    float dx = 0;  ///< px from the pixel's centre
    float dy = 0;
    double instant = 0;  ///< share of the exposure from its middle, -0.5 to 0.5
  };
  /// Rows of a rolling shutter that share one camera position: 8 of 480 rows are 0.3 ms of 20 ms, 0.2 mm in
  /// each direction at 1 m/s. Each row has its own rotation relative to that pose.
  static constexpr int kBandRows = 8;
  using RowTurns = std::array<Eigen::Matrix3f, kBandRows>;

 private:
  struct Instant;
  [[nodiscard]] Instant instantAt(const SplineTrajectory& trajectory, double seconds, double exposure,
                                  std::span<const Sample> samples) const;
  /// Upper bound [m/s].
  [[nodiscard]] double speedOf(const MotionState& motion) const;
  void renderRows(const Instant& instant, std::span<const Sample> samples, int row, int rows,
                  const RowTurns* turns, std::vector<float>& radiance) const;

  const TexturedWorld* world_;
  CameraModel camera_;
  SE3 T_body_cam_;
  RayTable rays_;
};

}  // namespace swiftlet
