// Rectification: rows aligned, depths from disparities, OpenCV's rotation and warp, labels, bad rigs.
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/core/random.hpp"
#include "mapping/depth/stereo_rectification.hpp"
#include "tests/mapping/depth_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::depth_scene;

namespace {

Eigen::Vector2d pinhole(const PinholeIntrinsics& k, const Eigen::Vector3d& p) {
  return {k.fx * p.x() / p.z() + k.cx, k.fy * p.y() / p.z() + k.cy};
}

cv::Mat cameraMatrix(const Eigen::Vector4d& k) {
  return (cv::Mat_<double>(3, 3) << k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1);
}

}  // namespace

TEST_CASE("depth: points lie on one row of the rectified pair, at f b / z") {
  Random random(1);
  for (const CameraKind kind : {CameraKind::kPinholeRadtan, CameraKind::kEquidistant}) {
    const Rig rig = makeRig(kind);
    const StereoRectification rectification(rig);
    REQUIRE(rectification.status().ok());
    const PinholeIntrinsics& k = rectification.intrinsics();
    CHECK(rectification.baseline() == Approx(rig.baseline()));
    for (std::size_t c = 0; c < 2; ++c) {
      const Eigen::Matrix3d R = rectification.R_cam_rectified(c);
      CHECK((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
      CHECK(R.determinant() == Approx(1));
    }
    const SE3 T_cam1_cam0 = rig.T_cam1_cam0();
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p(random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(1, 8));
      const Eigen::Vector3d p_cam0 = rectification.R_cam_rectified(0) * p;
      const Eigen::Vector3d q = rectification.R_cam_rectified(1).transpose() * (T_cam1_cam0 * p_cam0);
      const Eigen::Vector2d left = pinhole(k, p), right = pinhole(k, q);
      CHECK(std::abs(left.y() - right.y()) < 1e-9);
      CHECK(left.x() - right.x() == Approx(k.fx * rectification.baseline() / p.z()));
      CHECK((rig.T_body_cam[0] * p_cam0 - rectification.T_body_camera() * p).norm() < 1e-9);
    }
    // Every rectified pixel sees both raw images, and the field could not be much larger.
    std::size_t uncovered = 0;
    for (std::size_t c = 0; c < 2; ++c) {
      for (std::size_t i = 0; i < k.pixels(); ++i) uncovered += rectification.warp(c).covered(i) ? 0U : 1U;
    }
    CHECK(uncovered == 0);
  }
}

TEST_CASE("depth: the largest field without gaps is taken") {
  const Rig rig = makeRig(CameraKind::kPinholeRadtan);
  const StereoRectification rectification(rig);
  PinholeIntrinsics wider = rectification.intrinsics();
  wider.fx *= 0.97;
  wider.fy *= 0.97;
  std::size_t uncovered = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    const ImageWarp warp(rig.camera[c], rectification.R_cam_rectified(c), wider);
    for (std::size_t i = 0; i < wider.pixels(); ++i) uncovered += warp.covered(i) ? 0U : 1U;
  }
  CHECK(uncovered > 0);
}

