#pragma once
// A few states with cameras and points in front of them: material for factors, without a flight.

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "drivers/simulated/rig_presets.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet::test {

inline constexpr double kPixelSigma = 0.6;  // of sightings, px

inline Eigen::Vector3d randomVector(Random& random, double scale) {
  return scale * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

/// Equidistant, 220 degrees across: bearings with negative z are in the image.
inline CameraModel wideFisheye() {
  return {CameraKind::kEquidistant, 800, 800, Eigen::Vector4d(200, 201, 399, 402),
          Eigen::Vector4d(-0.01, 0.002, -0.001, 0.0)};
}

/// A sighting with the measured ray `ray` (any length). False outside the lens model.
inline bool sightingOf(const CameraModel& camera, const Eigen::Vector3d& ray, double pixel_sigma,
                       CameraSighting& sighting) {
  Eigen::Vector2d pixel;
  Matrix23d J;
  if (!camera.project(ray.normalized(), pixel, &J)) return false;
  sighting = CameraSighting::of(ray.normalized(), J / pixel_sigma);
  return true;
}

/// W of an ideal lens: `scale` sigmas a radian in every direction.
inline Matrix23d tangentWeight(const Eigen::Vector3d& bearing, double scale) {
  const PointBasis basis = PointBasis::of(bearing);
  Matrix23d W;
  W << scale * basis.b1.transpose(), scale * basis.b2.transpose();
  return W;
}

/// States spread about one place, all looking roughly the same way.
struct WindowScene {
  std::vector<BodyState> states;
  std::vector<RigPose> poses;

  /// A point at `depth` in front of state 0's left camera.
  [[nodiscard]] Eigen::Vector3d inSight(const Rig& rig, double depth, Random& random) const {
    const Eigen::Vector3d ray(random.uniform(-0.3, 0.3), random.uniform(-0.25, 0.25), 1.0);
    return states[0].T_world_body * rig.T_body_cam[0] * Eigen::Vector3d(depth * ray.normalized());
  }

  /// What the states see of `p`, with pixel noise.
  [[nodiscard]] std::vector<Sighting> sightings(const Rig& rig, const Eigen::Vector3d& p, double pixel_sigma,
                                                double noise, Random& random) const {
    std::vector<Sighting> result;
    for (std::size_t k = 0; k < states.size(); ++k) {
      Sighting sighting;
      sighting.slot = static_cast<std::uint32_t>(k);
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        Eigen::Vector2d pixel;
        const Eigen::Vector3d ray = (states[k].T_world_body * rig.T_body_cam[c]).inverse() * p;
        if (!rig.camera[c].project(ray, pixel) || !rig.camera[c].inImage(pixel, 5)) continue;
        pixel += noise * Eigen::Vector2d(random.normal(), random.normal());
        Eigen::Vector3d bearing;
        if (!rig.camera[c].unproject(pixel, bearing)) continue;
        if (!sightingOf(rig.camera[c], bearing, pixel_sigma, sighting.camera[c])) sighting.camera[c] = {};
      }
      if (sighting.camera[0].used || sighting.camera[1].used) result.push_back(sighting);
    }
    return result;
  }
};

/// `spread`: standard deviation of the positions [m]; attitudes differ by some 2 degrees.
inline WindowScene sceneAround(const Rig& rig, std::size_t count, double spread, Random& random) {
  WindowScene scene;
  const Eigen::Quaterniond heading = expSo3(randomVector(random, 1.0));
  const Eigen::Vector3d place = randomVector(random, 5);
  for (std::size_t k = 0; k < count; ++k) {
    BodyState x;
    x.T_world_body = SE3(heading * expSo3(randomVector(random, 0.03)), place + randomVector(random, spread));
    x.v_world_body = randomVector(random, 1);
    scene.states.push_back(x);
    RigPose pose;
    for (std::size_t c = 0; c < rig.camera_count; ++c) {
      pose.current[c] = CameraPose::of(x.T_world_body, rig.T_body_cam[c]);
    }
    pose.linearization = pose.current;
    pose.v_world = x.v_world_body;
    pose.omega_body = randomVector(random, 0.5);
    scene.poses.push_back(pose);
  }
  return scene;
}

}  // namespace swiftlet::test
