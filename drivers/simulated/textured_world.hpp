#pragma once
// A world with its painted and lit surfaces, ready to be rendered.

#include <vector>

#include "drivers/simulated/texture.hpp"
#include "drivers/simulated/world.hpp"

namespace swiftlet {

struct PaintSettings {
  double texel = 0.0025;     ///< m; coarser if the world would exceed the budget
  double max_texels = 48e6;  ///< budget of the finest level; memory is 4/3 bytes per texel
  int threads = 2;
};

class TexturedWorld {
 public:
  /// Paints every patch; about a second for a room on two cores.
  TexturedWorld(World world, const PaintSettings& settings);

  [[nodiscard]] const World& world() const { return world_; }
  [[nodiscard]] const Texture& texture(std::size_t patch) const { return textures_[patch]; }
  [[nodiscard]] double texel() const { return texel_; }  ///< m, as used
  [[nodiscard]] std::size_t bytes() const;

 private:
  World world_;
  double texel_ = 0;
  std::vector<Texture> textures_;
};

}  // namespace swiftlet
