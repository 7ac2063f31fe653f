#pragma once
// Seeded two-frame scenes with known motion, true tracks and false ones, for the tests and the
// benchmarks of the geometric verification.

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/ransac.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet::test {

enum class TrackKind { kNear, kFar, kDisplaced, kBehind };

struct SceneSettings {
  std::size_t tracks = 200;
  double far_share = 0.15;        ///< of all: true tracks without parallax (1 to 100 km)
  double displaced_share = 0.30;  ///< of all: false, displaced by 5 to 100 px in the current frame
  double behind_share = 0.05;     ///< of all: false, consistent with a point behind the cameras
  double pixel_sigma = 0.5;
  double min_translation = 0.1;      ///< [m]
  double max_translation = 0.5;      ///< [m]
  double max_rotation = 0.2;         ///< [rad] between the frames
  bool along_epipolar_line = false;  ///< false tracks slide along the line that mono cannot check
};

struct Scene {
  CameraModel camera;
  SE3 T_cam1_cam0;
  SE3 T_cur_prev;
  std::vector<TrackKind> kind;
  std::vector<Eigen::Vector3d> prev;  ///< cam0
  std::vector<Eigen::Vector3d> cur;   ///< cam0

  [[nodiscard]] bool good(std::size_t i) const {
    return kind[i] == TrackKind::kNear || kind[i] == TrackKind::kFar;
  }
};

inline CameraModel euroc() {
  return {CameraKind::kPinholeRadtan,
          752,
          480,
          {458.654, 457.296, 367.215, 248.375},
          {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
}
/// Equidistant without distortion, round image of `fov` degrees across.
inline CameraModel fisheye(double fov) {
  const double focal = 400.0 / (0.5 * fov * std::numbers::pi / 180.0);
  return {CameraKind::kEquidistant, 801, 801, {focal, focal, 400, 400}, Eigen::Vector4d::Zero()};
}

inline Eigen::Vector3d randomUnit(Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

class SceneMaker {
 public:
  SceneMaker(const CameraModel& camera, const SceneSettings& settings, std::uint64_t seed)
      : settings_(settings), random_(seed) {
    scene_.camera = camera;
    const SE3 T_cam0_cam1(expSo3(0.02 * randomUnit(random_)), Eigen::Vector3d(0.11, 0.001, -0.002));
    scene_.T_cam1_cam0 = T_cam0_cam1.inverse();
    const double length = random_.uniform(settings.min_translation, settings.max_translation);
    scene_.T_cur_prev = SE3(expSo3(random_.uniform(0, settings.max_rotation) * randomUnit(random_)),
                            length * randomUnit(random_));
  }

  Scene make() {
    while (scene_.kind.size() < settings_.tracks) {
      const double share = static_cast<double>(scene_.kind.size()) / static_cast<double>(settings_.tracks);
      const double displaced = settings_.displaced_share;
      const double behind = displaced + settings_.behind_share;
      const TrackKind kind = share < displaced                      ? TrackKind::kDisplaced
                             : share < behind                       ? TrackKind::kBehind
                             : share < behind + settings_.far_share ? TrackKind::kFar
                                                                    : TrackKind::kNear;
      tryTrack(kind);
    }
    return scene_;
  }

 private:
  using Pixels = std::array<Eigen::Vector2d, 4>;  // prev left, prev right, cur left, cur right

  [[nodiscard]] bool visible(const Eigen::Vector2d& pixel) const {
    if (!scene_.camera.inImage(pixel, 2)) return false;
    return scene_.camera.kind() == CameraKind::kPinholeRadtan ||
           (pixel - scene_.camera.intrinsics().tail<2>()).norm() < 398;
  }

  bool see(const Eigen::Vector3d& bearing, Eigen::Vector2d& pixel) const {
    return scene_.camera.project(bearing, pixel) && visible(pixel);
  }

  void tryTrack(TrackKind kind) {
    Eigen::Vector2d pixel(random_.uniform(0, scene_.camera.width()),
                          random_.uniform(0, scene_.camera.height()));
    Eigen::Vector3d bearing;
    if (!visible(pixel) || !scene_.camera.unproject(pixel, bearing)) return;
    // Uniform in the logarithm: as many points between 1 and 2 m as between 10 and 20 m.
    double distance = std::exp(random_.uniform(0.0, std::log(20.0)));
    if (kind == TrackKind::kFar) distance = random_.uniform(1e3, 1e5);
    const double side = kind == TrackKind::kBehind ? -1.0 : 1.0;
    const Eigen::Vector3d point = side * distance * bearing;
    const Eigen::Vector3d moved = scene_.T_cur_prev * point;
    const std::array<Eigen::Vector3d, 4> rays = {point, scene_.T_cam1_cam0 * point, moved,
                                                 scene_.T_cam1_cam0 * moved};
    Pixels pixels;
    for (std::size_t i = 0; i < 4; ++i) {
      if (!see(side * rays[i], pixels[i])) return;
    }
    if (kind == TrackKind::kBehind) {
      // Only a reversed motion of at least 5 px can be told from no motion.
      Eigen::Vector2d still;
      if (!see(scene_.T_cur_prev.rotation * bearing, still) || (still - pixels[2]).norm() < 5) return;
    }
    for (Eigen::Vector2d& p : pixels) {
      p += settings_.pixel_sigma * Eigen::Vector2d(random_.normal(), random_.normal());
    }
    if (kind == TrackKind::kDisplaced && !displace(pixels, bearing)) return;
    keep(kind, pixels);
  }

  // Both cameras follow the false match, or cam0 alone.
  bool displace(Pixels& pixels, const Eigen::Vector3d& bearing) {
    const double angle = random_.uniform(0, 2 * std::numbers::pi);
    Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    if (settings_.along_epipolar_line) {
      Eigen::Vector2d still;
      if (!see(scene_.T_cur_prev.rotation * bearing, still) || (pixels[2] - still).norm() < 5) return false;
      direction = (pixels[2] - still).normalized() * (random_.uniform() < 0.5 ? -1.0 : 1.0);
    }
    const Eigen::Vector2d by = random_.uniform(5, 100) * direction;
    pixels[2] += by;
    if (random_.uniform() < 0.5) pixels[3] += by;
    return visible(pixels[2]) && visible(pixels[3]);
  }

  void keep(TrackKind kind, const Pixels& pixels) {
    std::array<Eigen::Vector3d, 4> seen;
    for (std::size_t i = 0; i < 4; ++i) {
      if (!scene_.camera.unproject(pixels[i], seen[i])) return;
    }
    scene_.kind.push_back(kind);
    scene_.prev.push_back(seen[0]);
    scene_.cur.push_back(seen[2]);
  }

  SceneSettings settings_;
  Random random_;
  Scene scene_;
};

inline Scene makeScene(const CameraModel& camera, const SceneSettings& settings, std::uint64_t seed) {
  return SceneMaker(camera, settings, seed).make();
}

}  // namespace swiftlet::test
