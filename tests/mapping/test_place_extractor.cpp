// Corners, descriptors and what a keyframe is given.

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>
#include <opencv2/features2d.hpp>

#include "mapping/place/fast_score.hpp"
#include "mapping/place/hamming.hpp"
#include "mapping/place/place_extractor.hpp"
#include "tests/mapping/place_images.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr int kWidth = 320, kHeight = 240;

std::unique_ptr<PlaceKeyframe> extract(const Picture& picture, const PlaceExtractorSettings& settings = {},
                                       const TrackedFrame& tracked = {}) {
  PlaceExtractor extractor(picture.width, picture.height, settings);
  auto keyframe = std::make_unique<PlaceKeyframe>();
  REQUIRE(extractor.extract(picture.view(), pinhole(picture.width, picture.height), tracked, *keyframe).ok());
  return keyframe;
}

bool sameFeatures(const PlaceKeyframe& a, const PlaceKeyframe& b) {
  if (a.features.size() != b.features.size()) return false;
  for (std::size_t i = 0; i < a.features.size(); ++i) {
    if (!(a.features[i].descriptor == b.features[i].descriptor) || a.features[i].pixel != b.features[i].pixel)
      return false;
  }
  return true;
}

}  // namespace

TEST_CASE("FAST's scores are the scalar twin's and OpenCV's") {
  const Picture picture = makePicture(kWidth, kHeight, 3);
  // Rows of the picture with room for whole vectors after the last.
  std::vector<std::uint8_t> image = picture.pixels;
  image.resize(image.size() + kFastScoreOverrun, 0);
  std::vector<std::uint8_t> native(image.size() + kFastScoreOverrun, 0), scalar(native);
  constexpr std::uint8_t kLeast = 9;
  for (int y = 3; y < kHeight - 3; ++y) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * kWidth;
    fastScoreRow<byte_lanes::Native>(image.data() + at, kWidth, 3, kWidth - 3, kLeast, native.data() + at);
    fastScoreRow<byte_lanes::Scalar>(image.data() + at, kWidth, 3, kWidth - 3, kLeast, scalar.data() + at);
  }
  const cv::Mat grey(kHeight, kWidth, CV_8U, image.data());
  std::vector<cv::KeyPoint> points;
  cv::FAST(grey, points, kLeast, false, cv::FastFeatureDetector::TYPE_9_16);
  std::vector<bool> corner(image.size(), false);
  for (const cv::KeyPoint& p : points) {
    corner[static_cast<std::size_t>(cvRound(p.pt.y) * kWidth + cvRound(p.pt.x))] = true;
  }
  std::size_t differ = 0, corners = 0;
  for (int y = 3; y < kHeight - 3; ++y) {
    for (int x = 3; x < kWidth - 3; ++x) {
      const auto i = static_cast<std::size_t>(y * kWidth + x);
      const bool ours = native[i] > kLeast;
      if (ours != (scalar[i] > kLeast) || (ours && native[i] != scalar[i]) || ours != corner[i]) ++differ;
      corners += ours ? 1U : 0U;
    }
  }
  CHECK(corners > 500);
  CHECK(differ == 0);
}

TEST_CASE("The native kernels give the scalar twin's keyframe, twice the same") {
  const Picture picture = makePicture(kWidth, kHeight, 4);
  PlaceExtractor extractor(kWidth, kHeight);
  auto native = std::make_unique<PlaceKeyframe>();
  auto scalar = std::make_unique<PlaceKeyframe>();
  auto again = std::make_unique<PlaceKeyframe>();
  const TrackedFrame none;
  const CameraModel camera = pinhole(kWidth, kHeight);
  REQUIRE(extractor.extract<byte_lanes::Native>(picture.view(), camera, none, *native).ok());
  REQUIRE(extractor.extract<byte_lanes::Scalar>(picture.view(), camera, none, *scalar).ok());
  const Picture other = makePicture(kWidth, kHeight, 5);
  REQUIRE(extractor.extract(other.view(), camera, none, *again).ok());
  CHECK_FALSE(sameFeatures(*native, *again));
  REQUIRE(extractor.extract(picture.view(), camera, none, *again).ok());
  CHECK(native->features.size() > 200);
  CHECK(sameFeatures(*native, *scalar));
  CHECK(sameFeatures(*native, *again));
}

