#include "drivers/simulated/painter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

std::uint32_t mix(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  std::uint32_t h = a * 0x9E3779B1U ^ b * 0x85EBCA77U ^ c * 0xC2B2AE3DU;
  h ^= h >> 15U;
  h *= 0x2C1B3C6DU;
  h ^= h >> 12U;
  h *= 0x297A2D39U;
  return h ^ (h >> 15U);
}

// Uniform in [0, 1) from a cell's integer coordinates.
float cellValue(int x, int y, std::uint32_t seed) {
  return static_cast<float>(mix(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), seed)) *
         0x1p-32F;
}

// Fractal noise, tiled, mean 0 and standard deviation about 1: computed once, sampled everywhere.
class NoiseTile {
 public:
  static constexpr int kSize = 1024;
  NoiseTile() : value_(static_cast<std::size_t>(kSize) * kSize, 0.0F) {
    float amplitude = 1;
    for (int period = 256; period >= 2; period /= 2) {
      addOctave(period, amplitude);
      amplitude *= 0.72F;  // steeper than 1/f is too flat to track, shallower looks like sand
    }
    double square = 0;
    for (const float v : value_) square += static_cast<double>(v) * static_cast<double>(v);
    const auto scale = static_cast<float>(1.0 / std::sqrt(square / static_cast<double>(value_.size())));
    for (float& v : value_) v *= scale;
  }
  // One texel of noise every 1 / scale metres.
  [[nodiscard]] float at(float x, float y) const {
    const float fx = std::floor(x);
    const float fy = std::floor(y);
    const int x0 = static_cast<int>(fx) & (kSize - 1);
    const int y0 = static_cast<int>(fy) & (kSize - 1);
    const int x1 = (x0 + 1) & (kSize - 1);
    const int y1 = (y0 + 1) & (kSize - 1);
    const float a = x - fx;
    const float b = y - fy;
    const float top = texel(x0, y0) + a * (texel(x1, y0) - texel(x0, y0));
    const float low = texel(x0, y1) + a * (texel(x1, y1) - texel(x0, y1));
    return top + b * (low - top);
  }

 private:
  [[nodiscard]] float texel(int x, int y) const {
    return value_[static_cast<std::size_t>(y) * kSize + static_cast<std::size_t>(x)];
  }
  void addOctave(int period, float amplitude) {
    const int cells = kSize / period;
    const auto lattice = [&](int x, int y) {
      return 2.0F * cellValue(x % cells, y % cells, static_cast<std::uint32_t>(period)) - 1.0F;
    };
    for (int y = 0; y < kSize; ++y) {
      const float v = static_cast<float>(y % period) / static_cast<float>(period);
      const float sv = v * v * (3 - 2 * v);
      for (int x = 0; x < kSize; ++x) {
        const float u = static_cast<float>(x % period) / static_cast<float>(period);
        const float su = u * u * (3 - 2 * u);
        const int cx = x / period;
        const int cy = y / period;
        const float top = lattice(cx, cy) + su * (lattice(cx + 1, cy) - lattice(cx, cy));
        const float low = lattice(cx, cy + 1) + su * (lattice(cx + 1, cy + 1) - lattice(cx, cy + 1));
        value_[static_cast<std::size_t>(y) * kSize + static_cast<std::size_t>(x)] +=
            amplitude * (top + sv * (low - top));
      }
    }
  }
  std::vector<float> value_;
};

const NoiseTile& noiseTile() {
  static const NoiseTile tile;
  return tile;
}

// State of a painter while it colours one texel.
struct Brush {
  std::uint32_t seed = 0;
  float shift_x = 0;  // position of this patch in the noise tile
  float shift_y = 0;
  [[nodiscard]] float noise(float u, float v, float per_metre) const {
    return noiseTile().at(u * per_metre + shift_x, v * per_metre + shift_y);
  }
  [[nodiscard]] float cell(int x, int y, std::uint32_t salt) const {
    return cellValue(x, y, seed * 31U + salt);
  }
};

struct CellPlace {
  int x = 0;
  int y = 0;
  float in_x = 0;  // m from the cell's lower edges
  float in_y = 0;
};
CellPlace cellAt(float u, float v, float width, float height, float stagger) {
  CellPlace place;
  place.y = static_cast<int>(std::floor(v / height));
  place.in_y = v - static_cast<float>(place.y) * height;
  const float moved = u + stagger * width * static_cast<float>(place.y & 3);
  place.x = static_cast<int>(std::floor(moved / width));
  place.in_x = moved - static_cast<float>(place.x) * width;
  return place;
}
bool nearEdge(const CellPlace& place, float width, float height, float margin) {
  return place.in_x < margin || place.in_y < margin || place.in_x > width - margin ||
         place.in_y > height - margin;
}

