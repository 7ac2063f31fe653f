// Poses between given ones, and landmarks triangulated with them.

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "estimator/core/random.hpp"
#include "firmware_host/lab/modules/given_pose_window.hpp"
#include "firmware_host/lab/modules/given_poses.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

Stamp at(double seconds) { return Stamp{100 * kSecond} + Duration::fromSeconds(seconds); }

SE3 poseAlongX(double x) { return {Eigen::Quaterniond::Identity(), {x, 0, 0}}; }

TEST_CASE("given poses are interpolated, but not across gaps and jumps") {
  Trajectory trajectory;
  for (int i = 0; i < 20; ++i) {
    const double t = 0.05 * i;
    TrajectoryPoint point;
    point.stamp = at(t < 0.5 ? t : t + 1);                 // a gap of a second
    point.T_world_body = poseAlongX(i < 15 ? t : t + 10);  // a jump of 10 m
    trajectory.push_back(point);
  }
  const GivenPoses poses({"truth.csv", trajectory}, Duration::fromMilliseconds(100));
  LogWarnings warnings;
  poses.warnOfJumps("nothing goes on", warnings);
  REQUIRE(warnings.lines().size() == 1);
  CHECK(warnings.lines()[0] == "truth.csv: the poses jump 1 times, first at " +
                                   formatSeconds(trajectory[15].stamp) + ": nothing goes on");
  REQUIRE(poses.at(at(0.22)));
  CHECK(poses.at(at(0.22))->T_world_body.translation.x() == Approx(0.22));
  CHECK(poses.at(at(0.22))->piece == 0);
  CHECK_FALSE(poses.at(at(-0.01)));
  CHECK_FALSE(poses.at(at(0.9)));  // in the gap
  REQUIRE(poses.at(at(1.68)));
  CHECK(poses.at(at(1.68))->piece == 0);
  CHECK_FALSE(poses.at(at(1.72)));  // between 14 and 15
  REQUIRE(poses.at(at(1.75)));
  CHECK(poses.at(at(1.75))->piece == 1);
  CHECK(poses.at(at(1.78))->T_world_body.translation.x() == Approx(10.78));
  CHECK_FALSE(poses.at(at(1.96)));
  const ScanMotion scan = poses.scanAt(at(0.22), Duration::fromMilliseconds(20));
  CHECK(scan.v_body.x() == Approx(1));
  CHECK(scan.turn.mean().norm() < 1e-6);
  CHECK(poses.scanAt(at(0.9), Duration::fromMilliseconds(20)).v_body.isZero());
}

Rig stereoRig() {
  Rig rig;
  rig.camera_count = 2;
  const CameraModel camera(CameraKind::kPinholeRadtan, 640, 480, {400, 400, 320, 240}, {0, 0, 0, 0});
  rig.camera = {camera, camera};
  rig.T_body_cam[1].translation = {0.1, 0, 0};
  return rig;
}

/// Points in front of a camera that moves along x, seen with noise.
class Scene {
 public:
  Scene() {
    for (int i = 0; i < 80; ++i) {
      points_.push_back({random_.uniform(-3, 3), random_.uniform(-1.5, 1.5), random_.uniform(3, 6)});
    }
  }
  TrackedFrame frame(std::uint64_t index, const SE3& pose, double noise) {
    TrackedFrame frame;
    frame.index = index;
    frame.stamp = at(0.05 * static_cast<double>(index));
    frame.keyframe = index % 5 == 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      TrackedFeature feature;
      feature.id = i;
      for (std::size_t c = 0; c < 2; ++c) {
        Eigen::Vector2d pixel;
        const SE3 T_cam_world = (pose * rig_.T_body_cam[c]).inverse();
        if (!rig_.camera[c].project(T_cam_world * points_[i], pixel) || !rig_.camera[c].inImage(pixel))
          continue;
        feature.seen[c] = true;
        feature.pixel[c] =
            (pixel + noise * Eigen::Vector2d(random_.normal(), random_.normal())).cast<float>();
      }
      if (feature.seen[0] || feature.seen[1]) REQUIRE(frame.features.tryPushBack(feature));
    }
    return frame;
  }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Eigen::Vector3d& point(TrackId id) const { return points_[id]; }

 private:
  Rig rig_ = stereoRig();
  Random random_{5};
  std::vector<Eigen::Vector3d> points_;
};