TEST_CASE("Features cover the image and carry bearings") {
  const auto keyframe = extract(makePicture(640, 480, 6));
  CHECK(keyframe->features.size() == 400);
  std::array<int, 16> cell{};
  const CameraModel camera = pinhole(640, 480);
  for (const PlaceFeature& f : keyframe->features) {
    ++cell[static_cast<std::size_t>(static_cast<int>(f.pixel.y()) / 120 * 4 +
                                    static_cast<int>(f.pixel.x()) / 160)];
    CHECK(std::abs(f.bearing.norm() - 1) < 1e-5F);
    Eigen::Vector2d pixel;
    REQUIRE(camera.project(f.bearing.cast<double>(), pixel));
    CHECK((pixel - f.pixel.cast<double>()).norm() < 1e-2);
    CHECK(f.inverse_depth == 0);
    CHECK_FALSE(f.has_landmark);
  }
  CHECK(*std::min_element(cell.begin(), cell.end()) >= 4);
}

TEST_CASE("Descriptors survive turning, moving, scaling and noise as OpenCV's ORB does") {
  const Picture first = makePicture(kWidth, kHeight, 7);
  // Of each other's nearest matches: how many lie where the motion takes them.
  const auto count = [&](const auto& pixels_a, const auto& bits_a, const auto& pixels_b, const auto& bits_b,
                         double turn, double scale) {
    const auto nearest = [](const Descriptor& d, const auto& all) {
      std::size_t best = 0;
      for (std::size_t i = 1; i < all.size(); ++i) {
        if (hammingDistance(d, all[i]) < hammingDistance(d, all[best])) best = i;
      }
      return best;
    };
    int right = 0;
    const Eigen::Rotation2Dd rotation(turn);
    const Eigen::Vector2d centre(0.5 * kWidth, 0.5 * kHeight);
    for (std::size_t i = 0; i < bits_a.size(); ++i) {
      const std::size_t j = nearest(bits_a[i], bits_b);
      if (nearest(bits_b[j], bits_a) != i) continue;
      const Eigen::Vector2d to =
          scale * (rotation * (pixels_a[i] - centre)) + centre + Eigen::Vector2d(6, -4);
      right += (to - pixels_b[j]).norm() < 4 ? 1 : 0;
    }
    return right;
  };
  const auto ours = [&](const Picture& picture, std::vector<Eigen::Vector2d>& pixels,
                        std::vector<Descriptor>& bits) {
    const auto keyframe = extract(picture);
    for (const PlaceFeature& f : keyframe->features) {
      pixels.push_back(f.pixel.cast<double>());
      bits.push_back(f.descriptor);
    }
  };
  const auto theirs = [&](const Picture& picture, std::vector<Eigen::Vector2d>& pixels,
                          std::vector<Descriptor>& bits) {
    const cv::Mat grey(picture.height, picture.width, CV_8U,
                       const_cast<std::uint8_t*>(picture.pixels.data()));
    std::vector<cv::KeyPoint> points;
    cv::Mat rows;
    const auto orb = cv::ORB::create(400, 1.2F, 8, 19);
    orb->detectAndCompute(grey, cv::noArray(), points, rows);
    for (std::size_t i = 0; i < points.size(); ++i) {
      pixels.push_back({points[i].pt.x, points[i].pt.y});
      Descriptor d;
      std::memcpy(d.words.data(), rows.ptr(static_cast<int>(i)), 32);
      bits.push_back(d);
    }
  };
  std::vector<Eigen::Vector2d> pixels_a, orb_pixels_a;
  std::vector<Descriptor> bits_a, orb_bits_a;
  ours(first, pixels_a, bits_a);
  theirs(first, orb_pixels_a, orb_bits_a);
  for (const auto& [turn, scale] : {std::pair{0.0, 1.0}, {0.6, 1.0}, {std::numbers::pi, 1.0}, {0.3, 1.25}}) {
    const Picture second = makePicture(kWidth, kHeight, 7, turn, 6, -4, scale, 4);
    std::vector<Eigen::Vector2d> pixels_b, orb_pixels_b;
    std::vector<Descriptor> bits_b, orb_bits_b;
    ours(second, pixels_b, bits_b);
    theirs(second, orb_pixels_b, orb_bits_b);
    const int our_right = count(pixels_a, bits_a, pixels_b, bits_b, turn, scale);
    const int orb_right = count(orb_pixels_a, orb_bits_a, orb_pixels_b, orb_bits_b, turn, scale);
    INFO("turn " << turn << " scale " << scale << ": ours " << our_right << ", OpenCV's ORB " << orb_right);
    CHECK(our_right > 60);
    CHECK(our_right >= 0.7 * orb_right);
  }
}