// Round spots at random positions of a grid: distance to the cell's spot relative to its radius; 1 or more is
// outside.
float spot(const Brush& brush, float u, float v, float pitch, float radius_low, float radius_high,
           float share, std::uint32_t salt) {
  const CellPlace place = cellAt(u, v, pitch, pitch, 0);
  if (brush.cell(place.x, place.y, salt) > share) return 2;
  const float radius = radius_low + (radius_high - radius_low) * brush.cell(place.x, place.y, salt + 1);
  const float x = place.in_x - radius - (pitch - 2 * radius) * brush.cell(place.x, place.y, salt + 2);
  const float y = place.in_y - radius - (pitch - 2 * radius) * brush.cell(place.x, place.y, salt + 3);
  return std::sqrt(x * x + y * y) / radius;
}

float plaster(const Brush& b, float u, float v) {
  float value = 0.58F + 0.035F * b.noise(u, v, 40) + 0.03F * b.noise(u, v, 330);
  if (spot(b, u, v, 0.45F, 0.006F, 0.02F, 0.5F, 1) < 1) value *= 0.55F;  // nails, stains
  if (spot(b, u, v, 0.8F, 0.03F, 0.1F, 0.25F, 7) < 1) value *= 0.88F;
  const float crack = std::fabs(b.noise(u, v, 25));
  if (crack < 0.012F && b.noise(v, u, 15) > 0.9F) value *= 0.6F;
  return value;
}
float brick(const Brush& b, float u, float v) {
  constexpr float kWidth = 0.24F;
  constexpr float kHeight = 0.085F;
  const CellPlace place =
      cellAt(u + 0.002F * b.noise(u, v, 150), v + 0.002F * b.noise(v, u, 150), kWidth, kHeight, 0.5F);
  if (nearEdge(place, kWidth, kHeight, 0.006F)) return 0.6F + 0.04F * b.noise(u, v, 400);
  const float shade = b.cell(place.x, place.y, 11);
  return 0.22F + 0.30F * shade * shade + 0.05F * b.noise(u, v, 350);
}
float tiles(const Brush& b, float u, float v) {
  constexpr float kSide = 0.4F;
  const CellPlace place = cellAt(u, v, kSide, kSide, 0);
  if (nearEdge(place, kSide, kSide, 0.004F)) return 0.18F + 0.03F * b.noise(u, v, 300);
  float value = 0.34F + 0.25F * b.cell(place.x, place.y, 13) + 0.05F * b.noise(u, v, 120);
  if (spot(b, u, v, 0.37F, 0.01F, 0.05F, 0.35F, 17) < 1) value *= 0.5F;
  if (spot(b, u, v, 0.21F, 0.004F, 0.012F, 0.5F, 23) < 1) value = 0.8F;
  return value;
}
float grain(const Brush& b, float along, float across) {
  return 0.6F * b.noise(along, across * 14, 25) + 0.4F * b.noise(along * 2, across * 40, 60);
}
float parquet(const Brush& b, float u, float v) {
  constexpr float kLength = 0.7F;
  constexpr float kWidth = 0.11F;
  const CellPlace place = cellAt(u, v, kLength, kWidth, 0.37F);
  if (nearEdge(place, kLength, kWidth, 0.0025F)) return 0.12F;
  const float shift = 3 * b.cell(place.x, place.y, 29);
  float value = 0.3F + 0.22F * b.cell(place.x, place.y, 31) + 0.06F * grain(b, u + shift, v + shift);
  if (spot(b, u, v, 0.3F, 0.006F, 0.018F, 0.3F, 37) < 1) value *= 0.45F;  // knots
  return value;
}
float wood(const Brush& b, float u, float v) {
  constexpr float kBoard = 0.16F;
  const CellPlace place = cellAt(u, v, 50, kBoard, 0);
  if (place.in_y < 0.003F) return 0.15F;
  float value = 0.42F + 0.15F * b.cell(0, place.y, 41) + 0.09F * grain(b, u + static_cast<float>(place.y), v);
  const float knot = spot(b, u, v, 0.24F, 0.008F, 0.022F, 0.4F, 43);
  if (knot < 1) value *= 0.35F + 0.4F * knot;
  return value;
}
float concrete(const Brush& b, float u, float v) {
  float value = 0.42F + 0.07F * b.noise(u, v, 60) + 0.05F * b.noise(v, u, 280);
  const CellPlace place = cellAt(u, v, 1.25F, 1.25F, 0);
  if (nearEdge(place, 1.25F, 1.25F, 0.004F)) value *= 0.5F;
  if (spot(b, u, v, 0.14F, 0.003F, 0.012F, 0.35F, 47) < 1) value *= 0.45F;  // pores
  if (spot(b, u, v, 0.6F, 0.05F, 0.2F, 0.3F, 53) < 1) value *= 0.85F;       // damp
  return value;
}
float books(const Brush& b, float u, float v) {
  constexpr float kShelf = 0.32F;
  const int row = static_cast<int>(std::floor(v / kShelf));
  const float height = v - static_cast<float>(row) * kShelf;
  if (height < 0.022F) return 0.35F + 0.05F * grain(b, u, v);  // the board
  // Books of 2 to 6 cm: groups of 12 cm cut at two random places.
  const float group = std::floor(u / 0.12F);
  const float in_group = u - group * 0.12F;
  const int g = static_cast<int>(group);
  const float cut1 = 0.02F + 0.04F * b.cell(g, row, 59);
  const float cut2 = 0.07F + 0.03F * b.cell(g, row, 61);
  const int index = g * 3 + (in_group > cut1 ? 1 : 0) + (in_group > cut2 ? 1 : 0);
  const float edge =
      std::min({in_group, std::fabs(in_group - cut1), std::fabs(in_group - cut2), 0.12F - in_group});
  const float top = 0.2F + 0.08F * b.cell(index, row, 67);
  if (height > top) return 0.05F + 0.02F * b.noise(u, v, 200);
  const float shade = b.cell(index, row, 71);
  float value = 0.08F + 0.75F * shade * shade;
  if (edge < 0.0025F) value *= 0.4F;
  const float band = b.cell(index, row, 73) * top;
  if (std::fabs(height - band) < 0.012F) value = 0.85F - 0.7F * shade;
  return value + 0.02F * b.noise(u, v, 250);
}
float checker(const Brush& b, float u, float v) {
  const float side = 0.05F + 0.05F * b.cell(0, 0, 79);
  const CellPlace place = cellAt(u, v, side, side, 0);
  const float value = b.cell(place.x, place.y, 83) < 0.5F ? 0.08F : 0.8F;
  return value + 0.02F * b.noise(u, v, 200);
}
float metal(const Brush& b, float u, float v) {
  constexpr float kPanel = 0.38F;
  const CellPlace place = cellAt(u, v, kPanel, kPanel, 0);
  if (nearEdge(place, kPanel, kPanel, 0.005F)) return 0.08F;
  float value = 0.28F + 0.25F * b.cell(place.x, place.y, 89) + 0.05F * b.noise(u * 0.1F, v, 300);
  const float rx = std::min(place.in_x, kPanel - place.in_x) - 0.03F;
  const float ry = std::min(place.in_y, kPanel - place.in_y) - 0.03F;
  if (rx * rx + ry * ry < 6e-5F) value = 0.75F;  // rivets of 8 mm radius
  if (b.cell(place.x, place.y, 97) < 0.25F && place.in_x > 0.08F && place.in_x < 0.3F && place.in_y > 0.1F &&
      place.in_y < 0.28F) {  // ventilation slots
    value = std::fmod(place.in_y, 0.03F) < 0.015F ? 0.06F : 0.5F;
  }
  return value;
}
float carpet(const Brush& b, float u, float v) {
  float value = 0.3F + 0.05F * b.noise(u, v, 400) + 0.04F * b.noise(v, u, 30);
  const CellPlace place = cellAt(u, v, 0.5F, 0.5F, 0);
  value += 0.09F * (b.cell(place.x, place.y, 101) - 0.5F);
  if (spot(b, u, v, 0.25F, 0.02F, 0.07F, 0.3F, 103) < 1) value *= 0.6F;
  return value;
}
float fabric(const Brush& b, float u, float v) {
  const float fold = std::sin(9 * u + 2.2F * b.noise(u, v, 12));
  float value = 0.4F + 0.07F * fold + 0.03F * b.noise(u, v, 380) + 0.04F * b.noise(u, v * 3, 50);
  const CellPlace place = cellAt(u, v, 1.1F, 0.9F, 0);
  if (nearEdge(place, 1.1F, 0.9F, 0.006F)) value *= 0.5F;  // seams
  if (spot(b, u, v, 0.3F, 0.006F, 0.02F, 0.35F, 107) < 1) value *= 0.5F;
  return value;
}
float carton(const Brush& b, float u, float v) {
  return 0.4F + 0.06F * b.cell(0, 0, 109) + 0.025F * b.noise(u, v, 300) + 0.03F * b.noise(u * 8, v, 40);
}