TEST_CASE("landmarks stand where they are, to what the noise allows") {
  Scene scene;
  GivenPoseWindow window(scene.rig(), {});
  double squared = 0;
  int count = 0;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const SE3 pose = poseAlongX(0.03 * static_cast<double>(i));
    window.add(scene.frame(i, pose, 0.45), pose);
    REQUIRE(window.window().poses.back().frame_index == i);
    CHECK(window.window().poses.size() <= 16);
  }
  // Newest four, and the keyframes 0, 5, ... 35 with 36 and later in the newest four.
  CHECK(window.window().poses.size() == 12);
  REQUIRE(window.window().landmarks.size() > 50);
  for (const WindowLandmark& landmark : window.window().landmarks) {
    const Eigen::Vector3d& truth = scene.point(landmark.id);
    const double depth = landmark.p_world.norm();
    const double depth_sigma = landmark.inverse_depth_sigma * depth * depth;
    CHECK((landmark.p_world - truth).norm() < 0.3);
    const double normalized = (landmark.p_world - truth).norm() / depth_sigma;
    if (landmark.sightings < 3) continue;
    squared += normalized * normalized;
    ++count;
  }
  // The error is nearly all along the ray: its normalized square has a mean of one and a bit.
  CHECK(squared / count > 0.5);
  CHECK(squared / count < 2.0);
}

TEST_CASE("a sighting that does not fit is left out, a landmark of such is not given") {
  Scene scene;
  GivenPoseWindow window(scene.rig(), {});
  for (std::uint64_t i = 0; i < 4; ++i) {
    const SE3 pose = poseAlongX(0.05 * static_cast<double>(i));
    TrackedFrame frame = scene.frame(i, pose, 0.1);
    for (TrackedFeature& feature : frame.features) {
      if (feature.id == 10 && i == 2) feature.pixel[0].x() += 12;  // once
      for (Eigen::Vector2f& pixel : feature.pixel) {
        if (feature.id == 11) pixel.y() += 20 * static_cast<float>(i % 2);  // every other frame
      }
      if (feature.id == 12) feature.pixel[0].x() = std::numeric_limits<float>::quiet_NaN();  // no number
    }
    window.add(frame, pose);
  }
  CHECK(window.counters().sightings_left_out > 0);
  bool once = false;
  for (const WindowLandmark& landmark : window.window().landmarks) {
    CHECK(landmark.id != 11);
    CHECK(landmark.p_world.allFinite());
    once = once || landmark.id == 10;
    if (landmark.id == 10) CHECK((landmark.p_world - scene.point(10)).norm() < 0.15);
  }
  CHECK(once);
}

TEST_CASE("without parallax there is no landmark") {
  Scene scene;
  Rig rig = scene.rig();
  rig.camera_count = 1;
  GivenPoseWindow window(rig, {});
  for (std::uint64_t i = 0; i < 4; ++i) window.add(scene.frame(i, poseAlongX(0), 0.1), poseAlongX(0));
  CHECK(window.window().landmarks.empty());
  CHECK(window.counters().no_parallax > 0);
}

TEST_CASE("a new epoch knows nothing of the old") {
  Scene scene;
  GivenPoseWindow window(scene.rig(), {});
  window.add(scene.frame(0, poseAlongX(0), 0.1), poseAlongX(0));
  REQUIRE_FALSE(window.window().landmarks.empty());
  window.startEpoch();
  CHECK(window.window().landmarks.empty());
  CHECK(window.window().epoch == 1);
  FrontendPrediction prediction;
  window.predict(poseAlongX(0), prediction);
  CHECK_FALSE(prediction.has_rotation);
  CHECK(prediction.landmarks.empty());
  window.add(scene.frame(1, poseAlongX(50), 0.1), poseAlongX(50));
  CHECK(window.window().poses.size() == 1);
}

TEST_CASE("predictions are where the camera then sees the landmarks") {
  Scene scene;
  GivenPoseWindow window(scene.rig(), {});
  for (std::uint64_t i = 0; i < 4; ++i) {
    const SE3 pose = poseAlongX(0.05 * static_cast<double>(i));
    window.add(scene.frame(i, pose, 0), pose);
  }
  const SE3 next(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY())), {0.2, 0, 0});
  FrontendPrediction prediction;
  window.predict(next, prediction);
  CHECK(prediction.has_rotation);
  CHECK(prediction.R_body_prev_body_cur.angularDistance(next.rotation) < 1e-9);
  const TrackedFrame seen = scene.frame(4, next, 0);
  REQUIRE(prediction.landmarks.size() > 40);
  for (const PredictedLandmark& landmark : prediction.landmarks) {
    for (const TrackedFeature& feature : seen.features) {
      if (feature.id != landmark.id) continue;
      for (std::size_t c = 0; c < 2; ++c) {
        if (landmark.visible[c] && feature.seen[c])
          CHECK((landmark.pixel[c] - feature.pixel[c]).norm() < 0.1);
      }
    }
  }
}

}  // namespace
}  // namespace swiftlet
