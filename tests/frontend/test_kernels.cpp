// Pyramid, corners, alignment and search: against their definition, the scalar twin and OpenCV.

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/frontend/affine_alignment.hpp"
#include "estimator/frontend/affine_sampler.hpp"
#include "estimator/frontend/corners.hpp"
#include "estimator/frontend/lucas_kanade.hpp"
#include "estimator/frontend/search_patch.hpp"
#include "estimator/frontend/warped_patch.hpp"
#include "tests/frontend/synthetic_image.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

Canvas randomImage(int width, int height, std::uint64_t seed) {
  Canvas canvas{width, height, {}};
  Random random(seed);
  for (int i = 0; i < width * height; ++i)
    canvas.pixels.push_back(static_cast<std::uint8_t>(random.below(256)));
  return canvas;
}

}  // namespace

TEST_CASE("pyramid equals OpenCV's pyrDown and has replicated borders") {
  for (const auto& [width, height] : {std::pair{101, 67}, std::pair{128, 96}}) {
    const Canvas image = randomImage(width, height, 3);
    Pyramid pyramid(width, height, 3);
    pyramid.build(image.view());
    REQUIRE(pyramid.levels() == 3);
    for (int level = 1; level < 3; ++level) {
      const ImageView& fine = pyramid.level(level - 1);
      const ImageView& coarse = pyramid.level(level);
      const cv::Mat source(fine.height, fine.width, CV_8U, const_cast<std::uint8_t*>(fine.data),
                           static_cast<std::size_t>(fine.stride));
      cv::Mat expected;
      cv::pyrDown(source.clone(), expected, cv::Size(), cv::BORDER_REPLICATE);
      REQUIRE(coarse.width == expected.cols);
      REQUIRE(coarse.height == expected.rows);
      int differing = 0;
      for (int y = 0; y < coarse.height; ++y) {
        for (int x = 0; x < coarse.width; ++x)
          differing += coarse.row(y)[x] != expected.at<std::uint8_t>(y, x) ? 1 : 0;
      }
      CHECK(differing == 0);
    }
    Pyramid scalar(width, height, 3);
    scalar.build<simd::Scalar>(image.view());
    for (int level = 0; level < 3; ++level) {
      const ImageView& view = pyramid.level(level);
      for (int y = -kPyramidBorder; y < view.height + kPyramidBorder; ++y) {
        const auto bytes = static_cast<std::size_t>(view.width + 2 * kPyramidBorder);
        REQUIRE(std::memcmp(view.row(y) - kPyramidBorder, scalar.level(level).row(y) - kPyramidBorder,
                            bytes) == 0);
      }
    }
    const ImageView& base = pyramid.level(0);
    CHECK(base.row(-kPyramidBorder)[-kPyramidBorder] == image.pixels.front());
    CHECK(base.row(height - 1 + kPyramidBorder)[width - 1 + kPyramidBorder] == image.pixels.back());
    CHECK(base.row(5)[-7] == image.view().row(5)[0]);
  }
}

TEST_CASE("corner scores are OpenCV's smaller eigenvalues, and corners keep their distance") {
  const Texture texture(5);
  const Canvas image = draw(texture, 320, 240, {0, 0}, 2.0);
  Pyramid pyramid(image.width, image.height, 1);
  pyramid.build(image.view());
  CornerDetector detector(image.width, image.height);
  auto corners = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  CornerSettings settings;
  settings.min_distance = 15;
  auto occupied = std::make_unique<CornerDetector::Pixels>();
  REQUIRE(occupied->tryPushBack({100, 100}));
  detector.detect(pyramid.level(0), *occupied, 60, 50, settings, *corners);
  REQUIRE(corners->size() > 30);
  CHECK(corners->size() <= 50);
  auto scalar = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  detector.detect<simd::Scalar>(pyramid.level(0), *occupied, 60, 50, settings, *scalar);
  REQUIRE(scalar->size() == corners->size());
  for (std::size_t i = 0; i < corners->size(); ++i) {
    CHECK((*scalar)[i].pixel == (*corners)[i].pixel);
    CHECK((*scalar)[i].score == (*corners)[i].score);
  }

  cv::Mat expected;
  const cv::Mat source(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
  cv::cornerMinEigenVal(source, expected, 7, 3);
  // OpenCV scales its 8-bit eigenvalues by 1 / (255 * 4 * 7)^2; ours by 1 / (64 * 49).
  const float scale = std::pow(255.0F * 4.0F * 7.0F, 2.0F) / (64.0F * 49.0F);
  for (std::size_t i = 0; i < corners->size(); ++i) {
    const Corner& corner = (*corners)[i];
    const int x = static_cast<int>(corner.pixel.x());
    const int y = static_cast<int>(corner.pixel.y());
    CHECK(corner.score == Approx(expected.at<float>(y, x) * scale).epsilon(0.01));
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        CHECK(expected.at<float>(y + dy, x + dx) <= expected.at<float>(y, x) * 1.001F);
      }
    }
    CHECK((corner.pixel - Eigen::Vector2f(100, 100)).norm() > settings.min_distance - 4);
    for (std::size_t j = 0; j < i; ++j) {
      // The mask's cells are 4 px wide.
      CHECK((corner.pixel - (*corners)[j].pixel).norm() > settings.min_distance - 4);
    }
  }
}

