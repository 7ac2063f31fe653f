// The stage as a whole, on a textured wall seen by a moving stereo rig: exact truth for every pixel.

#include "estimator/frontend/frontend.hpp"

#include <catch2/catch.hpp>
#include <map>
#include <memory>
#include <set>

#include "estimator/geometry/so3.hpp"
#include "tests/frontend/synthetic_image.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;
using test::quantile;

namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr double kFocal = 250;
constexpr double kWall = 2.5;  // m

Rig makeRig(CameraKind kind) {
  Rig rig;
  rig.camera_count = 2;
  const Eigen::Vector4d distortion = kind == CameraKind::kPinholeRadtan
                                         ? Eigen::Vector4d(-0.1, 0.02, 1e-4, -1e-4)
                                         : Eigen::Vector4d(0.01, -0.002, 0, 0);
  for (std::size_t c = 0; c < 2; ++c) {
    rig.camera[c] =
        CameraModel(kind, kWidth, kHeight, {kFocal, kFocal, kWidth / 2.0, kHeight / 2.0}, distortion);
  }
  // Body axes are not the cameras', and the right camera is turned a little.
  const Eigen::Quaterniond R_body_cam = expSo3({0.1, -0.2, 1.4});
  rig.T_body_cam[0] = SE3(R_body_cam, {0.02, 0.01, 0});
  rig.T_body_cam[1] = rig.T_body_cam[0] * SE3(expSo3({0.01, -0.02, 0.06}), {0.11, 0.002, -0.001});
  return rig;
}

// Bearings of every pixel, once.
struct Lens {
  std::vector<Eigen::Vector3d> bearing;
  explicit Lens(const CameraModel& camera) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        Eigen::Vector3d b;
        if (!camera.unproject({x, y}, b)) b.setZero();
        bearing.push_back(b);
      }
    }
  }
};

// World axes are those of the first left camera; the wall is the plane z = kWall.
struct Scene {
  Rig rig;
  Texture texture{77, 40};
  Lens lens;
  explicit Scene(CameraKind kind = CameraKind::kPinholeRadtan) : rig(makeRig(kind)), lens(rig.camera[0]) {}

  [[nodiscard]] SE3 pose(std::size_t k) const {
    const double t = 0.05 * static_cast<double>(k);
    const SE3 T_world_cam0(expSo3({0.15 * std::sin(t), 0.2 * std::sin(0.8 * t), 0.25 * t}),
                           {0.5 * std::sin(t), 0.3 * t, 0.2 * std::sin(1.3 * t)});
    return T_world_cam0 * rig.T_body_cam[0].inverse();
  }
  [[nodiscard]] Canvas image(std::size_t k, std::size_t c) const {
    const SE3 T_world_cam = pose(k) * rig.T_body_cam[c];
    const Eigen::Matrix3d R = T_world_cam.R();
    Canvas canvas{kWidth, kHeight, std::vector<std::uint8_t>(static_cast<std::size_t>(kWidth * kHeight))};
    Random random(2 * k + c);
    for (std::size_t i = 0; i < canvas.pixels.size(); ++i) {
      const Eigen::Vector3d ray = R * lens.bearing[i];
      const double range = (kWall - T_world_cam.translation.z()) / ray.z();
      const Eigen::Vector3d p = T_world_cam.translation + range * ray;
      const double v = texture.at(p.x() * kFocal / kWall, p.y() * kFocal / kWall) + random.normal();
      canvas.pixels[i] = static_cast<std::uint8_t>(std::clamp(v + 0.5, 0.0, 255.0));
    }
    return canvas;
  }
  [[nodiscard]] Eigen::Vector3d wallPoint(std::size_t k, std::size_t c, const Eigen::Vector2f& pixel) const {
    const SE3 T_world_cam = pose(k) * rig.T_body_cam[c];
    Eigen::Vector3d bearing;
    REQUIRE(rig.camera[c].unproject(pixel.cast<double>(), bearing));
    const Eigen::Vector3d ray = T_world_cam.rotation * bearing;
    return T_world_cam.translation + (kWall - T_world_cam.translation.z()) / ray.z() * ray;
  }
  [[nodiscard]] bool project(std::size_t k, std::size_t c, const Eigen::Vector3d& p,
                             Eigen::Vector2d& pixel) const {
    return rig.camera[c].project((pose(k) * rig.T_body_cam[c]).inverse() * p, pixel);
  }
};

struct Run {
  Scene scene;
  Frontend frontend;
  Duration interval = Duration::fromMilliseconds(50);
  std::size_t last_step = 0;
  std::unique_ptr<FrontendPrediction> prediction = std::make_unique<FrontendPrediction>();
  std::unique_ptr<TrackedFrame> out = std::make_unique<TrackedFrame>();

  explicit Run(CameraKind kind = CameraKind::kPinholeRadtan, FrontendSettings settings = {})
      : scene(kind), frontend(scene.rig, settings) {}

