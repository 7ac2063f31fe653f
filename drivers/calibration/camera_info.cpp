#include "drivers/calibration/camera_info.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {
namespace {

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMatrix34d = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// A skew bends a right angle of the image by skew / fx; calibration tools give exactly zero [px].
constexpr double kMaxSkew = 1e-6;
// Files with few digits are off by 1e-4 or so.
constexpr double kOrthonormal = 1e-3;

/// fx, fy, cx, cy of a K or of P's left part.
Eigen::Vector4d intrinsicsOf(const Eigen::Matrix3d& K, const InputPlace& place) {
  if (!K.allFinite() || K.isZero(0)) {
    throw place.error("the camera is not calibrated", "Calibrate it; drivers send zeros until then");
  }
  if (std::abs(K(0, 1)) > kMaxSkew) {
    throw place.error(fmt::format("skew of {:g} px", K(0, 1)), "Calibrate with skew held at zero");
  }
  if (K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    throw place.error("not a camera matrix", "Write fx 0 cx, 0 fy cy, 0 0 1, row by row");
  }
  return {K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
}

Eigen::Matrix3d rotationOf(const CameraInfo& info, const InputPlace& place) {
  const Eigen::Matrix3d R = Eigen::Map<const RowMatrix3d>(info.R.data());
  if (!(R.transpose() * R).isIdentity(kOrthonormal) || R.determinant() < 0) {
    throw place.error("the rectification is no rotation", "Give all digits of the calibration's result");
  }
  return R;
}

void checkSize(const CameraInfo& info, const std::string& name) {
  checkResolution({name, 0, "width, height"}, info.width, info.height);
}

}  // namespace

LensFit rawLensFit(const CameraInfo& info, const std::string& name, Warnings& warnings) {
  checkSize(info, name);
  SourceLens lens;
  lens.name = info.distortion_model;
  lens.width = info.width;
  lens.height = info.height;
  const InputPlace place{name, 0, "K"};
  lens.intrinsics = intrinsicsOf(Eigen::Map<const RowMatrix3d>(info.K.data()), place);
  const InputPlace distortion{name, 0, "D"};
  for (const double v : info.D) {
    if (!std::isfinite(v)) throw distortion.error("a coefficient is not finite", "Calibrate the camera");
  }
  const std::string& model = info.distortion_model;
  if (model == "equidistant" || model == "fisheye") {
    setEquidistant(distortion, info.D, lens);
  } else if (model == "plumb_bob" || model == "rational_polynomial" || (model.empty() && info.D.empty())) {
    setBrown(distortion, info.D, lens);
  } else {
    throw InputPlace{name, 0, "distortion_model"}.error(
        "`" + model + "` is not supported", "Calibrate as plumb_bob, rational_polynomial or equidistant");
  }
  return acceptLens(place, lens, warnings);
}

CameraModel rawLens(const CameraInfo& info, const std::string& name, Warnings& warnings) {
  const LensFit fit = rawLensFit(info, name, warnings);
  if (!fit.words.empty()) warnings.push_back(name + ": " + fit.words);
  return fit.model;
}

CameraModel rectifiedLens(const CameraInfo& info, const std::string& name, Warnings& warnings) {
  checkSize(info, name);
  const InputPlace place{name, 0, "P"};
  const RowMatrix34d P = Eigen::Map<const RowMatrix34d>(info.P.data());
  const Eigen::Vector4d intrinsics = intrinsicsOf(P.leftCols<3>(), place);
  checkIntrinsics(place, intrinsics, info.width, info.height, warnings);
  return {CameraKind::kPinholeRadtan, info.width, info.height, intrinsics, Eigen::Vector4d::Zero()};
}

SE3 rectifiedPair(const CameraInfo& right, const std::string& name) {
  const double fx = right.P[0];
  const double offset = right.P[3];
  if (!(fx > 0) || offset == 0 || !std::isfinite(offset)) {
    throw InputError(name, 0, "P", "no baseline: P(0,3) of the second camera is -fx times the baseline",
                     "Calibrate both cameras as a stereo pair");
  }
  SE3 T_cam1_cam0;
  T_cam1_cam0.translation.x() = offset / fx;
  return T_cam1_cam0;
}

SE3 rawPair(const CameraInfo& left, const CameraInfo& right, const std::string& name) {
  const InputPlace place{name, 0, "R"};
  const SE3 T_rect0_raw0(rotationOf(left, place), Eigen::Vector3d::Zero());
  const SE3 T_rect1_raw1(rotationOf(right, place), Eigen::Vector3d::Zero());
  return T_rect1_raw1.inverse() * rectifiedPair(right, name) * T_rect0_raw0;
}

}  // namespace swiftlet