TEST_CASE("no corner is weaker than both thresholds allow, however faint the image") {
  Canvas image = draw(Texture(5), 320, 240, {0, 0}, 2.0);
  // The left half is faint, the right one fainter.
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const int contrast = i % 320 < 160 ? 8 : 32;
    image.pixels[i] = static_cast<std::uint8_t>(100 + image.pixels[i] / contrast);
  }
  Pyramid pyramid(image.width, image.height, 1);
  pyramid.build(image.view());
  CornerDetector detector(image.width, image.height);
  auto corners = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  CornerSettings all;
  all.min_score = all.relative = 0;
  detector.detect(pyramid.level(0), {}, 60, kMaxFeatures, all, *corners);
  REQUIRE(corners->size() > 20);
  const float best = corners->front().score;
  const float middle = (*corners)[corners->size() / 2].score;
  // Either threshold at the middle of the scores, the other far below.
  for (const bool absolute : {true, false}) {
    CornerSettings settings;
    settings.min_score = absolute ? middle : 0;
    settings.relative = absolute ? 0 : middle / best;
    detector.detect(pyramid.level(0), {}, 60, kMaxFeatures, settings, *corners);
    CHECK_FALSE(corners->empty());
    for (const Corner& corner : *corners) CHECK(corner.score >= middle);
  }
}

TEST_CASE("corners come from the whole of a large image") {
  constexpr int kWidth = 4096;
  constexpr int kHeight = 3000;
  // One tile, repeated, with noise, so that no two scores are the same: drawing 12 megapixels takes seconds.
  Random random(3);
  const Canvas tile = draw(Texture(5), 256, 250);
  Canvas image{kWidth, kHeight, std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight)};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int grey = tile.pixels[static_cast<std::size_t>(y % 250 * 256 + x % 256)] / 2;
      image.pixels[static_cast<std::size_t>(y * kWidth + x)] =
          static_cast<std::uint8_t>(grey + static_cast<int>(random.below(16)));
    }
  }
  Pyramid pyramid(kWidth, kHeight, 1);
  pyramid.build(image.view());
  CornerDetector detector(kWidth, kHeight);
  auto corners = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  detector.detect(pyramid.level(0), {}, 200, 200, {}, *corners);
  auto scalar = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  detector.detect<simd::Scalar>(pyramid.level(0), {}, 200, 200, {}, *scalar);
  REQUIRE(corners->size() == 200);
  REQUIRE(scalar->size() == corners->size());
  std::array<int, 3> in_third{};
  for (std::size_t i = 0; i < corners->size(); ++i) {
    CHECK((*scalar)[i].pixel == (*corners)[i].pixel);
    ++in_third[static_cast<std::size_t>((*corners)[i].pixel.y() / (kHeight / 3.0F))];
  }
  for (const int count : in_third) CHECK(count > 40);
}

TEST_CASE("no corners on a flat image or along a straight edge") {
  Canvas image{200, 160, std::vector<std::uint8_t>(200 * 160, 90)};
  for (int y = 0; y < 160; ++y) {
    for (int x = 100; x < 200; ++x) image.pixels[static_cast<std::size_t>(y * 200 + x)] = 180;
  }
  Pyramid pyramid(200, 160, 1);
  pyramid.build(image.view());
  CornerDetector detector(200, 160);
  auto corners = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  detector.detect(pyramid.level(0), {}, 50, 50, {}, *corners);
  CHECK(corners->empty());
}