// Draws shapes over a painted patch, in metres.
class Canvas {
 public:
  Canvas(std::vector<float>& texels, int width, int height, double per_metre)
      : texels_(texels), width_(width), height_(height), scale_(per_metre) {}
  void rectangle(double u0, double v0, double u1, double v1, float value) {
    forBox(u0, v0, u1, v1, [&](float& texel, double, double) { texel = value; });
  }
  void disc(double u, double v, double radius, float value) {
    forBox(u - radius, v - radius, u + radius, v + radius, [&](float& texel, double x, double y) {
      if (std::hypot(x - u, y - v) < radius) texel = value;
    });
  }
  void gradient(double u0, double v0, double u1, double v1, float low, float high) {
    forBox(u0, v0, u1, v1, [&](float& texel, double x, double) {
      texel = low + (high - low) * static_cast<float>((x - u0) / (u1 - u0));
    });
  }
  // Lines of print: words made of strokes.
  void text(double u0, double v0, double u1, double v1, double size, float value, Random& random) {
    for (double v = v0; v + size < v1; v += 1.7 * size) {
      double u = u0;
      const double end = u1 - random.uniform(0.0, 0.3) * (u1 - u0);
      while (u + 0.6 * size < end) {
        if (random.uniform() < 0.17) u += 0.6 * size;  // a space
        if (random.uniform() < 0.7) rectangle(u, v, u + 0.16 * size, v + size, value);
        if (random.uniform() < 0.5) rectangle(u, v, u + 0.55 * size, v + 0.16 * size, value);
        if (random.uniform() < 0.5) rectangle(u, v + 0.84 * size, u + 0.55 * size, v + size, value);
        if (random.uniform() < 0.4) rectangle(u + 0.4 * size, v, u + 0.55 * size, v + size, value);
        u += 0.75 * size;
      }
    }
  }

