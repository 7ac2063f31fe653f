#include "drivers/simulated/tile_tracer.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

constexpr float kPiFloat = std::numbers::pi_v<float>;
constexpr float kNearest = 1e-3F;  // m
// A wider tile has no useful frustum: every patch is then tested.
constexpr float kMaxTileTangent = 2.0F;

bool isFlat(Shape shape) { return shape == Shape::kRectangle || shape == Shape::kDisc; }

void traceFlat(const ViewedPatch& patch, std::int32_t id, Tile& tile) {
  const float nx = patch.normal.x();
  const float ny = patch.normal.y();
  const float nz = patch.normal.z();
  const float reach = patch.normal.dot(patch.origin);
  const float ux = patch.u_axis.x();
  const float uy = patch.u_axis.y();
  const float uz = patch.u_axis.z();
  const float u0 = patch.u_axis.dot(patch.origin);
  const float vx = patch.v_axis.x();
  const float vy = patch.v_axis.y();
  const float vz = patch.v_axis.z();
  const float v0 = patch.v_axis.dot(patch.origin);
  // A rectangle is not bounded by a circle: use an infinite radius.
  const float radius = patch.shape == Shape::kDisc ? patch.radius : 0.5F * Tile::kNothing;
  const float centre = patch.shape == Shape::kDisc ? patch.radius : 0.0F;
  const float radius_squared = std::min(radius, 1e15F) * std::min(radius, 1e15F);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    const float x = tile.x[i];
    const float y = tile.y[i];
    const float z = tile.z[i];
    const float facing = nx * x + ny * y + nz * z;
    const float t = reach / facing;
    const float u = t * (ux * x + uy * y + uz * z) - u0;
    const float v = t * (vx * x + vy * y + vz * z) - v0;
    const float du = u - centre;
    const float dv = v - centre;
    const bool hit = (facing < 0) & (t > kNearest) & (t < tile.distance[i]) & (u >= 0) & (v >= 0) &
                     (u <= patch.u_length) & (v <= patch.v_length) & (du * du + dv * dv <= radius_squared);
    tile.distance[i] = hit ? t : tile.distance[i];
    tile.u[i] = hit ? u : tile.u[i];
    tile.v[i] = hit ? v : tile.v[i];
    tile.hit[i] = hit ? id : tile.hit[i];
  }
}

// Cylinders (in the plane across their axis) and spheres: the near root of a quadratic equation.
void traceRound(const ViewedPatch& patch, std::int32_t id, Tile& tile) {
  const bool cylinder = patch.shape == Shape::kCylinder;
  const Eigen::Vector3f axis = cylinder ? patch.v_axis : Eigen::Vector3f::Zero();
  const Eigen::Vector3f centre = patch.origin - patch.origin.dot(axis) * axis;
  const float c = centre.squaredNorm() - patch.radius * patch.radius;
  const float foot = patch.origin.dot(axis);
  const float top = cylinder ? patch.v_length : 1.0F;
  const float ax = axis.x();
  const float ay = axis.y();
  const float az = axis.z();
  const float cx = centre.x();
  const float cy = centre.y();
  const float cz = centre.z();
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    const float along = ax * tile.x[i] + ay * tile.y[i] + az * tile.z[i];
    const float x = tile.x[i] - along * ax;
    const float y = tile.y[i] - along * ay;
    const float z = tile.z[i] - along * az;
    const float a = x * x + y * y + z * z;
    const float b = x * cx + y * cy + z * cz;
    const float discriminant = b * b - a * c;
    const float root = std::sqrt(discriminant > 0 ? discriminant : 0.0F);
    const float t = (b - root) / a;
    const float height = t * along - foot;
    const bool hit =
        (discriminant > 0) & (t > kNearest) & (t < tile.distance[i]) & (height >= 0) & (height <= top);
    tile.distance[i] = hit ? t : tile.distance[i];
    tile.hit[i] = hit ? id : tile.hit[i];
  }
}

}  // namespace

View::View(const World& world, const SE3& T_world_cam, double slack) {
  const Eigen::Matrix3d R_cam_world = T_world_cam.R().transpose();
  const Eigen::Vector3d& eye = T_world_cam.translation;
  patches_.reserve(world.patches().size());
  for (std::size_t i = 0; i < world.patches().size(); ++i) {
    const Patch& patch = world.patches()[i];
    ViewedPatch viewed;
    viewed.shape = patch.shape;
    viewed.index = static_cast<std::uint32_t>(i);
    viewed.origin = (R_cam_world * (patch.origin - eye)).cast<float>();
    viewed.u_axis = (R_cam_world * patch.u_axis).cast<float>();
    Eigen::Vector3d v_axis = patch.v_axis;
    Eigen::Vector3d normal = patch.u_axis.cross(patch.v_axis);
    if (isFlat(patch.shape)) {
      if (normal.dot(eye - patch.origin) < -slack) continue;
    } else {
      v_axis = Eigen::Vector3d::UnitZ();
      normal = v_axis.cross(patch.u_axis);
    }
    viewed.v_axis = (R_cam_world * v_axis).cast<float>();
    viewed.normal = (R_cam_world * normal).cast<float>();
    viewed.u_length = static_cast<float>(patch.u_length);
    viewed.v_length = static_cast<float>(patch.v_length);
    viewed.radius = static_cast<float>(patch.radius);
    patches_.push_back(viewed);
  }
}