TEST_CASE("alignment: vector and scalar code agree to the bit") {
  const Canvas a = draw(Texture(8), 120, 120, {0, 0}, 2.0, 1);
  const Canvas b = draw(Texture(8), 120, 120, {1.3, -0.8}, 2.0, 2);
  Pyramid first(120, 120, 1);
  Pyramid second(120, 120, 1);
  first.build(a.view());
  second.build(b.view());
  int compared = 0;
  for (int y = 20; y < 100; y += 9) {
    for (int x = 20; x < 100; x += 9) {
      PatchTemplate native;
      PatchTemplate scalar;
      const ImageView& image = first.level(0);
      REQUIRE(native.build(image.row(y) + x, image.stride) ==
              scalar.build<simd::Scalar>(image.row(y) + x, image.stride));
      Eigen::Vector2f p(static_cast<float>(x), static_cast<float>(y));
      Eigen::Vector2f q = p;
      const bool found = native.align(second.level(0), {}, PatchTemplate::Finish::kFine, p);
      REQUIRE(found == scalar.align<simd::Scalar>(second.level(0), {}, PatchTemplate::Finish::kFine, q));
      CHECK(p.x() == q.x());
      CHECK(p.y() == q.y());
      compared += found ? 1 : 0;
      SearchPatch search;
      REQUIRE(search.build(image.row(y) + x, image.stride));
      CHECK(search.correlation(second.level(0), x, y) ==
            search.correlation<simd::Scalar>(second.level(0), x, y));
    }
  }
  CHECK(compared > 60);
}

TEST_CASE("tracking finds known sub-pixel shifts, with gain and offset") {
  const Texture texture(21);
  const int width = 320;
  const int height = 240;
  Random random(4);
  for (int trial = 0; trial < 4; ++trial) {
    const Eigen::Vector2d shift(random.uniform(-9, 9), random.uniform(-9, 9));
    const Canvas a = draw(texture, width, height, {0, 0}, 1.0, 1);
    const Canvas b = draw(texture, width, height, Eigen::Matrix2d::Identity(), shift, 1.0, 2,
                          trial % 2 == 0 ? 1.0 : 0.7, 12);
    Pyramid first(width, height, 4);
    Pyramid second(width, height, 4);
    first.build(a.view());
    second.build(b.view());
    std::vector<double> errors;
    for (int y = 30; y < height - 30; y += 17) {
      for (int x = 30; x < width - 30; x += 17) {
        const Eigen::Vector2f from(static_cast<float>(x) + 0.3F, static_cast<float>(y) - 0.4F);
        Eigen::Vector2f to = from;
        if (!trackPoint(first, from, second, {}, to)) continue;
        errors.push_back((to.cast<double>() - from.cast<double>() - shift).norm());
      }
    }
    REQUIRE(errors.size() > 120);
    std::sort(errors.begin(), errors.end());
    CHECK(errors[errors.size() / 2] < 0.03);
    CHECK(errors[errors.size() * 95 / 100] < 0.1);
  }
}

TEST_CASE("tracking refuses flat patches, image borders and unrelated images") {
  const Canvas flat{100, 100, std::vector<std::uint8_t>(10000, 100)};
  Pyramid first(100, 100, 3);
  Pyramid second(100, 100, 3);
  first.build(flat.view());
  second.build(flat.view());
  Eigen::Vector2f to(50, 50);
  CHECK_FALSE(trackPoint(first, {50, 50}, second, {}, to));

  const Canvas a = draw(Texture(1), 200, 200);
  Pyramid third(200, 200, 3);
  Pyramid fourth(200, 200, 3);
  third.build(a.view());
  fourth.build(a.view());
  to = {3, 100};
  CHECK_FALSE(trackPoint(third, {3, 100}, fourth, {}, to));
  to = {std::nanf(""), 100};
  CHECK_FALSE(trackPoint(third, {100, 100}, fourth, {}, to));

  const Canvas b = draw(Texture(2), 200, 200);
  fourth.build(b.view());
  int tried = 0;
  int found = 0;
  for (int y = 20; y < 180; y += 10) {
    for (int x = 20; x < 180; x += 10, ++tried) {
      to = {static_cast<float>(x), static_cast<float>(y)};
      found += trackPoint(third, to, fourth, {}, to) ? 1 : 0;
    }
  }
  CHECK(found < tried / 5);
}

