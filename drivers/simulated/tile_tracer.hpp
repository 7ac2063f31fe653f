#pragma once
// Finds what each ray of a square tile of pixels sees.
//
// The world's patches are transformed to the camera frame once per instant of the exposure. For each tile,
// those that can be in its frustum are selected and tested against all rays of the tile in one loop that the
// compiler vectorizes (single precision; errors below 1e-5 of the distance). Memory: 5 kB per tile on the
// caller's stack; 200 bytes per patch of a view.

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/ray_table.hpp"
#include "drivers/simulated/world.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// A patch as a camera sees it at one instant: vectors in the camera frame.
struct ViewedPatch {
  Shape shape = Shape::kRectangle;
  std::uint32_t index = 0;
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  Eigen::Vector3f u_axis = Eigen::Vector3f::Zero();
  Eigen::Vector3f v_axis = Eigen::Vector3f::Zero();  ///< a cylinder's axis; a sphere's pole
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< of flat patches; else the third axis
  float u_length = 0;
  float v_length = 0;
  float radius = 0;
};

/// The patches that one camera could see at one instant.
class View {
 public:
  /// `slack` [m]: also keeps patches whose visible side faces away by less than this.
  View(const World& world, const SE3& T_world_cam, double slack);
  [[nodiscard]] const std::vector<ViewedPatch>& patches() const { return patches_; }

 private:
  std::vector<ViewedPatch> patches_;
};

inline constexpr int kTileSide = 16;
inline constexpr int kTilePixels = kTileSide * kTileSide;

struct alignas(32) Tile {
  static constexpr float kNothing = 1e30F;
  std::array<float, kTilePixels> x;  ///< ray, camera frame
  std::array<float, kTilePixels> y;
  std::array<float, kTilePixels> z;
  std::array<float, kTilePixels> distance;  ///< along the ray [m]; kNothing if nothing is hit
  std::array<float, kTilePixels> u;         ///< surface coordinates [m] of flat patches
  std::array<float, kTilePixels> v;
  std::array<std::int32_t, kTilePixels> hit;  ///< index into the view's patches, -1: nothing
};

/// Loads the rays of the tile at pixel (column, row), each (dx, dy) pixels from its centre. Beyond the
/// image's edge the last row and column are repeated.
void loadRays(const RayTable& rays, int column, int row, float dx, float dy, Tile& tile);

/// Indices into view.patches() that the tile's rays could hit. `margin` [rad] allows for a rotating camera,
/// `slack` [m] for a moving one.
void patchesInTile(const View& view, const RayTable& rays, int column, int row, float margin, float slack,
                   std::vector<std::int32_t>& inside);

/// Fills distance, hit, u, v from the tile's rays.
void traceTile(const View& view, const std::vector<std::int32_t>& candidates, Tile& tile);

/// Surface coordinates and the cosine of incidence where ray `i` of the tile hit `patch`.
struct SurfaceHit {
  float u = 0;
  float v = 0;
  float cosine = 1;
};
SurfaceHit surfaceAt(const ViewedPatch& patch, const Tile& tile, int i);

}  // namespace swiftlet