TEST_CASE("Tracked features come first, with the odometry's pixels and names") {
  const Picture picture = makePicture(kWidth, kHeight, 8);
  TrackedFrame tracked;
  tracked.index = 77;
  tracked.stamp = Stamp{123};
  const auto track = [&](TrackId id, float x, float y, bool seen) {
    TrackedFeature f;
    f.pixel.fill(Eigen::Vector2f::Zero());
    f.id = id;
    f.seen[0] = seen;
    f.pixel[0] = {x, y};
    REQUIRE(tracked.features.tryPushBack(f));
  };
  track(5, 100.4F, 90.3F, true);
  track(6, 200, 120, false);  // camera 1 alone
  track(7, 3, 3, true);       // its patch leaves the image
  track(8, std::nanf(""), 40, true);
  track(9, 150.5F, 130.25F, true);
  const auto keyframe = extract(picture, {}, tracked);
  CHECK(keyframe->index == 77);
  CHECK(keyframe->stamp == Stamp{123});
  REQUIRE(keyframe->features.size() > 100);
  CHECK(keyframe->features[0].landmark == 5);
  CHECK(keyframe->features[0].pixel == Eigen::Vector2f(100.4F, 90.3F));
  CHECK(keyframe->features[1].landmark == 9);
  CHECK(std::count_if(keyframe->features.begin(), keyframe->features.end(),
                      [](const PlaceFeature& f) { return f.has_landmark; }) == 2);
  // A detected corner given as a track is not described twice.
  TrackedFrame corner;
  TrackedFeature f;
  f.pixel.fill(Eigen::Vector2f::Zero());
  f.seen[0] = true;
  const auto plain = extract(picture);
  const auto base = std::find_if(plain->features.begin(), plain->features.end(),
                                 [](const PlaceFeature& p) { return p.octave == 0; });
  REQUIRE(base != plain->features.end());
  f.pixel[0] = base->pixel;
  REQUIRE(corner.features.tryPushBack(f));
  const auto with = extract(picture, {}, corner);
  const auto octave = with->features[0].octave;
  CHECK(std::count_if(with->features.begin(), with->features.end(), [&](const PlaceFeature& p) {
          return p.octave == octave && (p.pixel - base->pixel).norm() < 2.5F;
        }) == 1);
}

TEST_CASE("What cannot be described is said") {
  const Picture picture = makePicture(kWidth, kHeight, 9);
  PlaceExtractor extractor(kWidth, kHeight);
  const TrackedFrame none;
  auto keyframe = std::make_unique<PlaceKeyframe>();
  const CameraModel camera = pinhole(kWidth, kHeight);
  const ImageView smaller{picture.pixels.data(), kWidth - 1, kHeight, kWidth};
  CHECK(extractor.extract(smaller, camera, none, *keyframe).code == StatusCode::kInvalidInput);
  CHECK(extractor.extract({}, camera, none, *keyframe).code == StatusCode::kInvalidInput);
  Picture flat = picture;
  std::fill(flat.pixels.begin(), flat.pixels.end(), std::uint8_t{128});
  CHECK(extractor.extract(flat.view(), camera, none, *keyframe).code == StatusCode::kDegenerate);
  CHECK(keyframe->features.empty());
  // An image too small for any patch.
  PlaceExtractor tiny(30, 30);
  const Picture small = makePicture(30, 30, 1);
  CHECK(tiny.extract(small.view(), pinhole(30, 30), none, *keyframe).code == StatusCode::kDegenerate);
}
