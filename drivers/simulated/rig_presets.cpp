#include "drivers/simulated/rig_presets.hpp"

#include <array>
#include <numbers>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// A camera mounted `aside` metres to the left, looking forward and `down` rad downward.
SE3 forwardCamera(double aside, double down) {
  Eigen::Matrix3d R_flu_cam;
  R_flu_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // columns: right, down, forward
  const Eigen::Quaterniond pitch = expSo3(down * Eigen::Vector3d::UnitY());
  return SE3(pitch * Eigen::Quaterniond(R_flu_cam), {0.06, aside, 0.02});
}

MountedRig eurocRig() {
  MountedRig mounted;
  mounted.R_flu_body = eurocBodyAxes();
  Rig& rig = mounted.rig;
  rig.camera_count = 2;
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 752, 480, {458.654, 457.296, 367.215, 248.375},
                              {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05});
  rig.camera[1] = CameraModel(CameraKind::kPinholeRadtan, 752, 480, {457.587, 456.134, 379.999, 255.238},
                              {-0.28368365, 0.07451284, -0.00010473, -3.555907e-05});
  Eigen::Matrix3d R0;
  R0 << 0.0148655429818, -0.999880929698, 0.00414029679422, 0.999557249008, 0.0149672133247, 0.025715529948,
      -0.0257744366974, 0.00375618835797, 0.999660727178;
  Eigen::Matrix3d R1;
  R1 << 0.0125552670891, -0.999755099723, 0.0182237714554, 0.999598781151, 0.0130119051815, 0.0251588363115,
      -0.0253898008918, 0.0179005838253, 0.999517347078;
  rig.T_body_cam[0] = SE3(R0, {-0.0216401454975, -0.064676986768, 0.00981073058949});
  rig.T_body_cam[1] = SE3(R1, {-0.0198435579556, 0.0453689425024, 0.00786212447038});
  return mounted;
}

MountedRig pairInAirframe(const CameraModel& left, const CameraModel& right, double baseline, double down) {
  MountedRig mounted;
  mounted.rig.camera_count = 2;
  mounted.rig.camera = {left, right};
  mounted.rig.T_body_cam = {forwardCamera(0.5 * baseline, down), forwardCamera(-0.5 * baseline, down)};
  // Real cameras are never mounted exactly parallel.
  mounted.rig.T_body_cam[1].rotation = mounted.rig.T_body_cam[1].rotation * expSo3({0.004, -0.006, 0.003});
  return mounted;
}

}  // namespace

const char* rigName(RigKind kind) {
  static constexpr std::array<const char*, 6> kNames{"euroc",   "forward",        "wide",
                                                     "fisheye", "random_pinhole", "random_fisheye"};
  return kNames[static_cast<std::size_t>(kind)];
}

MountedRig makeRig(RigKind kind) {
  using std::numbers::pi;
  const auto radtan = CameraKind::kPinholeRadtan;
  const auto equidistant = CameraKind::kEquidistant;
  switch (kind) {
    case RigKind::kEuroc:
      return eurocRig();
    case RigKind::kForward:
      return pairInAirframe(
          CameraModel(radtan, 640, 400, {410.2, 409.7, 322.4, 197.1}, {-0.21, 0.041, 3e-4, -2e-4}),
          CameraModel(radtan, 640, 400, {411.5, 411.1, 317.0, 203.8}, {-0.208, 0.040, -2e-4, 1e-4}), 0.08,
          15 * pi / 180);
    case RigKind::kWide:
      return pairInAirframe(
          CameraModel(equidistant, 640, 480, {281.3, 281.0, 318.2, 243.5}, {-0.012, 0.004, -0.003, 5e-4}),
          CameraModel(equidistant, 640, 480, {280.6, 280.4, 322.9, 236.8}, {-0.011, 0.003, -0.002, 4e-4}),
          0.10, 10 * pi / 180);
    case RigKind::kFisheye:
    case RigKind::kRandomPinhole:
    case RigKind::kRandomFisheye:
      break;
  }
  // 640 pixels over 180 degrees; the image circle just touches the sides.
  const MountedRig straight = pairInAirframe(
      CameraModel(equidistant, 640, 480, {203.1, 203.0, 320.3, 241.2}, {0.003, -0.002, 6e-4, -1e-4}),
      CameraModel(equidistant, 640, 480, {202.8, 202.9, 318.6, 238.7}, {0.002, -0.001, 4e-4, -8e-5}), 0.10,
      0.0);
  return turnImu(straight, expSo3({0.7, -1.1, 0.4}));
}

MountedRig mountForward(const Rig& rig) {
  MountedRig mounted;
  mounted.rig = rig;
  mounted.R_flu_body = forwardCamera(0, 0).rotation * rig.T_body_cam[0].rotation.conjugate();
  return mounted;
}

MountedRig turnImu(const MountedRig& mounted, const Eigen::Quaterniond& R_flu_body) {
  MountedRig turned = mounted;
  turned.R_flu_body = R_flu_body;
  const SE3 T_new_old(R_flu_body.conjugate() * mounted.R_flu_body, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < turned.rig.camera_count; ++i) {
    turned.rig.T_body_cam[i] = T_new_old * mounted.rig.T_body_cam[i];
  }
  return turned;
}

}  // namespace swiftlet