  Status step(std::size_t k, std::array<bool, 2> present = {true, true}, bool dark = false) {
    StereoFrame frame;
    frame.stamp = {static_cast<std::int64_t>(k) * interval.ns};
    frame.index = k;
    std::array<Canvas, 2> canvas{scene.image(k, 0), scene.image(k, 1)};
    for (std::size_t c = 0; c < 2; ++c) {
      if (dark) std::fill(canvas[c].pixels.begin(), canvas[c].pixels.end(), std::uint8_t{2});
      if (present[c]) frame.image[c] = canvas[c].view();
    }
    prediction->has_rotation = k > 0;
    prediction->R_body_prev_body_cur = scene.pose(last_step).rotation.conjugate() * scene.pose(k).rotation;
    last_step = k;
    return frontend.step(frame, *prediction, 100, *out);
  }
};

}  // namespace

TEST_CASE("tracks stay on their landmarks, in both cameras, for either lens") {
  for (const CameraKind kind : {CameraKind::kPinholeRadtan, CameraKind::kEquidistant}) {
    Run run(kind);
    std::map<TrackId, std::pair<std::size_t, Eigen::Vector3d>> landmarks;
    std::vector<double> left;
    std::vector<double> right;
    TrackId highest = 0;
    int keyframes = 0;
    for (std::size_t k = 0; k < 12; ++k) {
      REQUIRE(run.step(k).ok());
      CHECK(run.out->features.size() > 50);
      CHECK(run.out->features.size() <= 100);
      CHECK(run.out->camera_present == std::array<bool, 2>{true, true});
      keyframes += run.out->keyframe ? 1 : 0;
      int stereo = 0;
      for (const TrackedFeature& f : run.out->features) {
        stereo += f.seen[0] && f.seen[1] ? 1 : 0;
        if (landmarks.count(f.id) == 0) {
          CHECK(f.id > highest);  // never reused
          const std::size_t c = f.seen[0] ? 0 : 1;
          landmarks[f.id] = {k, run.scene.wallPoint(k, c, f.pixel[c])};
        }
        for (std::size_t c = 0; c < 2; ++c) {
          Eigen::Vector2d pixel;
          if (!f.seen[c]) continue;
          REQUIRE(run.scene.project(k, c, landmarks[f.id].second, pixel));
          (c == 0 ? left : right).push_back((pixel - f.pixel[c].cast<double>()).norm());
        }
      }
      for (const auto& [id, landmark] : landmarks) highest = std::max(highest, id);
      CHECK(stereo > 35);
    }
    CHECK(keyframes >= 2);
    CHECK(keyframes < 12);
    CHECK(quantile(left, 0.5) < 0.06);
    CHECK(quantile(left, 0.98) < 0.5);
    CHECK(quantile(right, 0.5) < 0.08);
    CHECK(quantile(right, 0.98) < 0.6);
  }
}

TEST_CASE("the same frames give the same tracks") {
  Run a;
  Run b;
  for (std::size_t k = 0; k < 4; ++k) {
    REQUIRE(a.step(k).ok());
    REQUIRE(b.step(k).ok());
    REQUIRE(a.out->features.size() == b.out->features.size());
    for (std::size_t i = 0; i < a.out->features.size(); ++i) {
      CHECK(a.out->features[i].id == b.out->features[i].id);
      CHECK(a.out->features[i].seen == b.out->features[i].seen);
      CHECK(a.out->features[i].pixel[0] == b.out->features[i].pixel[0]);
    }
  }
}

TEST_CASE("frames without images or of the wrong size are refused, with nothing changed") {
  Run run;
  REQUIRE(run.step(0).ok());
  const std::size_t features = run.out->features.size();
  StereoFrame frame;
  CHECK(run.frontend.step(frame, *run.prediction, 100, *run.out).code == StatusCode::kInvalidInput);
  const Canvas small = draw(Texture(1), 100, 100);
  frame.image[0] = small.view();
  CHECK(run.frontend.step(frame, *run.prediction, 100, *run.out).code == StatusCode::kInvalidInput);
  REQUIRE(run.step(1).ok());
  CHECK(run.out->features.size() > features * 8 / 10);
}

TEST_CASE("a camera that goes and comes back") {
  Run run;
  for (std::size_t k = 0; k < 3; ++k) REQUIRE(run.step(k).ok());
  std::map<TrackId, bool> before;
  for (const TrackedFeature& f : run.out->features) before[f.id] = f.seen[0];
  // One missing left image: its features are held and followed when it is back.
  REQUIRE(run.step(3, {false, true}).ok());
  CHECK(run.out->camera_present == std::array<bool, 2>{false, true});
  for (const TrackedFeature& f : run.out->features) CHECK_FALSE(f.seen[0]);
  CHECK(run.out->features.size() > 30);
  REQUIRE(run.step(4).ok());
  int held = 0;
  for (const TrackedFeature& f : run.out->features)
    held += f.seen[0] && before.count(f.id) > 0 && before[f.id] ? 1 : 0;
  CHECK(held > 40);
  // A long absence: the other camera carries on alone, with features of its own.
  for (std::size_t k = 5; k < 14; ++k) {
    REQUIRE(run.step(k, {false, true}).ok());
    CHECK(run.out->features.size() > 30);
  }
  for (std::size_t k = 14; k < 22; ++k) REQUIRE(run.step(k).ok());
  int stereo = 0;
  for (const TrackedFeature& f : run.out->features) stereo += f.seen[0] && f.seen[1] ? 1 : 0;
  CHECK(stereo > 35);
}