TEST_CASE("affine alignment recovers warp, position and brightness") {
  const Texture texture(33);
  Random random(7);
  int tried = 0;
  int good = 0;
  for (int trial = 0; trial < 12; ++trial) {
    Eigen::Matrix2d A;
    A << 1 + random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2),
        1 + random.uniform(-0.2, 0.2);
    const Eigen::Vector2d t(random.uniform(20, 30), random.uniform(20, 30));
    const Canvas a = draw(texture, 80, 80, {0, 0}, 1.0, 1);
    const Canvas b = draw(texture, 160, 160, A, t, 1.0, 2, 0.8, 10);
    for (int k = 0; k < 6; ++k, ++tried) {
      const int x = 25 + static_cast<int>(random.below(30));
      const int y = 25 + static_cast<int>(random.below(30));
      AffineTemplate pattern;
      if (!pattern.build(a.view(), x, y)) continue;
      const Eigen::Vector2d truth = A * Eigen::Vector2d(x, y) + t;
      AffineTemplate::Estimate estimate;
      estimate.position = (truth + Eigen::Vector2d(0.5, -0.4)).cast<float>();
      // The start is off by what a few frames change.
      estimate.warp = (A + 0.06 * Eigen::Matrix2d::Random()).cast<float>();
      if (!pattern.align(a.view(), x, y, b.view(), 10, estimate)) continue;
      const double error = (estimate.position.cast<double>() - truth).norm();
      good += error < 0.08 && (estimate.warp.cast<double>() - A).norm() < 0.1 && estimate.correlation > 0.95F
                  ? 1
                  : 0;
    }
  }
  CHECK(good > tried * 9 / 10);
}

TEST_CASE(
    "sampling through an affine map: vector and scalar code agree to the bit, and with the definition") {
  const Canvas image = draw(Texture(34), 128, 128, {0, 0}, 2.0, 1);
  Random random(8);
  int compared = 0;
  double worst = 0;
  for (int trial = 0; trial < 300; ++trial) {
    // From small changes to turns of any angle and scales of a half to two.
    const double size = trial % 3 == 0 ? 0.1 : 1.0;
    const double angle = size * random.uniform(-3.1, 3.1);
    const double scale = std::exp(size * random.uniform(-0.7, 0.65));
    Eigen::Matrix2d A = scale * Eigen::Rotation2Dd(angle).toRotationMatrix();
    A(0, 1) += size * random.uniform(-0.2, 0.2);
    const Eigen::Matrix2f warp = A.cast<float>();
    const Eigen::Vector2f centre(static_cast<float>(random.uniform(36, 90)),
                                 static_cast<float>(random.uniform(36, 90)));
    AffineSampler<simd::Native> native;
    AffineSampler<simd::Scalar> scalar;
    const bool fits = native.prepare(warp, kPatchRadius);
    REQUIRE(fits == scalar.prepare(warp, kPatchRadius));
    if (!fits) continue;
    for (int r = -kPatchRadius; r <= kPatchRadius; ++r) {
      std::array<std::int16_t, 16> a{};
      std::array<std::int16_t, 16> b{};
      simd::Native::store(a.data(), native.sample(image.view(), centre, r));
      simd::Scalar::store(b.data(), scalar.sample(image.view(), centre, r));
      for (int c = 0; c < kPatchSize; ++c) {
        const auto lane = static_cast<std::size_t>(c);
        REQUIRE(a[lane] == b[lane]);
        const Eigen::Vector2f p =
            centre + warp * Eigen::Vector2f(static_cast<float>(c - kPatchRadius), static_cast<float>(r));
        const auto x = static_cast<int>(std::floor(p.x()));
        const auto y = static_cast<int>(std::floor(p.y()));
        const double u = static_cast<double>(p.x()) - x;
        const double v = static_cast<double>(p.y()) - y;
        const std::uint8_t* row = image.view().row(y) + x;
        const std::uint8_t* below = row + image.view().stride;
        const double expected =
            (1 - v) * ((1 - u) * row[0] + u * row[1]) + v * ((1 - u) * below[0] + u * below[1]);
        worst = std::max(worst, std::abs(a[lane] / 128.0 - expected));
      }
    }
    ++compared;
  }
  CHECK(compared > 200);
  // Places are off by up to 1/700 px, on slopes of up to 60 grey per px.
  CHECK(worst < 0.2);
}

