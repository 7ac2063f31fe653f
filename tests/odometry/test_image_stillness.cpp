// Still images, at any camera rate and distance, and what must not be taken for them.

#include "estimator/odometry/image_stillness.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "drivers/simulated/rig_presets.hpp"
#include "estimator/core/random.hpp"

using namespace swiftlet;

namespace {

constexpr double kTrackNoise = 0.15;  // px

struct View {
  double height = 1;                                   ///< m of what is seen, across the axis
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s of the camera, its axes
  double rate = 20;                                    ///< Hz
  int passer_by = 0;  ///< tracks of the left upper quadrant that move at 1 px a frame
  double shake = 0;   ///< rad, the camera turns to and fro by as much at 7 Hz
};

// Share of the frames from `from` on that are called `wanted`.
double share(const Rig& rig, const View& view, double seconds, double from, ImageMotion wanted) {
  ImageStillness stillness(rig);
  Random random(4);
  const CameraModel& camera = rig.camera[0];
  int called = 0;
  int frames = 0;
  for (int k = 0; k < seconds * view.rate; ++k) {
    const double t = k / view.rate;
    TrackedFrame frame;
    frame.stamp = Stamp{} + Duration::fromSeconds(t);
    frame.camera_present = {true, false};
    int passing = view.passer_by;
    for (int i = 0; i < 120; ++i) {
      const Eigen::Vector2d at((0.1 + 0.8 * (i % 12) / 11) * camera.width(),
                               (0.1 + 0.8 * (i / 12) / 9.0) * camera.height());
      Eigen::Vector3d ray;
      if (!camera.unproject(at, ray)) continue;
      Eigen::Vector2d pixel;
      Eigen::Vector3d point = ray * (view.height / std::max(ray.z(), 0.2)) - t * view.velocity;
      point.x() += view.shake * std::sin(2 * M_PI * 7 * t) * point.z();
      if (!camera.project(point, pixel)) continue;
      for (int axis = 0; axis < 2; ++axis) pixel[axis] += kTrackNoise * random.normal();
      if (at.x() < 0.5 * camera.width() && at.y() < 0.5 * camera.height() && passing-- > 0)
        pixel.x() += k % 200;
      TrackedFeature feature;
      feature.id = static_cast<TrackId>(i);
      feature.seen[0] = true;
      feature.pixel[0] = pixel.cast<float>();
      frame.features.pushBack(feature);
    }
    const ImageMotion motion = stillness.update(frame);
    if (t < from) continue;
    ++frames;
    called += motion == wanted ? 1 : 0;
  }
  return called / static_cast<double>(frames);
}

double shareStill(const Rig& rig, const View& view, double seconds, double from) {
  return share(rig, view, seconds, from, ImageMotion::kStill);
}

// Either lets a rest begin whatever the estimate says.
double shareOnTheSpot(const Rig& rig, const View& view, double seconds, double from) {
  return shareStill(rig, view, seconds, from) + share(rig, view, seconds, from, ImageMotion::kInPlace);
}

}  // namespace

TEST_CASE("Image stillness: nothing that drifts is still", "[image_stillness]") {
  for (const RigKind kind : {RigKind::kEuroc, RigKind::kWide, RigKind::kFisheye}) {
    const Rig rig = makeRig(kind).rig;
    for (const double rate : {10.0, 20.0, 60.0, 120.0}) {
      INFO(rigName(kind) << " at " << rate << " Hz");
      for (const double height : {1.0, 5.0, 20.0, 50.0}) {
        INFO("height " << height);
        CHECK(shareOnTheSpot(rig, {height, {0.05, 0, 0}, rate}, 6, 0) == 0);
        CHECK(shareOnTheSpot(rig, {height, {0.05, 0, 0}, rate, 0, 1.4e-3}, 6, 0) == 0);
      }
      // Climbing slowly away from the ground, which moves the image apart.
      CHECK(shareOnTheSpot(rig, {1, {0, 0, -0.05}, rate}, 6, 0) == 0);
    }
  }
}

TEST_CASE("Image stillness: what stands still is found, beside a passer-by too", "[image_stillness]") {
  for (const RigKind kind : {RigKind::kEuroc, RigKind::kWide, RigKind::kFisheye}) {
    const Rig rig = makeRig(kind).rig;
    for (const double rate : {10.0, 20.0, 120.0}) {
      INFO(rigName(kind) << " at " << rate << " Hz");
      CHECK(shareStill(rig, {3, Eigen::Vector3d::Zero(), rate}, 6, 3) > 0.95);
      CHECK(shareStill(rig, {3, Eigen::Vector3d::Zero(), rate, 60}, 6, 3) > 0.95);
    }
  }
}

TEST_CASE("Image stillness: shaken on the spot is not moving", "[image_stillness]") {
  for (const RigKind kind : {RigKind::kEuroc, RigKind::kWide, RigKind::kFisheye}) {
    const Rig rig = makeRig(kind).rig;
    View view;
    view.height = 3;
    for (const double rate : {20.0, 60.0}) {
      view.rate = rate;
      INFO(rigName(kind) << " at " << rate << " Hz");
      view.shake = 1.4e-3;
      CHECK(share(rig, view, 6, 0, ImageMotion::kMoving) == 0);
      CHECK(shareOnTheSpot(rig, view, 6, 3) > 0.95);
      view.shake = 10e-3;
      CHECK(share(rig, view, 6, 2, ImageMotion::kMoving) > 0.2);
    }
  }
}

TEST_CASE("Image stillness: without tracks nothing is known", "[image_stillness]") {
  ImageStillness stillness(makeRig(RigKind::kEuroc).rig);
  TrackedFrame frame;
  frame.camera_present = {true, true};
  CHECK(stillness.update(frame) == ImageMotion::kUnknown);
}
