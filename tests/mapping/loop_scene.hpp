#pragma once
// Keyframes of one made-up place: points around two poses of a body, seen with noise, described by random
// bits.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "mapping/place/place_keyframe.hpp"

namespace swiftlet::loop_scene {

struct SceneSettings {
  int common = 120;               ///< points that both keyframes see
  int alone = 150;                ///< points that only one sees, in each
  double pixel_noise = 0.8;       ///< px, per axis
  double disparity_noise = 0.35;  ///< px; gives the inverse depth's
  double depth_share = 1.0;       ///< of the features that know their depth
  int flipped_bits = 25;          ///< of a descriptor seen again
  double twins = 0;               ///< share of the points alone that look like a common point (false matches)
  double translation = 0.6;       ///< m between the bodies
  double rotation = 0.35;         ///< rad
};

inline Rig makeRig() {
  Rig rig;
  rig.camera_count = 2;
  const Eigen::Vector4d k(458.654, 457.296, 367.215, 248.375);
  const Eigen::Vector4d d(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05);
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 752, 480, k, d);
  rig.camera[1] = rig.camera[0];
  Eigen::Matrix3d R;
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  rig.T_body_cam[0] = SE3(R, Eigen::Vector3d(-0.02, -0.06, 0.01));
  rig.T_body_cam[1] = SE3(R, Eigen::Vector3d(-0.02, 0.05, 0.01));
  return rig;
}

inline Descriptor randomDescriptor(Random& random) {
  Descriptor d;
  for (std::uint64_t& w : d.words) w = (static_cast<std::uint64_t>(random.next()) << 32U) | random.next();
  return d;
}

inline Descriptor flipped(Descriptor d, int bits, Random& random) {
  for (int i = 0; i < bits; ++i) {
    const std::uint32_t bit = random.below(256);
    d.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return d;
}

inline Eigen::Vector3d randomVector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

struct Scene {
  PlaceKeyframe old_keyframe, new_keyframe;
  SE3 T_old_new;  ///< bodies, true
  int common = 0;
};

/// Adds the point to the keyframe when its camera sees it.
inline bool addFeature(const Rig& rig, const SceneSettings& settings, const Eigen::Vector3d& p_cam,
                       const Descriptor& descriptor, Random& random, PlaceKeyframe& keyframe) {
  Eigen::Vector2d pixel;
  if (!rig.camera[0].project(p_cam, pixel)) return false;
  pixel += settings.pixel_noise * Eigen::Vector2d(random.normal(), random.normal());
  Eigen::Vector3d bearing;
  if (!rig.camera[0].inImage(pixel, 20) || !rig.camera[0].unproject(pixel, bearing)) return false;
  PlaceFeature f;
  f.descriptor = descriptor;
  f.pixel = pixel.cast<float>();
  f.bearing = bearing.cast<float>();
  if (random.uniform() < settings.depth_share) {
    const double sigma = std::max(settings.disparity_noise, 0.05) / (rig.camera[0].focal() * rig.baseline());
    const double noise = settings.disparity_noise > 0 ? sigma * random.normal() : 0;
    f.inverse_depth = static_cast<float>(std::max(1.0 / p_cam.norm() + noise, 1e-6));
    f.inverse_depth_sigma = static_cast<float>(sigma);
  }
  return keyframe.features.tryPushBack(f);
}

inline Scene makeScene(const SceneSettings& settings, std::uint64_t seed) {
  Scene scene;
  Random random(seed);
  const Rig rig = makeRig();
  scene.old_keyframe.index = 10 + seed;
  scene.new_keyframe.index = 1000 + seed;
  scene.T_old_new = SE3(expSo3(settings.rotation * randomVector(random).normalized()),
                        settings.translation * randomVector(random).normalized());
  const SE3 T_new_old = rig.T_body_cam[0].inverse() * scene.T_old_new.inverse() * rig.T_body_cam[0];
  const auto somewhere = [&] {
    const double depth = std::exp(random.uniform(std::log(1.2), std::log(9.0)));
    return Eigen::Vector3d(depth * random.uniform(-0.75, 0.75), depth * random.uniform(-0.5, 0.5), depth);
  };
  std::vector<Descriptor> described;
  for (int tries = 0; scene.common < settings.common && tries < 20000; ++tries) {
    const Eigen::Vector3d p = somewhere();
    const Descriptor d = randomDescriptor(random);
    PlaceKeyframe old_keyframe;
    PlaceKeyframe new_keyframe;
    if (!addFeature(rig, settings, p, d, random, old_keyframe)) continue;
    const Descriptor again = flipped(d, settings.flipped_bits, random);
    if (!addFeature(rig, settings, T_new_old * p, again, random, new_keyframe)) continue;
    (void)scene.old_keyframe.features.tryPushBack(old_keyframe.features[0]);
    (void)scene.new_keyframe.features.tryPushBack(new_keyframe.features[0]);
    ++scene.common;
  }
  for (int i = 0; i < settings.alone; ++i) {
    Descriptor d = randomDescriptor(random);
    const Descriptor shared = d;
    const bool twin = random.uniform() < settings.twins;
    (void)addFeature(rig, settings, somewhere(), d, random, scene.old_keyframe);
    d = twin ? flipped(shared, settings.flipped_bits, random) : randomDescriptor(random);
    (void)addFeature(rig, settings, somewhere(), d, random, scene.new_keyframe);
  }
  return scene;
}

/// Error of an estimate in the tangent of relative_pose.hpp: T_estimated (Exp(phi), delta) = T_true.
inline Eigen::Matrix<double, 6, 1> poseError(const SE3& estimated, const SE3& truth) {
  const SE3 difference = estimated.inverse() * truth;
  Eigen::Matrix<double, 6, 1> error;
  error << logSo3(difference.rotation), difference.translation;
  return error;
}

}  // namespace swiftlet::loop_scene