 private:
  template <typename Paint>
  void forBox(double u0, double v0, double u1, double v1, const Paint& paint) {
    const int x0 = std::max(0, static_cast<int>(std::lround(u0 * scale_)));
    const int y0 = std::max(0, static_cast<int>(std::lround(v0 * scale_)));
    const int x1 = std::min(width_, static_cast<int>(std::lround(u1 * scale_)));
    const int y1 = std::min(height_, static_cast<int>(std::lround(v1 * scale_)));
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        paint(texels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                      static_cast<std::size_t>(x)],
              (x + 0.5) / scale_, (y + 0.5) / scale_);
      }
    }
  }
  std::vector<float>& texels_;
  int width_;
  int height_;
  double scale_;
};

void drawPoster(Canvas& canvas, double w, double h, Random& random) {
  canvas.rectangle(0, 0, w, h, static_cast<float>(random.uniform(0.65, 0.85)));
  const double edge = 0.04 * std::min(w, h);
  const auto ground = static_cast<float>(random.uniform(0.1, 0.7));
  canvas.gradient(edge, edge, w - edge, h - edge, ground, std::clamp(ground + 0.2F, 0.1F, 0.8F));
  const double size = std::min(w, h);
  const int shapes = 12 + static_cast<int>(random.below(25));
  for (int i = 0; i < shapes; ++i) {
    const double s = size * random.uniform(0.08, 0.42) * (i < 8 ? 1.0 : 0.5);
    const double u = random.uniform(edge, std::max(edge, w - edge - s));
    const double v = random.uniform(edge, std::max(edge, h - edge - s));
    const auto value = static_cast<float>(random.uniform(0.04, 0.88));
    const double kind = random.uniform();
    if (kind < 0.35) {
      canvas.rectangle(u, v, u + s, std::min(v + s * random.uniform(0.3, 1.2), h - edge), value);
    } else if (kind < 0.6) {
      canvas.disc(u + 0.5 * s, v + 0.5 * s, 0.5 * s, value);
      if (random.uniform() < 0.5) canvas.disc(u + 0.5 * s, v + 0.5 * s, 0.25 * s, 0.9F - value);
    } else if (kind < 0.85) {
      canvas.text(u, v, std::min(u + 3 * s, w - edge), std::min(v + s, h - edge), random.uniform(0.012, 0.04),
                  value, random);
    } else {
      const double cell = s / 6;
      for (int a = 0; a < 6; ++a) {
        for (int b = 0; b < 6; ++b) {
          const float bit = random.uniform() < 0.5 ? 0.05F : 0.85F;
          canvas.rectangle(u + a * cell, v + b * cell, u + (a + 1) * cell, v + (b + 1) * cell, bit);
        }
      }
    }
  }
}

