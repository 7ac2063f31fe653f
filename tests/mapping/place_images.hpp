#pragma once
// Pictures with corners for the tests of place recognition: grey polygons on top of each other, seen from
// where one wants.

#include <cstdint>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet::testing {

struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
};

/// Squares of all sizes and directions, some noise; the same seed gives the same scene. The picture is the
/// scene turned by `turn` [rad] about its centre and moved by (dx, dy) [px].
inline Picture makePicture(int width, int height, std::uint64_t seed, double turn = 0, double dx = 0,
                           double dy = 0, double scale = 1, double noise = 2) {
  struct Square {
    double x, y, half, c, s;
    std::uint8_t grey;
  };
  Random random(seed);
  std::vector<Square> squares(260);
  for (Square& q : squares) {
    const double angle = random.uniform(0, 6.28);
    q = {random.uniform(-0.3, 1.3) * width,
         random.uniform(-0.3, 1.3) * height,
         random.uniform(6, 45),
         std::cos(angle),
         std::sin(angle),
         static_cast<std::uint8_t>(random.below(256))};
  }
  Picture picture{width, height, {}};
  picture.pixels.assign(static_cast<std::size_t>(width * height), 100);
  Random grain(seed, 9);
  const double c = std::cos(turn), s = std::sin(turn);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double px = x - 0.5 * width - dx, py = y - 0.5 * height - dy;
      const double u = (c * px + s * py) / scale + 0.5 * width, v = (-s * px + c * py) / scale + 0.5 * height;
      double grey = 100;
      for (const Square& q : squares) {
        const double a = q.c * (u - q.x) + q.s * (v - q.y), b = -q.s * (u - q.x) + q.c * (v - q.y);
        if (a > -q.half && a < q.half && b > -q.half && b < q.half) grey = q.grey;
      }
      grey += noise * grain.normal();
      picture.pixels[static_cast<std::size_t>(y * width + x)] =
          static_cast<std::uint8_t>(grey < 0     ? 0
                                    : grey > 255 ? 255
                                                 : grey);
    }
  }
  return picture;
}

/// A camera without distortion.
inline CameraModel pinhole(int width, int height) {
  return {CameraKind::kPinholeRadtan, width, height, Eigen::Vector4d(400, 400, 0.5 * width, 0.5 * height),
          Eigen::Vector4d::Zero()};
}

}  // namespace swiftlet::testing
