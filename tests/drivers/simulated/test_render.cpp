#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "drivers/simulated/camera_renderer.hpp"
#include "drivers/simulated/flight_path.hpp"
#include "drivers/simulated/image_sensor.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "drivers/simulated/tile_tracer.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::array kRigs{RigKind::kEuroc, RigKind::kForward, RigKind::kWide, RigKind::kFisheye};

PaintSettings coarsePaint() {
  PaintSettings paint;
  paint.texel = 0.02;
  return paint;
}

struct Scene {
  MountedRig mounted;
  SplineTrajectory trajectory;
  World world;
};

Scene makeScene(WorldKind kind, RigKind rig, std::uint64_t seed) {
  Scene scene;
  scene.mounted = makeRig(rig);
  WorldSettings world;
  world.kind = kind;
  world.seed = seed;
  FlightSettings flight;
  flight.duration = 10;
  flight.seed = seed;
  flight.R_flu_body = scene.mounted.R_flu_body;
  scene.trajectory = flyTour(worldTour(world), flight);
  std::vector<Eigen::Vector3d> path;
  for (double t = 0; t < 10; t += 0.1) path.push_back(scene.trajectory.pose(t).translation);
  scene.world = buildWorld(world, path);
  return scene;
}

TEST_CASE("tiles see what single exact rays see") {
  for (const RigKind rig : kRigs) {
    const Scene scene = makeScene(WorldKind::kCluttered, rig, 7);
    const TexturedWorld textured(scene.world, coarsePaint());
    const CameraModel& camera = scene.mounted.rig.camera[0];
    const CameraRenderer renderer(textured, camera, scene.mounted.rig.T_body_cam[0]);
    const SE3 T_world_body = scene.trajectory.pose(3.3);
    const SE3 T_world_cam = T_world_body * scene.mounted.rig.T_body_cam[0];
    GeometryImage geometry;
    renderer.renderGeometry(T_world_body, 2, geometry);
    Random random(3);
    int seen = 0;
    int same = 0;
    for (int i = 0; i < 3000; ++i) {
      const auto x = static_cast<int>(random.below(static_cast<std::uint32_t>(camera.width())));
      const auto y = static_cast<int>(random.below(static_cast<std::uint32_t>(camera.height())));
      const auto k = static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width()) +
                     static_cast<std::size_t>(x);
      Eigen::Vector3d ray;
      if (!camera.unproject(Eigen::Vector2d(x, y), ray)) {
        CHECK(geometry.patch[k] == -1);
        continue;
      }
      const auto hit = scene.world.castRay(T_world_cam.translation, T_world_cam.rotation * ray, 1e-3, 100);
      REQUIRE(hit);
      ++seen;
      // At silhouettes single precision may choose the other side.
      if (geometry.patch[k] != static_cast<std::int32_t>(hit->patch)) continue;
      ++same;
      const double depth = hit->distance * ray.z();
      CHECK(static_cast<double>(geometry.depth[k]) == Approx(depth).epsilon(1e-4).margin(1e-4));
    }
    INFO(rigName(rig));
    CHECK(seen > 2500);
    CHECK(same >= seen - seen / 200);
  }
}

// A white disc on a dark board, `distance` metres before camera 0 and beside its axis.
struct DotWorld {
  World world;
  Eigen::Vector3d dot = Eigen::Vector3d::Zero();
};
DotWorld makeDot(const SE3& T_world_cam, const Eigen::Vector3d& direction, double distance, double radius) {
  DotWorld result;
  const Eigen::Vector3d normal = -(T_world_cam.rotation * direction.normalized());
  result.dot = T_world_cam.translation - distance * normal;
  Patch disc;
  disc.shape = Shape::kDisc;
  disc.material = Material::kLamp;
  disc.u_axis = normal.unitOrthogonal();
  disc.v_axis = normal.cross(disc.u_axis);
  disc.radius = radius;
  disc.u_length = disc.v_length = 2 * radius;
  disc.origin = result.dot - radius * (disc.u_axis + disc.v_axis);
  result.world.add(disc);
  result.world.finish();
  return result;
}

