// Raw pair to depth image, and a sensor's depth image: depths, sigmas, labels, counters, bad input.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "mapping/depth/depth_stage.hpp"
#include "mapping/depth/sensor_depth.hpp"
#include "tests/mapping/depth_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::depth_scene;

TEST_CASE("depth: a plane's depth comes out of the raw pair, with an honest sigma") {
  for (const CameraKind kind : {CameraKind::kPinholeRadtan, CameraKind::kEquidistant}) {
    const Rig rig = makeRig(kind);
    DepthStage stage(rig);
    REQUIRE(stage.status().ok());
    DepthBuffer out = stage.makeBuffer();
    const Eigen::Vector3d normal = Eigen::Vector3d(1, 0.15, -0.25).normalized();
    const double offset = 1.6;
    const Image left = seePlane(rig, 0, normal, offset), right = seePlane(rig, 1, normal, offset);
    REQUIRE(stage.step(left.view(), right.view(), Stamp{42}, {}, out).ok());
    const DepthImageView view = out.view();
    CHECK(view.stamp == Stamp{42});
    REQUIRE(view.intensity != nullptr);
    CHECK(view.labels == nullptr);
    // In pixels of disparity: independent of where the plane is.
    std::vector<double> pixels_off;
    const double depth_disparity = view.camera.fx * stage.rectification().baseline();
    std::size_t within = 0, far_within = 0, i = 0;
    for (int y = 0; y < view.camera.height; ++y) {
      for (int x = 0; x < view.camera.width; ++x, ++i) {
        if (!(view.depth[i] > 0)) continue;
        const Eigen::Vector3d ray =
            view.T_body_camera.rotation *
            Eigen::Vector3d((x - view.camera.cx) / view.camera.fx, (y - view.camera.cy) / view.camera.fy, 1);
        const double z = (offset - normal.dot(view.T_body_camera.translation)) / normal.dot(ray);
        const double error = std::abs(view.depth[i] - z);
        pixels_off.push_back(depth_disparity * std::abs(1 / view.depth[i] - 1 / z));
        REQUIRE(view.sigma[i] > 0);
        within += error <= view.sigma[i] ? 1U : 0U;
        far_within += error <= 3 * view.sigma[i] ? 1U : 0U;
      }
    }
    const double count = static_cast<double>(pixels_off.size());
    CHECK(count > 0.85 * static_cast<double>(view.camera.pixels()));
    std::sort(pixels_off.begin(), pixels_off.end());
    INFO("median error [px] " << pixels_off[pixels_off.size() / 2] << ", 95 % "
                              << pixels_off[pixels_off.size() * 95 / 100]);
    CHECK(pixels_off[pixels_off.size() / 2] < 0.2);
    CHECK(pixels_off[pixels_off.size() * 95 / 100] < 0.8);
    CHECK(static_cast<double>(within) > 0.6 * count);
    CHECK(static_cast<double>(far_within) > 0.97 * count);
    CHECK(stage.counters().images == 1);
    CHECK(stage.counters().measured == pixels_off.size());
  }
}

TEST_CASE("depth: a wide pair searches more disparities, so that depth begins within a metre") {
  Rig rig = makeRig(CameraKind::kPinholeRadtan);
  Eigen::Vector3d& second = rig.T_body_cam[1].translation;
  second.y() = rig.T_body_cam[0].translation.y() - 0.44;  // four times as wide
  DepthStage stage(rig);
  REQUIRE(stage.status().ok());
  DepthBuffer out = stage.makeBuffer();
  // A metre in front of the cameras.
  const Image left = seePlane(rig, 0, {1, 0, 0}, 1.1), right = seePlane(rig, 1, {1, 0, 0}, 1.1);
  REQUIRE(stage.step(left.view(), right.view(), Stamp{42}, {}, out).ok());
  const auto measured = std::ranges::count_if(out.depth, [](float z) { return std::abs(z - 1) < 0.02F; });
  CHECK(static_cast<double>(measured) > 0.5 * static_cast<double>(out.depth.size()));
  CHECK(stage.nearestDepth() < 1);
  // As many as there are leave the rest.
  second.y() -= 0.56;
  CHECK(DepthStage(rig).nearestDepth() > 1);
  CHECK(DepthStage(makeRig(CameraKind::kPinholeRadtan)).nearestDepth() == Approx(0.316).margin(0.001));
}