void loadRays(const RayTable& rays, int column, int row, float dx, float dy, Tile& tile) {
  const int last_x = rays.width() - 1;
  const int last_y = rays.height() - 1;
  // A ray dx right of a pixel lies between it and its right or left neighbour.
  const int step_x = dx < 0 ? -1 : 1;
  const int step_y = dy < 0 ? -1 : 1;
  const float wx = std::fabs(dx);
  const float wy = std::fabs(dy);
  for (int j = 0; j < kTileSide; ++j) {
    const int y = std::min(row + j, last_y);
    const int beside_y = std::max(y + step_y, 0);
    for (int i = 0; i < kTileSide; ++i) {
      const int x = std::min(column + i, last_x);
      const int beside_x = std::max(x + step_x, 0);
      const auto k = static_cast<std::size_t>(j * kTileSide + i);
      tile.x[k] = rays.x(y)[x] + wx * (rays.x(y)[beside_x] - rays.x(y)[x]) +
                  wy * (rays.x(beside_y)[x] - rays.x(y)[x]);
      tile.y[k] = rays.y(y)[x] + wx * (rays.y(y)[beside_x] - rays.y(y)[x]) +
                  wy * (rays.y(beside_y)[x] - rays.y(y)[x]);
      tile.z[k] = rays.z(y)[x] + wx * (rays.z(y)[beside_x] - rays.z(y)[x]) +
                  wy * (rays.z(beside_y)[x] - rays.z(y)[x]);
    }
  }
}

void patchesInTile(const View& view, const RayTable& rays, int column, int row, float margin, float slack,
                   std::vector<std::int32_t>& inside) {
  inside.clear();
  // The tile's frustum in a frame that looks along its middle ray.
  const int right = std::min(column + kTileSide, rays.width());
  const int below = std::min(row + kTileSide, rays.height());
  Eigen::Vector3f axis = rays.ray((column + right) / 2, (row + below) / 2);
  if (!axis.allFinite()) axis = Eigen::Vector3f::UnitZ();
  const Eigen::Vector3f ex = axis.unitOrthogonal();
  const Eigen::Vector3f ey = axis.cross(ex);
  float reach_x = 0;
  float reach_y = 0;
  bool narrow = true;
  for (int y = row; y <= below; ++y) {
    // The border suffices: a lens maps the inside of a tile to the inside of its border.
    const int stride = y == row || y == below ? 1 : std::max(1, right - column);
    for (int x = column; x <= right; x += stride) {
      const Eigen::Vector3f ray = rays.ray(x, y);
      const float z = ray.dot(axis);
      if (!(z > 0.1F)) {
        narrow = false;  // NaN too: part of the tile lies outside the lens
        continue;
      }
      reach_x = std::max(reach_x, std::fabs(ray.dot(ex)) / z);
      reach_y = std::max(reach_y, std::fabs(ray.dot(ey)) / z);
    }
  }
  // One pixel more for rays beside the centres, and the camera's rotation.
  const float more = 1.5F * rays.pixelAngle() + margin;
  reach_x += more * (1 + reach_x * reach_x);
  reach_y += more * (1 + reach_y * reach_y);
  narrow = narrow && reach_x < kMaxTileTangent && reach_y < kMaxTileTangent;

  const std::array<Eigen::Vector3f, 4> planes{
      (reach_x * axis - ex).normalized(), (reach_x * axis + ex).normalized(),
      (reach_y * axis - ey).normalized(), (reach_y * axis + ey).normalized()};
  const auto& patches = view.patches();
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const ViewedPatch& patch = patches[i];
    bool out = false;
    for (std::size_t k = 0; narrow && !out && k < planes.size(); ++k) {
      const Eigen::Vector3f& plane = planes[k];  // inside: plane . p > 0
      const float base = plane.dot(patch.origin);
      float furthest = base;  // largest value over the patch
      if (isFlat(patch.shape)) {
        furthest += std::max(0.0F, patch.u_length * plane.dot(patch.u_axis)) +
                    std::max(0.0F, patch.v_length * plane.dot(patch.v_axis));
      } else {
        furthest += patch.radius;
        if (patch.shape == Shape::kCylinder)
          furthest += std::max(0.0F, patch.v_length * plane.dot(patch.v_axis));
      }
      out = furthest < -slack;
    }
    if (!out) inside.push_back(static_cast<std::int32_t>(i));
  }
}

void traceTile(const View& view, const std::vector<std::int32_t>& candidates, Tile& tile) {
  tile.distance.fill(Tile::kNothing);
  tile.hit.fill(-1);
  tile.u.fill(0);
  tile.v.fill(0);
  for (const std::int32_t id : candidates) {
    const ViewedPatch& patch = view.patches()[static_cast<std::size_t>(id)];
    if (isFlat(patch.shape)) {
      traceFlat(patch, id, tile);
    } else {
      traceRound(patch, id, tile);
    }
  }
}

SurfaceHit surfaceAt(const ViewedPatch& patch, const Tile& tile, int i) {
  const auto k = static_cast<std::size_t>(i);
  const Eigen::Vector3f ray(tile.x[k], tile.y[k], tile.z[k]);
  if (isFlat(patch.shape)) return {tile.u[k], tile.v[k], -ray.dot(patch.normal)};
  const Eigen::Vector3f p = tile.distance[k] * ray - patch.origin;
  const float east = p.dot(patch.u_axis);
  const float north = p.dot(patch.normal);
  const float up = p.dot(patch.v_axis);
  const float angle = std::atan2(north, east);
  const float u = patch.radius * (angle < 0 ? angle + 2 * kPiFloat : angle);
  if (patch.shape == Shape::kCylinder) {
    const Eigen::Vector3f normal = (east * patch.u_axis + north * patch.normal) / patch.radius;
    return {u, up, -ray.dot(normal)};
  }
  const float latitude = std::asin(std::clamp(up / patch.radius, -1.0F, 1.0F));
  return {u, patch.radius * (latitude + kPiFloat / 2), -ray.dot(p) / patch.radius};
}

}  // namespace swiftlet
