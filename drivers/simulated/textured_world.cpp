#include "drivers/simulated/textured_world.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/simulated/lighting.hpp"
#include "drivers/simulated/painter.hpp"
#include "drivers/simulated/parallel.hpp"

namespace swiftlet {
namespace {

constexpr double kLightSpacing = 0.12;     // m between grid points of the light
constexpr double kMaxLightPoints = 30000;  // in the whole world
constexpr double kLightTexels = 20;     // least texels between grid points: coarse paint needs no fine light
constexpr float kStoredWhite = 215.0F;  // stored value of reflectance 1 in light 1; headroom under lamps

Texture paintLit(const World& world, std::size_t index, double texel, double light_spacing) {
  const Patch& patch = world.patches()[index];
  const double per_metre = 1.0 / texel;
  const int width = std::max(1, static_cast<int>(std::ceil(patch.u_length * per_metre)));
  const int height = std::max(1, static_cast<int>(std::ceil(patch.v_length * per_metre)));
  const std::vector<float> reflectance = paintPatch(patch, width, height, per_metre);
  std::vector<std::uint8_t> texels(reflectance.size());
  if (patch.material == Material::kLamp) {
    std::fill(texels.begin(), texels.end(), std::uint8_t{255});
    return {std::move(texels), width, height, static_cast<float>(per_metre)};
  }
  const LightGrid light(world, index, light_spacing);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto k =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const float u = static_cast<float>((x + 0.5) * texel);
      const float v = static_cast<float>((y + 0.5) * texel);
      texels[k] = static_cast<std::uint8_t>(
          std::clamp(kStoredWhite * reflectance[k] * light.at(u, v) + 0.5F, 0.0F, 255.0F));
    }
  }
  return {std::move(texels), width, height, static_cast<float>(per_metre)};
}

}  // namespace

TexturedWorld::TexturedWorld(World world, const PaintSettings& settings) : world_(std::move(world)) {
  double area = 0;
  for (const Patch& patch : world_.patches()) area += patch.u_length * patch.v_length;
  texel_ = std::max(settings.texel, std::sqrt(area / settings.max_texels));
  const double light_spacing =
      std::max({kLightSpacing, std::sqrt(area / kMaxLightPoints), kLightTexels * texel_});
  textures_.resize(world_.patches().size());
  parallelFor(static_cast<int>(textures_.size()), settings.threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    textures_[index] = paintLit(world_, index, texel_, light_spacing);
  });
}

std::size_t TexturedWorld::bytes() const {
  std::size_t sum = 0;
  for (const Texture& texture : textures_) sum += texture.bytes();
  return sum;
}

}  // namespace swiftlet