TEST_CASE("depth: labels follow into the rectified geometry") {
  const Rig rig = makeRig(CameraKind::kPinholeRadtan);
  DepthStage stage(rig);
  DepthBuffer out = stage.makeBuffer();
  // Label by the direction's side: where the plane x = 0 of the body passes, warped exactly.
  Image labels;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      Eigen::Vector3d bearing;
      if (!rig.camera[0].unproject(Eigen::Vector2d(x, y), bearing)) continue;
      const Eigen::Vector3d ray = rig.T_body_cam[0].rotation * bearing;
      labels.pixels[static_cast<std::size_t>(y * kWidth + x)] = ray.y() > 0.1 * ray.x() ? 3 : 7;
    }
  }
  REQUIRE(stage.addLabels(labels.view(), out).ok());
  REQUIRE(out.view().labels != nullptr);
  const PinholeIntrinsics& k = stage.rectification().intrinsics();
  std::size_t wrong = 0, i = 0;
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x, ++i) {
      const Eigen::Vector3d ray = stage.rectification().T_body_camera().rotation *
                                  Eigen::Vector3d((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
      const double side = ray.y() - 0.1 * ray.x();
      if (std::abs(side) < 1.5 / k.fx) continue;  // within a pixel or so of the border
      wrong += out.labels[i] != (side > 0 ? 3 : 7) ? 1U : 0U;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("depth: bad input to the stage is refused and counted") {
  const Rig rig = makeRig(CameraKind::kPinholeRadtan);
  DepthStage stage(rig);
  DepthBuffer out = stage.makeBuffer();
  out.depth[10] = 5;
  Image image;
  ImageView narrow = image.view();
  narrow.width -= 1;
  CHECK(stage.step({}, image.view(), {}, {}, out).code == StatusCode::kInvalidInput);
  CHECK(stage.step(image.view(), narrow, {}, {}, out).code == StatusCode::kInvalidInput);
  DepthBuffer empty;
  CHECK(stage.step(image.view(), image.view(), {}, {}, empty).code == StatusCode::kInvalidInput);
  CHECK(stage.addLabels(narrow, out).code == StatusCode::kInvalidInput);
  CHECK(out.depth[10] == 5);
  CHECK_FALSE(out.has_labels);
  CHECK(stage.counters().refused == 3);
  CHECK(stage.counters().labels_refused == 1);
  Rig mono = rig;
  mono.camera_count = 1;
  DepthStage none(mono);
  CHECK_FALSE(none.status().ok());
  CHECK(none.step(image.view(), image.view(), {}, {}, out).code == StatusCode::kInvalidInput);
}

TEST_CASE("depth: a sensor's image with gaps, NaN and values out of range") {
  PinholeIntrinsics k{100, 100, 3.5, 2.5, 8, 6};
  SensorDepthSettings settings;
  settings.min_depth = 0.3;
  SensorDepth sensor(k, SE3(), settings);
  DepthBuffer out = sensor.makeBuffer();
  // Rows of 10, 8 of them pixels.
  std::vector<std::uint16_t> counts(60, 2000);
  counts[0] = 0;
  counts[1] = 200;
  counts[2] = 60000;
  counts[4] = 65535;
  counts[10] = 400;
  REQUIRE(sensor.step(counts.data(), 8, 6, 10, Stamp{5}, out).ok());
  CHECK(out.depth[0] == 0);
  CHECK(out.depth[1] == 0);
  CHECK(out.depth[2] == Approx(60));
  CHECK(out.depth[4] == 0);
  CHECK(out.depth[3] == Approx(2));
  CHECK(out.depth[8] == Approx(0.4));
  CHECK(out.sigma[0] == 0);
  CHECK(out.sigma[3] == Approx(0.0012 + 0.0019 * 1.6 * 1.6));
  CHECK(out.sigma[8] == Approx(0.0012));
  CHECK(sensor.counters().missing == 2);
  CHECK(sensor.counters().out_of_range == 1);
  std::vector<float> metres(48, 1.5F);
  metres[4] = std::numeric_limits<float>::quiet_NaN();
  metres[5] = std::numeric_limits<float>::infinity();
  metres[6] = -1;
  metres[7] = 0;
  REQUIRE(sensor.step(metres.data(), 8, 6, 8, Stamp{6}, out).ok());
  for (const std::size_t i : {4U, 5U, 6U, 7U}) CHECK(out.depth[i] == 0);
  CHECK(out.depth[3] == 1.5F);
  CHECK(sensor.counters().not_finite == 2);
  CHECK(sensor.counters().out_of_range == 2);
  CHECK(sensor.counters().missing == 3);
  CHECK(sensor.counters().images == 2);
  CHECK(sensor.counters().pixels == 96);
  const float before = out.depth[3];
  const float* const no_metres = nullptr;
  CHECK(sensor.step(no_metres, 8, 6, 8, {}, out).code == StatusCode::kInvalidInput);
  CHECK(sensor.step(counts.data(), 6, 8, 10, {}, out).code == StatusCode::kInvalidInput);
  CHECK(sensor.step(counts.data(), 8, 6, 7, {}, out).code == StatusCode::kInvalidInput);
  CHECK(sensor.counters().refused == 3);
  CHECK(out.depth[3] == before);
}