struct Blob {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double spread = 0;  // px, root mean square distance from the centre
};
Blob blobOf(const std::vector<float>& radiance, int width) {
  Blob blob;
  double sum = 0;
  for (std::size_t k = 0; k < radiance.size(); ++k) {
    const auto weight = static_cast<double>(radiance[k]);
    const auto w = static_cast<std::size_t>(width);
    blob.centre += weight * Eigen::Vector2d(static_cast<double>(k % w), static_cast<double>(k / w));
    sum += weight;
  }
  blob.centre /= sum;
  for (std::size_t k = 0; k < radiance.size(); ++k) {
    const auto w = static_cast<std::size_t>(width);
    const Eigen::Vector2d pixel(static_cast<double>(k % w), static_cast<double>(k / w));
    blob.spread += static_cast<double>(radiance[k]) * (pixel - blob.centre).squaredNorm() / sum;
  }
  blob.spread = std::sqrt(blob.spread);
  return blob;
}

TEST_CASE("a point is rendered where the camera model projects it, in both cameras") {
  Random random(17);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (const RigKind rig : kRigs) {
    const MountedRig mounted = makeRig(rig);
    const SE3 T_world_body(expSo3({0.3, -0.4, 1.2}), {1, 2, 3});
    const SplineTrajectory still(0, 1, std::vector<SE3>(8, T_world_body));
    for (int i = 0; i < 4; ++i) {
      const SE3 T_world_cam0 = T_world_body * mounted.rig.T_body_cam[0];
      const Eigen::Vector3d direction(random.uniform(-0.4, 0.4), random.uniform(-0.3, 0.3), 1);
      const double radius = 5 * 3.0 / mounted.rig.camera[0].focal();  // 5 px
      const DotWorld dot = makeDot(T_world_cam0, direction, 3.0, radius);
      const TexturedWorld textured(dot.world, coarsePaint());
      for (std::size_t c = 0; c < 2; ++c) {
        const CameraRenderer renderer(textured, mounted.rig.camera[c], mounted.rig.T_body_cam[c]);
        std::vector<float> radiance;
        renderer.renderImage(still, 0.5, RenderSettings{}, radiance);
        Eigen::Vector2d pixel;
        const SE3 T_cam_world = (T_world_body * mounted.rig.T_body_cam[c]).inverse();
        REQUIRE(mounted.rig.camera[c].project(T_cam_world * dot.dot, pixel));
        INFO(rigName(rig) << " camera " << c);
        const Eigen::Vector2d error = blobOf(radiance, mounted.rig.camera[c].width()).centre - pixel;
        CHECK(error.norm() < 0.1);  // four rays a pixel leave the edge of the dot a little to chance
        sum += error;
        ++count;
      }
    }
  }
  CHECK((sum / count).norm() < 0.02);  // no shift of the whole image
}

TEST_CASE("motion blur is centred on mid-exposure and as long as the motion") {
  const MountedRig mounted = makeRig(RigKind::kEuroc);
  const SE3 T_body_cam = mounted.rig.T_body_cam[0];
  const double rate = 3.0;  // rad/s about the camera's y axis: 5.5 px in 4 ms
  std::vector<SE3> controls;
  for (int k = 0; k < 20; ++k) {
    const SE3 T_world_cam(expSo3((k - 10) * 0.05 * rate * Eigen::Vector3d::UnitY()), Eigen::Vector3d::Zero());
    controls.push_back(T_world_cam * T_body_cam.inverse());
  }
  const SplineTrajectory turning(0, 0.05, controls);
  const double t = 0.4;
  const SE3 T_world_cam = turning.pose(t) * T_body_cam;
  const DotWorld dot = makeDot(T_world_cam, {0.1, 0.05, 1}, 3.0, 0.03);
  const TexturedWorld textured(dot.world, coarsePaint());
  const CameraRenderer renderer(textured, mounted.rig.camera[0], T_body_cam);
  Eigen::Vector2d pixel;
  REQUIRE(mounted.rig.camera[0].project(T_world_cam.inverse() * dot.dot, pixel));
  std::vector<float> radiance;
  RenderSettings settings;
  renderer.renderImage(turning, t, settings, radiance);
  const Blob blurred = blobOf(radiance, 752);
  settings.exposure = 1e-6;
  renderer.renderImage(turning, t, settings, radiance);
  const Blob sharp = blobOf(radiance, 752);
  CHECK((blurred.centre - pixel).norm() < 0.1);
  const double length = rate * 0.004 * 458;
  const double added = std::sqrt(blurred.spread * blurred.spread - sharp.spread * sharp.spread);
  CHECK(added == Approx(length / std::sqrt(12.0)).epsilon(0.1));
}

