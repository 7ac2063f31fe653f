#pragma once
// Images whose value at any point is known: sums of random sinusoids, so that a shifted or
// warped view can be drawn exactly, without resampling.

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet::testing {

class Texture {
 public:
  explicit Texture(std::uint64_t seed, int waves = 60) {
    Random random(seed);
    for (int i = 0; i < waves; ++i) {
      // Wave lengths of 7 to 60 px: fine enough for corners, coarse enough for bilinear sampling.
      const double k = 1 / std::exp(random.uniform(std::log(7.0), std::log(60.0)));
      const double angle = random.uniform(0, 6.28318);
      wave_.push_back({k * std::cos(angle), k * std::sin(angle), random.uniform(0, 1)});
    }
  }
  [[nodiscard]] double at(double x, double y) const {
    double sum = 0;
    for (const Eigen::Vector3d& w : wave_) sum += sine(w.x() * x + w.y() * y + w.z());
    return std::clamp(128 + 100 * sum / std::sqrt(static_cast<double>(wave_.size())) * 0.7, 0.0, 255.0);
  }

 private:
  // Sine of `turns` by table and interpolation (error below 1e-6): drawing would take seconds else.
  static double sine(double turns) {
    static const std::vector<double> table = [] {
      std::vector<double> t;
      for (int i = 0; i <= kTable; ++i) t.push_back(std::sin(2 * 3.14159265358979 * i / kTable));
      return t;
    }();
    const double at = (turns - std::floor(turns)) * kTable;
    const auto i = static_cast<std::size_t>(std::min(static_cast<int>(at), kTable - 1));
    return table[i] + (at - static_cast<double>(i)) * (table[i + 1] - table[i]);
  }

  static constexpr int kTable = 4096;
  std::vector<Eigen::Vector3d> wave_;  ///< cycles per px in x and y, phase in turns
};

struct Canvas {
  int width;
  int height;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
};

/// Draws gain * texture(A^-1 (x - t)) + offset + noise: texture point p appears at A p + t.
inline Canvas draw(const Texture& texture, int width, int height, const Eigen::Matrix2d& A,
                   const Eigen::Vector2d& t, double noise = 0, std::uint64_t seed = 1, double gain = 1,
                   double offset = 0) {
  Canvas canvas{width, height, {}};
  // Kernels read whole vectors, past the last pixel they use.
  constexpr std::size_t kReadPast = 32;
  canvas.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) + kReadPast);
  Random random(seed);
  const Eigen::Matrix2d inverse = A.inverse();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d p = inverse * (Eigen::Vector2d(x, y) - t);
      const double v = gain * texture.at(p.x(), p.y()) + offset + (noise > 0 ? noise * random.normal() : 0);
      canvas.pixels[static_cast<std::size_t>(y * width + x)] =
          static_cast<std::uint8_t>(std::clamp(v + 0.5, 0.0, 255.0));
    }
  }
  return canvas;
}

inline Canvas draw(const Texture& texture, int width, int height, const Eigen::Vector2d& shift = {0, 0},
                   double noise = 0, std::uint64_t seed = 1) {
  return draw(texture, width, height, Eigen::Matrix2d::Identity(), shift, noise, seed);
}

}  // namespace swiftlet::testing
