#include "drivers/calibration/camera_info.hpp"

#include <fmt/format.h>

#include <cmath>

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {
namespace {

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMatrix34d = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

/// T_rectified_raw: from the raw to the rectified camera frame.
SE3 rectification(const CameraInfo& info, const InputPlace& place) {
  Warnings rounding;  // not used: a rectification with few digits is made orthonormal without a warning
  return checkedTransform(place, Eigen::Map<const RowMatrix3d>(info.R.data()), Eigen::Vector3d::Zero(),
                          rounding);
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
  lens.intrinsics = readIntrinsics(place, Eigen::Map<const RowMatrix3d>(info.K.data()));
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
  const Eigen::Vector4d intrinsics = readIntrinsics(place, P.leftCols<3>());
  checkIntrinsics(place, intrinsics, info.width, info.height, warnings);
  return {CameraKind::kPinholeRadtan, info.width, info.height, intrinsics, Eigen::Vector4d::Zero()};
}

SE3 rectifiedPair(const CameraInfo& right, const std::string& name) {
  const double fx = right.P[0];
  const double offset = right.P[3];
  if (!(fx > 0) || offset == 0 || !std::isfinite(offset)) {
    throw InputError(name, 0, "P",
                     "the baseline is missing: P(0,3) of the second camera is -fx times the baseline",
                     "Calibrate both cameras as a stereo pair");
  }
  SE3 T_cam1_cam0;
  T_cam1_cam0.translation.x() = offset / fx;
  return T_cam1_cam0;
}

SE3 rawPair(const CameraInfo& left, const CameraInfo& right, const std::string& name) {
  const InputPlace place{name, 0, "R"};
  return rectification(right, place).inverse() * rectifiedPair(right, name) * rectification(left, place);
}

}  // namespace swiftlet
