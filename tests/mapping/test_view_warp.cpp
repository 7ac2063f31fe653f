// Labels and grey values of one camera at the pixels of another: beside the projection, pixel by pixel.

#include "mapping/map/view_warp.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

using namespace swiftlet;

namespace {

CameraModel bentCamera() {
  return CameraModel(CameraKind::kPinholeRadtan, 80, 60, {55, 54, 40.2, 29.1},
                     {-0.28, 0.07, 0.0002, 0.00002});
}

/// Each pixel has a value of its own, as far as 8 bits go.
std::vector<std::uint8_t> numbered(int width, int height) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels.push_back(static_cast<std::uint8_t>(1 + (7 * x + 13 * y) % 255));
  }
  return pixels;
}

ImageView viewOf(const std::vector<std::uint8_t>& pixels, int width, int height) {
  return {pixels.data(), width, height, width};
}

}  // namespace

TEST_CASE("the same pinhole camera gives the same image") {
  const PinholeIntrinsics pinhole{50, 50, 39.5, 29.5, 80, 60};
  const CameraModel other(CameraKind::kPinholeRadtan, 80, 60, {50, 50, 39.5, 29.5}, {0, 0, 0, 0});
  const std::vector<std::uint8_t> image = numbered(80, 60);
  std::vector<std::uint8_t> out(pinhole.pixels());
  REQUIRE(ViewWarp(pinhole, other, SE3()).apply(viewOf(image, 80, 60), nullptr, out.data()).ok());
  CHECK(out == image);
}

TEST_CASE("each pixel gets what the other camera shows along its ray, with a table and over the depth") {
  const PinholeIntrinsics pinhole{60, 60, 49.5, 34.5, 100, 70};
  const CameraModel other = bentCamera();
  const std::vector<std::uint8_t> image = numbered(80, 60);
  std::vector<float> depth(pinhole.pixels());
  for (std::size_t i = 0; i < depth.size(); ++i)
    depth[i] = i % 11 == 0 ? 0.0F : 0.5F + 0.001F * static_cast<float>(i);
  for (const double apart : {0.0, 0.07}) {
    const SE3 T_other_depth(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY())),
                            Eigen::Vector3d(apart, 0, 0.01 * apart));
    const ViewWarp warp(pinhole, other, T_other_depth);
    std::vector<std::uint8_t> out(pinhole.pixels(), 99);
    REQUIRE(warp.apply(viewOf(image, 80, 60), depth.data(), out.data()).ok());
    int seen = 0;
    for (int y = 0; y < pinhole.height; ++y) {
      for (int x = 0; x < pinhole.width; ++x) {
        const auto i = static_cast<std::size_t>(y * pinhole.width + x);
        const double z = apart > 0 ? static_cast<double>(depth[i]) : 1.0;
        Eigen::Vector2d pixel;
        const Eigen::Vector3d p = z * Eigen::Vector3d((x - 49.5) / 60, (y - 34.5) / 60, 1);
        const bool there = z > 0 && other.project(T_other_depth * p, pixel) && other.inImage(pixel);
        if (!there) {
          if (z == 0) REQUIRE(out[i] == 0);
          continue;
        }
        const auto u = static_cast<std::size_t>(std::lround(pixel.x()));
        const auto v = static_cast<std::size_t>(std::lround(pixel.y()));
        REQUIRE(out[i] == image[v * 80 + u]);
        ++seen;
      }
    }
    CHECK(seen > 2000);
  }
}

TEST_CASE("an image of another size is refused") {
  const ViewWarp warp({50, 50, 39.5, 29.5, 80, 60}, bentCamera(), SE3());
  const std::vector<std::uint8_t> image = numbered(81, 60);
  std::vector<std::uint8_t> out(80 * 60, 3);
  CHECK_FALSE(warp.apply(viewOf(image, 81, 60), nullptr, out.data()).ok());
  CHECK_FALSE(warp.apply({}, nullptr, out.data()).ok());
  CHECK(out[17] == 3);
}