TEST_CASE("tracks go on in the images of a slow camera, and after a lost one") {
  for (const std::int64_t ms : {150, 200, 260, 500, 900}) {
    CAPTURE(ms);
    Run run;
    run.interval = Duration::fromMilliseconds(ms);
    std::set<TrackId> before;
    for (const std::size_t k : {0, 1, 2, 3, 5, 6}) {  // the fifth is lost
      REQUIRE(run.step(k).ok());
      std::size_t common = 0;
      for (const TrackedFeature& f : run.out->features) common += before.count(f.id);
      if (k > 0) CHECK(10 * common > 6 * before.size());
      before.clear();
      for (const TrackedFeature& f : run.out->features) before.insert(f.id);
    }
  }
}

TEST_CASE("dark images count as absent, and landmarks are found again by projection") {
  Run run;
  for (std::size_t k = 0; k < 3; ++k) REQUIRE(run.step(k).ok());
  std::map<TrackId, Eigen::Vector3d> landmarks;
  for (const TrackedFeature& f : run.out->features) {
    if (f.seen[0]) landmarks[f.id] = run.scene.wallPoint(2, 0, f.pixel[0]);
  }
  for (std::size_t k = 3; k < 9; ++k) {
    REQUIRE(run.step(k, {true, true}, true).ok());
    CHECK(run.out->camera_present == std::array<bool, 2>{false, false});
    CHECK(run.out->features.empty());
  }
  for (const auto& [id, p] : landmarks) {
    PredictedLandmark landmark;
    landmark.id = id;
    landmark.gate = 4;
    for (std::size_t c = 0; c < 2; ++c) {
      Eigen::Vector2d pixel;
      landmark.visible[c] = run.scene.project(9, c, p, pixel) && run.scene.rig.camera[c].inImage(pixel, 10);
      landmark.pixel[c] = (pixel + Eigen::Vector2d(1.0, -1.2)).cast<float>();
    }
    REQUIRE(run.prediction->landmarks.tryPushBack(landmark));
  }
  REQUIRE(run.step(9).ok());
  std::vector<double> errors;
  for (const TrackedFeature& f : run.out->features) {
    Eigen::Vector2d pixel;
    if (landmarks.count(f.id) == 0 || !f.seen[0] || !run.scene.project(9, 0, landmarks[f.id], pixel))
      continue;
    errors.push_back((pixel - f.pixel[0].cast<double>()).norm());
  }
  REQUIRE(errors.size() > 40);
  CHECK(quantile(errors, 0.5) < 0.12);
  CHECK(quantile(errors, 0.95) < 0.5);
}

TEST_CASE("reset forgets the tracks and goes on counting ids") {
  Run run;
  REQUIRE(run.step(0).ok());
  TrackId highest = 0;
  for (const TrackedFeature& f : run.out->features) highest = std::max(highest, f.id);
  run.frontend.reset();
  REQUIRE(run.step(1).ok());
  CHECK(run.out->keyframe);
  for (const TrackedFeature& f : run.out->features) CHECK(f.id > highest);
}

TEST_CASE(
    "a camera that is turned by half a degree is matched once the extrinsics are known to be uncertain") {
  const auto stereo = [](double turn_deg, bool said) {
    Run run;
    Rig given = run.scene.rig;
    given.T_body_cam[1].rotation =
        given.T_body_cam[1].rotation * expSo3(Eigen::Vector3d(1, 0.5, 0) * turn_deg * M_PI / 180);
    run.frontend = Frontend(given, {});
    run.prediction->has_extrinsics = said;
    run.prediction->T_body_cam = given.T_body_cam;
    run.prediction->stereo_rotation_sigma = 0.014;
    REQUIRE(run.step(0).ok());
    // Of a match the true place in camera 1 is that of the point on the wall.
    int right = 0;
    for (const TrackedFeature& f : run.out->features) {
      if (!f.seen[0] || !f.seen[1]) continue;
      Eigen::Vector2d pixel;
      const Eigen::Vector3d point = run.scene.wallPoint(0, 0, f.pixel[0]);
      right +=
          run.scene.project(0, 1, point, pixel) && (pixel.cast<float>() - f.pixel[1]).norm() < 0.5F ? 1 : 0;
    }
    return right;
  };
  const int given = stereo(0, false);
  const int silent = stereo(0.5, false);
  const int said = stereo(0.5, true);
  INFO("matched: " << given << " as given, " << silent << " turned, " << said << " with a wider search");
  CHECK(given > 40);
  CHECK(silent < given / 4);
  CHECK(said > 0.7 * given);
}