TEST_CASE("depth: rotations and warped images are OpenCV's") {
  for (const CameraKind kind : {CameraKind::kPinholeRadtan, CameraKind::kEquidistant}) {
    const Rig rig = makeRig(kind);
    const StereoRectification rectification(rig);
    REQUIRE(rectification.status().ok());
    if (kind == CameraKind::kPinholeRadtan) {
      cv::Mat R, t, R0, R1, P0, P1, Q, d[2];
      cv::eigen2cv(rig.T_cam1_cam0().R(), R);
      cv::eigen2cv(Eigen::Vector3d(rig.T_cam1_cam0().translation), t);
      for (std::size_t c = 0; c < 2; ++c) cv::eigen2cv(rig.camera[c].distortion(), d[c]);
      cv::stereoRectify(cameraMatrix(rig.camera[0].intrinsics()), d[0],
                        cameraMatrix(rig.camera[1].intrinsics()), d[1], {kWidth, kHeight}, R, t, R0, R1, P0,
                        P1, Q, cv::CALIB_ZERO_DISPARITY, 0);
      // OpenCV turns both cameras by half their rotation first: its x axis is the baseline too, its z may
      // differ by a turn about it.
      Eigen::Matrix3d theirs;
      cv::cv2eigen(R0, theirs);
      CHECK(theirs.row(0).dot(rectification.R_cam_rectified(0).col(0)) == Approx(1).margin(1e-9));
      CHECK(theirs.row(2).dot(rectification.R_cam_rectified(0).col(2)) > std::cos(0.01));
    }
    Random random(2);
    cv::Mat raw(kHeight, kWidth, CV_8U);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        raw.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random.below(256));
    }
    cv::GaussianBlur(raw, raw, {0, 0}, 1);
    const PinholeIntrinsics& k = rectification.intrinsics();
    for (std::size_t c = 0; c < 2; ++c) {
      cv::Mat R, d, map_x, map_y, expected, nearest;
      cv::eigen2cv(Eigen::Matrix3d(rectification.R_cam_rectified(c).transpose()), R);
      cv::eigen2cv(rig.camera[c].distortion(), d);
      const cv::Mat K = cameraMatrix(rig.camera[c].intrinsics());
      const cv::Mat P = cameraMatrix({k.fx, k.fy, k.cx, k.cy});
      if (kind == CameraKind::kPinholeRadtan) {
        cv::initUndistortRectifyMap(K, d, R, P, {kWidth, kHeight}, CV_32F, map_x, map_y);
      } else {
        cv::fisheye::initUndistortRectifyMap(K, d, R, P, {kWidth, kHeight}, CV_32F, map_x, map_y);
      }
      cv::remap(raw, expected, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      cv::Mat ours(kHeight, kWidth, CV_8U);
      REQUIRE(rectification.warp(c).warp({raw.data, kWidth, kHeight, kWidth}, ours.data).ok());
      cv::Mat difference;
      cv::absdiff(ours, expected, difference);
      double worst = 0;
      cv::minMaxLoc(difference, nullptr, &worst);
      // OpenCV's own steps are 1/32 px.
      CHECK(worst <= 4);
      CHECK(cv::mean(difference)[0] < 0.5);
      // Labels: the raw pixel nearest to the place, not a mixture.
      REQUIRE(rectification.warp(c).warpLabels({raw.data, kWidth, kHeight, kWidth}, ours.data).ok());
      std::size_t differ = 0;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const float u = map_x.at<float>(y, x), v = map_y.at<float>(y, x);
          const auto close = [](float p) { return std::abs(p - std::floor(p) - 0.5F) < 0.01F; };
          if (close(u) || close(v)) continue;
          const int column = std::clamp(cvRound(u), 0, kWidth - 1),
                    row = std::clamp(cvRound(v), 0, kHeight - 1);
          differ += ours.at<std::uint8_t>(y, x) != raw.at<std::uint8_t>(row, column) ? 1U : 0U;
        }
      }
      CHECK(differ == 0);
    }
  }
}

TEST_CASE("depth: rigs and images that do not fit are refused") {
  Rig rig = makeRig(CameraKind::kPinholeRadtan);
  const auto code = [](const Rig& r) { return StereoRectification(r).status().code; };
  CHECK(code(rig) == StatusCode::kOk);
  rig.camera_count = 1;
  CHECK(code(rig) == StatusCode::kInvalidInput);
  rig = makeRig(CameraKind::kPinholeRadtan);
  rig.T_body_cam[1] = rig.T_body_cam[0];
  CHECK(code(rig) == StatusCode::kInvalidInput);
  rig = makeRig(CameraKind::kPinholeRadtan);
  rig.camera[1] = CameraModel(CameraKind::kPinholeRadtan, 64, 48, {50, 50, 32, 24}, Eigen::Vector4d::Zero());
  CHECK(code(rig) == StatusCode::kInvalidInput);
  rig = makeRig(CameraKind::kPinholeRadtan);
  rig.T_body_cam[1].translation.x() = std::nan("");
  CHECK(code(rig) == StatusCode::kInvalidInput);
  // Back to back.
  rig = makeRig(CameraKind::kPinholeRadtan);
  rig.T_body_cam[1].rotation = rig.T_body_cam[0].rotation * Eigen::Quaterniond(0, 0, 1, 0);
  CHECK(code(rig) == StatusCode::kInvalidInput);

  const StereoRectification rectification(makeRig(CameraKind::kPinholeRadtan));
  Image image, out;
  out.pixels[0] = 9;
  ImageView view = image.view();
  view.width = kWidth - 1;
  CHECK(rectification.warp(0).warp(view, out.pixels.data()).code == StatusCode::kInvalidInput);
  CHECK(rectification.warp(0).warp({}, out.pixels.data()).code == StatusCode::kInvalidInput);
  CHECK(rectification.warp(0).warpLabels(view, out.pixels.data()).code == StatusCode::kInvalidInput);
  CHECK(ImageWarp().warp(image.view(), out.pixels.data()).code == StatusCode::kInvalidInput);
  CHECK(out.pixels[0] == 9);
}
