// Depths of features: from a rendered stereo pair with known depth, and from landmarks.
#include "mapping/place/feature_depth.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "tests/mapping/loop_scene.hpp"

using namespace swiftlet;              // NOLINT(google-build-using-namespace)
using namespace swiftlet::loop_scene;  // NOLINT(google-build-using-namespace)

namespace {

// A wall in front of the rig, z = distance + slope x in camera 0, with a texture that never repeats.
struct Wall {
  double distance = 3;
  double slope = 0.3;

  static double grey(double x, double y) {
    return 128 + 35 * std::sin(19 * x + 3 * std::sin(7 * y)) + 35 * std::sin(23 * y + 2 * std::sin(11 * x)) +
           25 * std::sin(41 * x * y + 5 * x);
  }
  [[nodiscard]] double depthAlong(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) const {
    return (distance + slope * origin.x() - origin.z()) / (ray.z() - slope * ray.x());
  }
};

std::vector<std::uint8_t> render(const Rig& rig, std::size_t camera, const Wall& wall) {
  const CameraModel& model = rig.camera[camera];
  const SE3 T_0_c = rig.T_body_cam[0].inverse() * rig.T_body_cam[camera];
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < model.height(); ++y) {
    for (int x = 0; x < model.width(); ++x) {
      Eigen::Vector3d bearing;
      if (!model.unproject({x, y}, bearing)) bearing.setZero();
      const Eigen::Vector3d ray = T_0_c.rotation * bearing;
      const Eigen::Vector3d p = T_0_c.translation + wall.depthAlong(T_0_c.translation, ray) * ray;
      pixels.push_back(
          static_cast<std::uint8_t>(std::clamp(std::lround(Wall::grey(p.x(), p.y())), 0L, 255L)));
    }
  }
  return pixels;
}

PlaceKeyframe gridOfFeatures(const Rig& rig) {
  PlaceKeyframe keyframe;
  for (int y = 40; y < 440; y += 24) {
    for (int x = 40; x < 712; x += 32) {
      PlaceFeature f;
      f.pixel = Eigen::Vector2f(static_cast<float>(x) + 0.3F, static_cast<float>(y) + 0.7F);
      Eigen::Vector3d bearing;
      if (!rig.camera[0].unproject(f.pixel.cast<double>(), bearing)) continue;
      f.bearing = bearing.cast<float>();
      (void)keyframe.features.tryPushBack(f);
    }
  }
  return keyframe;
}

}  // namespace

TEST_CASE("stereo depths agree with a rendered wall within their sigma") {
  Rig rig = makeRig();
  // Cameras turned a little against each other, as real rigs are.
  rig.T_body_cam[1].rotation = rig.T_body_cam[1].rotation * expSo3(Eigen::Vector3d(0.01, -0.015, 0.02));
  const Wall wall;
  const auto left = render(rig, 0, wall);
  const auto right = render(rig, 1, wall);
  const ImageView image0{left.data(), 752, 480, 752};
  const ImageView image1{right.data(), 752, 480, 752};
  StereoDepth depth(rig);
  PlaceKeyframe keyframe = gridOfFeatures(rig);
  std::size_t found = 0;
  REQUIRE(depth.fill(image0, image1, keyframe, found).ok());
  std::size_t with_depth = 0;
  std::size_t off = 0;
  for (const PlaceFeature& f : keyframe.features) {
    if (!(f.inverse_depth_sigma > 0)) continue;
    ++with_depth;
    const double truth = 1.0 / wall.depthAlong(Eigen::Vector3d::Zero(), f.bearing.cast<double>());
    if (std::abs(static_cast<double>(f.inverse_depth) - truth) >
        3 * static_cast<double>(f.inverse_depth_sigma))
      ++off;
  }
  INFO(found << " of " << keyframe.features.size() << ", off " << off);
  CHECK(with_depth == found);
  CHECK(found > keyframe.features.size() / 2);
  CHECK(off <= found / 50);

  // A depth that is known better stays, though it be wrong; a worse one is replaced.
  PlaceKeyframe known = keyframe;
  for (PlaceFeature& f : known.features) f.inverse_depth = 7.0F, f.inverse_depth_sigma = 1e-6F;
  REQUIRE(depth.fill(image0, image1, known, found).ok());
  for (const PlaceFeature& f : known.features) REQUIRE(f.inverse_depth == 7.0F);
  for (PlaceFeature& f : known.features) f.inverse_depth_sigma = 5.0F;
  REQUIRE(depth.fill(image0, image1, known, found).ok());
  std::size_t replaced = 0;
  for (const PlaceFeature& f : known.features) replaced += f.inverse_depth != 7.0F ? 1U : 0U;
  CHECK(replaced == found);
}