TEST_CASE("a rolling shutter shows a point in the row that was read when it was there") {
  const MountedRig mounted = makeRig(RigKind::kEuroc);
  Rig rig = mounted.rig;
  rig.readout = Duration::fromMilliseconds(20);
  std::vector<SE3> controls;  // about the optical axis and across it, and sideways
  for (int k = 0; k < 20; ++k) {
    const double s = (k - 10) * 0.05;
    controls.push_back(SE3(expSo3(s * Eigen::Vector3d(1, -2, 1.5)), s * Eigen::Vector3d(1, 0.5, -1)) *
                       rig.T_body_cam[0].inverse());
  }
  const SplineTrajectory moving(0, 0.05, controls);
  constexpr double kTime = 0.4;
  const SE3 T_world_cam = moving.pose(kTime) * rig.T_body_cam[0];
  for (const Eigen::Vector3d& direction : {Eigen::Vector3d(0.3, -0.35, 1), Eigen::Vector3d(-0.4, 0.3, 1)}) {
    const DotWorld dot = makeDot(T_world_cam, direction, 3.0, 0.03);
    const TexturedWorld textured(dot.world, coarsePaint());
    const CameraRenderer renderer(textured, rig.camera[0], rig.T_body_cam[0]);
    RenderSettings settings;
    settings.readout = rig.readout.seconds();
    std::vector<float> radiance;
    renderer.renderImage(moving, kTime, settings, radiance);
    Eigen::Vector2d pixel;
    REQUIRE(rig.camera[0].project(T_world_cam.inverse() * dot.dot, pixel));
    const Eigen::Vector2d in_middle = pixel;
    for (int round = 0; round < 8; ++round) {
      const SE3 T = moving.pose(kTime + rig.rowTime(0, pixel.y())) * rig.T_body_cam[0];
      REQUIRE(rig.camera[0].project(T.inverse() * dot.dot, pixel));
    }
    CHECK((blobOf(radiance, 752).centre - pixel).norm() < 0.15);
    CHECK((in_middle - pixel).norm() > 2);
  }
}

TEST_CASE("the left image warped by depth is the right image") {
  const Scene scene = makeScene(WorldKind::kRoom, RigKind::kEuroc, 2);
  const TexturedWorld textured(scene.world, coarsePaint());
  const Rig& rig = scene.mounted.rig;
  const CameraRenderer left(textured, rig.camera[0], rig.T_body_cam[0]);
  const CameraRenderer right(textured, rig.camera[1], rig.T_body_cam[1]);
  const SE3 T_world_body = scene.trajectory.pose(5.0);
  GeometryImage geometry;
  GeometryImage other;
  left.renderGeometry(T_world_body, 2, geometry);
  right.renderGeometry(T_world_body, 2, other);
  RenderSettings settings;
  settings.exposure = 1e-6;
  std::vector<float> left_image;
  std::vector<float> right_image;
  left.renderImage(scene.trajectory, 5.0, settings, left_image);
  right.renderImage(scene.trajectory, 5.0, settings, right_image);
  const SE3 T_right_left = rig.T_cam1_cam0();
  std::vector<double> difference;
  std::vector<double> shifted;
  int consistent = 0;
  int tested = 0;
  for (int y = 10; y < 470; y += 3) {
    for (int x = 10; x < 740; x += 3) {
      const auto k = static_cast<std::size_t>(y * 752 + x);
      Eigen::Vector3d ray;
      REQUIRE(rig.camera[0].unproject(Eigen::Vector2d(x, y), ray));
      const Eigen::Vector3d p = T_right_left * (ray * (static_cast<double>(geometry.depth[k]) / ray.z()));
      Eigen::Vector2d pixel;
      if (!rig.camera[1].project(p, pixel) || !rig.camera[1].inImage(pixel, 4)) continue;
      const auto q = static_cast<std::size_t>(std::lround(pixel.y()) * 752 + std::lround(pixel.x()));
      ++tested;
      if (other.patch[q] != geometry.patch[k]) continue;  // hidden in the right image
      if (std::fabs(static_cast<double>(other.depth[q]) - p.z()) < 0.01 * p.z()) ++consistent;
      const auto at = [&](double dx) {
        const double u = pixel.x() + dx;
        const double v = pixel.y();
        const auto x0 = static_cast<std::size_t>(u);
        const auto y0 = static_cast<std::size_t>(v);
        const double a = u - static_cast<double>(x0);
        const double b = v - static_cast<double>(y0);
        const auto value = [&](std::size_t i, std::size_t j) {
          return static_cast<double>(right_image[(y0 + j) * 752 + x0 + i]);
        };
        return (1 - b) * ((1 - a) * value(0, 0) + a * value(1, 0)) +
               b * ((1 - a) * value(0, 1) + a * value(1, 1));
      };
      difference.push_back(std::fabs(at(0) - static_cast<double>(left_image[k])));
      shifted.push_back(std::fabs(at(1.5) - static_cast<double>(left_image[k])));
    }
  }
  CHECK(consistent > 0.95 * tested);
  const auto mean = [](const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
  };
  CHECK(mean(difference) < 0.01);
  CHECK(mean(shifted) > 2 * mean(difference));
}

