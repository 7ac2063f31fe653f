#include "drivers/simulated/lighting.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr double kAmbient = 0.45;       // share of ambient light
constexpr double kFromFloor = 0.2;      // share reflected from the lit floor onto surfaces that face down
constexpr double kLampStrength = 0.55;  // gives about 1 on the floor below a lamp of average height
constexpr double kSlack = 0.02;         // m: a point must not shade itself
constexpr int kMaxCells = 400;

}  // namespace

LightGrid::LightGrid(const World& world, std::size_t index, double spacing) {
  const Patch& patch = world.patches()[index];
  columns_ = std::clamp(static_cast<int>(std::ceil(patch.u_length / spacing)), 1, kMaxCells) + 1;
  rows_ = std::clamp(static_cast<int>(std::ceil(patch.v_length / spacing)), 1, kMaxCells) + 1;
  per_u_ = static_cast<float>((columns_ - 1) / patch.u_length);
  per_v_ = static_cast<float>((rows_ - 1) / patch.v_length);
  value_.reserve(static_cast<std::size_t>(columns_ * rows_));
  for (int j = 0; j < rows_; ++j) {
    for (int i = 0; i < columns_; ++i) {
      // Grid points exactly on the edge would touch the neighbouring surface: move them inwards.
      const double u =
          std::clamp(i / static_cast<double>(per_u_), kSlack, std::max(kSlack, patch.u_length - kSlack));
      const double v =
          std::clamp(j / static_cast<double>(per_v_), kSlack, std::max(kSlack, patch.v_length - kSlack));
      const Eigen::Vector3d normal = patch.normalAt(u, v);
      const Eigen::Vector3d point = patch.pointAt(u, v) + 0.5 * kSlack * normal;
      double light = kAmbient + kFromFloor * std::max(0.0, -normal.z());
      for (const Lamp& lamp : world.lamps()) {
        if (lamp.zone != patch.zone) continue;
        const Eigen::Vector3d to = lamp.position - point;
        const double cosine = to.normalized().dot(normal);
        if (cosine <= 0 || !world.sees(point, lamp.position, 0.0)) continue;
        light += kLampStrength * lamp.power * cosine / (1.0 + to.squaredNorm());
      }
      value_.push_back(static_cast<float>(light));
    }
  }
}

float LightGrid::at(float u, float v) const {
  const float x = std::clamp(u * per_u_, 0.0F, static_cast<float>(columns_ - 1));
  const float y = std::clamp(v * per_v_, 0.0F, static_cast<float>(rows_ - 1));
  const int x0 = std::min(static_cast<int>(x), columns_ - 2);
  const int y0 = std::min(static_cast<int>(y), rows_ - 2);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const float* p = value_.data() + static_cast<std::ptrdiff_t>(y0) * columns_ + x0;
  const float top = p[0] + fx * (p[1] - p[0]);
  const float low = p[columns_] + fx * (p[columns_ + 1] - p[columns_]);
  return top + fy * (low - top);
}

}  // namespace swiftlet