TEST_CASE("sampling a window that is hardly turned: both codes agree to the bit, and with the definition") {
  const Canvas image = draw(Texture(34), 128, 128, {0, 0}, 2.0, 1);
  Random random(8);
  constexpr auto kLanes = static_cast<std::size_t>(kPatchLanes);
  int compared = 0;
  double worst = 0;
  for (int trial = 0; trial < 300; ++trial) {
    // Every other one as between neighbouring images.
    const double size = trial % 2 == 0 ? 0.1 : 1.0;
    Eigen::Matrix2d A = std::exp(size * random.uniform(-0.6, 0.55)) *
                        Eigen::Rotation2Dd(size * random.uniform(-0.4, 0.4)).toRotationMatrix();
    A(0, 1) += size * random.uniform(-0.1, 0.1);
    const Eigen::Matrix2f warp = A.cast<float>();
    const Eigen::Vector2f centre(static_cast<float>(random.uniform(36, 90)),
                                 static_cast<float>(random.uniform(36, 90)));
    std::array<std::int16_t, kPatchSize * kLanes> a{};
    std::array<std::int16_t, kPatchSize * kLanes> b{};
    const bool fits =
        UprightSampler<simd::Native>().sample(image.view(), centre, warp, kPatchRadius, a.data());
    REQUIRE(fits ==
            UprightSampler<simd::Scalar>().sample(image.view(), centre, warp, kPatchRadius, b.data()));
    if (!fits) continue;
    const double slant = static_cast<double>(warp(0, 1)) / static_cast<double>(warp(1, 1));
    for (int r = 0; r < kPatchSize; ++r) {
      for (int c = 0; c < kPatchSize; ++c) {
        const std::size_t at = static_cast<std::size_t>(r) * kLanes + static_cast<std::size_t>(c);
        REQUIRE(a[at] == b[at]);
        const Eigen::Vector2d p = (centre + warp * Eigen::Vector2f(static_cast<float>(c - kPatchRadius),
                                                                   static_cast<float>(r - kPatchRadius)))
                                      .cast<double>();
        const auto y = static_cast<int>(std::floor(p.y()));
        const double v = p.y() - y;
        // An image row is read where the window's column crosses it.
        const auto crossing = [&](int row, double x) {
          const auto left = static_cast<int>(std::floor(x));
          const std::uint8_t* pixel = image.view().row(row) + left;
          return pixel[0] + (x - left) * (pixel[1] - pixel[0]);
        };
        const double expected =
            (1 - v) * crossing(y, p.x() - v * slant) + v * crossing(y + 1, p.x() + (1 - v) * slant);
        worst = std::max(worst, std::abs(a[at] / 128.0 - expected));
      }
    }
    ++compared;
  }
  CHECK(compared > 200);
  // Places are off by up to 1/700 px, on slopes of up to 60 grey per px.
  CHECK(worst < 0.2);
}

TEST_CASE("affine alignment: vector and scalar code agree to the bit") {
  const Canvas a = draw(Texture(9), 120, 120, {0, 0}, 2.0, 1);
  Eigen::Matrix2d A;
  A << 1.05, 0.08, -0.06, 0.97;
  const Eigen::Vector2d t(2, 3);
  const Canvas b = draw(Texture(9), 130, 130, A, t, 2.0, 2, 0.9, 8);
  int compared = 0;
  for (int y = 20; y < 100; y += 9) {
    for (int x = 20; x < 100; x += 9) {
      AffineTemplate pattern;
      if (!pattern.build(a.view(), x, y)) continue;
      AffineTemplate::Estimate p{(A * Eigen::Vector2d(x, y) + t).cast<float>(), Eigen::Matrix2f::Identity(),
                                 0};
      AffineTemplate::Estimate q = p;
      const bool found = pattern.align(a.view(), x, y, b.view(), 3, p);
      REQUIRE(found == pattern.align<simd::Scalar>(a.view(), x, y, b.view(), 3, q));
      CHECK(p.position == q.position);
      CHECK(p.warp == q.warp);
      CHECK(p.correlation == q.correlation);
      WarpedPatch native;
      WarpedPatch scalar;
      REQUIRE(native.sample(b.view(), p.position, p.warp));
      REQUIRE(scalar.sample<simd::Scalar>(b.view(), p.position, p.warp));
      CHECK(std::memcmp(native.centre() - 7, scalar.centre() - 7, 15) == 0);
      compared += found ? 1 : 0;
    }
  }
  CHECK(compared > 60);
}

TEST_CASE("warped patches are refused outside of their source") {
  const Canvas a = draw(Texture(1), 32, 32);
  WarpedPatch patch;
  CHECK(patch.sample(a.view(), {16, 16}, Eigen::Matrix2f::Identity()));
  CHECK(*patch.centre() == a.view().row(16)[16]);
  CHECK_FALSE(patch.sample(a.view(), {5, 16}, Eigen::Matrix2f::Identity()));
  CHECK_FALSE(patch.sample(a.view(), {16, 16}, 3 * Eigen::Matrix2f::Identity()));
  CHECK_FALSE(patch.sample(a.view(), {std::nanf(""), 16}, Eigen::Matrix2f::Identity()));
}