void drawCarton(Canvas& canvas, double w, double h, Random& random) {
  canvas.rectangle(0.45 * w, 0, 0.45 * w + 0.06, h, static_cast<float>(random.uniform(0.5, 0.65)));  // tape
  const int labels = 2 + static_cast<int>(random.below(4));
  for (int i = 0; i < labels; ++i) {
    const double a = w * random.uniform(0.15, 0.35);
    const double b = h * random.uniform(0.15, 0.35);
    const double u = random.uniform(0.03 * w, 0.95 * w - a);
    const double v = random.uniform(0.03 * h, 0.95 * h - b);
    const float ground = random.uniform() < 0.6 ? 0.8F : 0.12F;
    canvas.rectangle(u, v, u + a, v + b, ground);
    canvas.text(u + 0.08 * a, v + 0.1 * b, u + 0.95 * a, v + 0.95 * b, std::clamp(0.12 * b, 0.008, 0.03),
                0.9F - ground, random);
  }
  canvas.text(0.08 * w, 0.1 * h, 0.8 * w, 0.4 * h, 0.12 * std::min(w, h), 0.12F, random);
  if (random.uniform() < 0.5) canvas.disc(0.8 * w, 0.8 * h, 0.08 * std::min(w, h), 0.1F);
}

// Small objects on plain walls: sockets, switches, notes, shadows of pipes.
void drawWallThings(Canvas& canvas, double w, double h, Random& random) {
  const int things = static_cast<int>(w * h * 0.35);
  for (int i = 0; i < things; ++i) {
    const double u = random.uniform(0.0, w);
    const double v = random.uniform(0.0, h);
    const double s = random.uniform(0.03, 0.12);
    const auto value = static_cast<float>(random.uniform(0.1, 0.85));
    if (random.uniform() < 0.5) {
      canvas.rectangle(u, v, u + s, v + s * random.uniform(0.6, 1.6), value);
      canvas.disc(u + 0.5 * s, v + 0.4 * s, 0.2 * s, 0.95F - value);
    } else {
      canvas.text(u, v, u + 3 * s, v + 2 * s, 0.35 * s, value, random);
    }
  }
}

using PaintFunction = float (*)(const Brush&, float, float);
PaintFunction painterOf(Material material) {
  switch (material) {
    case Material::kPlaster:
      return plaster;
    case Material::kBrick:
      return brick;
    case Material::kTiles:
      return tiles;
    case Material::kParquet:
      return parquet;
    case Material::kWood:
      return wood;
    case Material::kConcrete:
      return concrete;
    case Material::kBooks:
      return books;
    case Material::kPoster:
    case Material::kCarton:
      return carton;
    case Material::kChecker:
      return checker;
    case Material::kMetal:
      return metal;
    case Material::kCarpet:
      return carpet;
    case Material::kFabric:
      return fabric;
    case Material::kLamp:
      break;
  }
  return [](const Brush&, float, float) { return 1.0F; };
}

}  // namespace

std::vector<float> paintPatch(const Patch& patch, int width, int height, double per_metre) {
  std::vector<float> texels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  Random random(patch.paint_seed, 61);
  Brush brush;
  brush.seed = patch.paint_seed;
  brush.shift_x = static_cast<float>(random.uniform(0.0, NoiseTile::kSize));
  brush.shift_y = static_cast<float>(random.uniform(0.0, NoiseTile::kSize));
  const PaintFunction paint = painterOf(patch.material);
  const auto step = static_cast<float>(1.0 / per_metre);
  for (int y = 0; y < height; ++y) {
    float* row = texels.data() + static_cast<std::ptrdiff_t>(y) * width;
    const float v = (static_cast<float>(y) + 0.5F) * step;
    for (int x = 0; x < width; ++x) row[x] = paint(brush, (static_cast<float>(x) + 0.5F) * step, v);
  }
  Canvas canvas(texels, width, height, per_metre);
  if (patch.material == Material::kPoster) drawPoster(canvas, patch.u_length, patch.v_length, random);
  if (patch.material == Material::kCarton) drawCarton(canvas, patch.u_length, patch.v_length, random);
  if (patch.label == Label::kWall && patch.material != Material::kBrick) {
    drawWallThings(canvas, patch.u_length, patch.v_length, random);
  }
  return texels;
}

}  // namespace swiftlet