TEST_CASE("stereo depth finds nothing where there is nothing, and refuses other sizes") {
  const Rig rig = makeRig();
  const std::vector<std::uint8_t> flat(752 * 480, 90);
  const ImageView image{flat.data(), 752, 480, 752};
  StereoDepth depth(rig);
  PlaceKeyframe keyframe = gridOfFeatures(rig);
  // Features at the very edge and without sense are passed over.
  keyframe.features[0].pixel = {0, 0};
  keyframe.features[1].pixel = {751, 479};
  keyframe.features[2].pixel = {-5000, 1e9F};
  keyframe.features[3].pixel.x() = std::numeric_limits<float>::quiet_NaN();
  std::size_t found = 9;
  CHECK(depth.fill(image, image, keyframe, found).ok());
  CHECK(found == 0);
  CHECK(depth.fill(ImageView{flat.data(), 640, 480, 640}, image, keyframe, found).code ==
        StatusCode::kInvalidInput);
  CHECK(depth.fill(image, ImageView{}, keyframe, found).code == StatusCode::kInvalidInput);
}

TEST_CASE("landmarks give their features a depth") {
  const Rig rig = makeRig();
  Random random(2);
  SmoothedWindow window;
  window.started = true;
  window.epoch = 3;
  WindowPose pose;
  pose.frame_index = 41;
  pose.T_world_body = SE3(expSo3(randomVector(random)), randomVector(random));
  (void)window.poses.tryPushBack(WindowPose{});
  (void)window.poses.tryPushBack(pose);
  PlaceKeyframe keyframe;
  keyframe.index = 41;
  keyframe.epoch = 3;
  for (std::size_t i = 0; i < 60; ++i) {
    PlaceFeature f;
    f.has_landmark = i % 3 != 0;
    f.landmark = 1000 - 7 * i;
    f.bearing = randomVector(random).normalized().cast<float>();
    (void)keyframe.features.tryPushBack(f);
    if (i % 3 == 2) continue;
    WindowLandmark landmark;
    landmark.id = f.landmark;
    const double distance = 1.0 + static_cast<double>(i);
    landmark.p_world = pose.T_world_body * rig.T_body_cam[0] * (distance * f.bearing.cast<double>());
    landmark.inverse_depth_sigma = i == 1 ? 1e-9 : 0.02;
    (void)window.landmarks.tryPushBack(landmark);
  }
  auto depth = std::make_unique<LandmarkDepth>();
  std::size_t found = 0;
  REQUIRE(depth->fill(window, rig.T_body_cam[0], keyframe, found).ok());
  CHECK(found == 20);
  for (std::size_t i = 0; i < 60; ++i) {
    const PlaceFeature& f = keyframe.features[i];
    if (i % 3 != 1) {
      REQUIRE(f.inverse_depth_sigma == 0);
      continue;
    }
    REQUIRE(f.inverse_depth == Approx(1.0 / (1.0 + static_cast<double>(i))).epsilon(1e-5));
    // Never believed better than a part of itself.
    REQUIRE(f.inverse_depth_sigma == Approx(i == 1 ? 0.01 / 2.0 : 0.02));
  }
  keyframe.epoch = 4;
  CHECK(depth->fill(window, rig.T_body_cam[0], keyframe, found).code == StatusCode::kInvalidInput);
  keyframe.epoch = 3;
  keyframe.index = 5;
  CHECK(depth->fill(window, rig.T_body_cam[0], keyframe, found).code == StatusCode::kNotReady);
  window.started = false;
  CHECK(depth->fill(window, rig.T_body_cam[0], keyframe, found).code == StatusCode::kNotReady);
}