TEST_CASE("images do not depend on the number of threads") {
  const Scene scene = makeScene(WorldKind::kRoom, RigKind::kForward, 3);
  const TexturedWorld textured(scene.world, coarsePaint());
  const CameraRenderer renderer(textured, scene.mounted.rig.camera[0], scene.mounted.rig.T_body_cam[0]);
  std::array<std::vector<float>, 2> radiance;
  std::array<std::vector<std::uint8_t>, 2> grey;
  for (std::size_t i = 0; i < 2; ++i) {
    RenderSettings settings;
    settings.threads = i == 0 ? 1 : 3;
    renderer.renderImage(scene.trajectory, 2.0, settings, radiance[i]);
    grey[i].resize(640 * 400);
    exposeImage(radiance[i], 640, 400, SensorSettings{}, 1.0, 7, 0, settings.threads, grey[i].data());
  }
  CHECK(radiance[0] == radiance[1]);
  CHECK(grey[0] == grey[1]);
}

TEST_CASE("sensor noise and vignette follow the model") {
  constexpr int kWidth = 640;
  constexpr int kHeight = 480;
  const std::vector<float> flat(kWidth * kHeight, 0.4F);
  SensorSettings settings;
  std::vector<std::uint8_t> grey(kWidth * kHeight);
  for (const double gain : {1.0, 4.0}) {
    settings.light = 1.0 / gain;
    exposeImage(flat, kWidth, kHeight, settings, gain, 1, 0, 2, grey.data());
    double mean = 0;
    double square = 0;
    int count = 0;
    for (int y = 200; y < 280; ++y) {
      for (int x = 280; x < 360; ++x) {
        const double value = grey[static_cast<std::size_t>(y * kWidth + x)];
        mean += value;
        square += value * value;
        ++count;
      }
    }
    mean /= count;
    const double variance = square / count - mean * mean;
    CHECK(mean == Approx(255 * 0.4).epsilon(0.02));
    const double expected =
        settings.read_noise * settings.read_noise * gain * gain + settings.shot_noise * gain * mean;
    CHECK(variance == Approx(expected + 1.0 / 12).epsilon(0.12));  // rounding adds a twelfth
    double corner = 0;
    for (int y = 0; y < 10; ++y) {
      for (int x = 0; x < 10; ++x) corner += grey[static_cast<std::size_t>(y * kWidth + x)] / 100.0;
    }
    CHECK(corner / mean == Approx(1 - settings.vignette).margin(0.03));
  }
}

TEST_CASE("exposure settles within a second") {
  SensorSettings settings;
  GainControl control(settings);
  control.start(0.3);
  const auto grey = [&] { return std::min(255.0, 255 * 0.3 * control.gain()); };
  CHECK(grey() == Approx(settings.start_error * settings.target_mean).epsilon(0.01));
  for (int k = 0; k < 20; ++k) control.update(grey(), 0.05);
  CHECK(grey() == Approx(settings.target_mean).epsilon(0.03));
}

}  // namespace
}  // namespace swiftlet
