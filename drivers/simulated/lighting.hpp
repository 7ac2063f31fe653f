#pragma once
// Light on a surface: every lamp of its zone with the shadows of all objects, plus a constant share for
// reflections from walls. Computed once on a coarse grid over the surface and interpolated.

#include <vector>

#include "drivers/simulated/world.hpp"

namespace swiftlet {

class LightGrid {
 public:
  /// Lights patch `index`; `spacing` [m] between grid points. Cost: points x lamps x patches.
  LightGrid(const World& world, std::size_t index, double spacing);
  /// Relative irradiance at surface coordinates (u, v) [m]; about 1 under the lamps.
  [[nodiscard]] float at(float u, float v) const;

 private:
  int columns_ = 2;
  int rows_ = 2;
  float per_u_ = 0;  // grid cells per metre
  float per_v_ = 0;
  std::vector<float> value_;
};

}  // namespace swiftlet
