// A folder of numbered pictures, without IMU or calibration, from the pictures to Kalibr's file.
#include <catch2/catch.hpp>

#include <cmath>
#include <filesystem>
#include <string>

#include "drivers/recorded/image_files.hpp"
#include "firmware_host/lab/calibrate/board/log_views.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "tests/firmware_host/calibrate/board_image.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

TEST_CASE("pictures without anything else give the lens") {
  ScratchFolder folder("bare_log");
  const std::string pictures = folder.file("cam0/data");
  std::filesystem::create_directories(pictures);
  const CalibrationTarget target{TargetKind::kAprilGrid, 4, 4, 0.08, 0, 0.3};
  const PrintedBoard board(target, target.size / 10);
  const CameraModel camera(CameraKind::kPinholeRadtan, 480, 360, {330, 331, 236, 183},
                           {-0.2, 0.05, 0.0005, -0.0003});
  Random random(5);
  constexpr int kPictures = 20;
  for (int i = 0; i < kPictures; ++i) {
    const Eigen::Quaterniond facing(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
    const double axis = random.uniform(0, 2 * M_PI);
    const Eigen::Quaterniond tilt(
        Eigen::AngleAxisd(random.uniform(0.3, 0.8), Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)));
    const SE3 T(facing * tilt, Eigen::Vector3d::Zero());
    const Eigen::Vector3d middle(0.2, 0.2, 0);
    const Eigen::Vector3d place(random.uniform(-0.25, 0.25), random.uniform(-0.18, 0.18),
                                random.uniform(0.45, 0.7));
    const GreyImage image =
        renderBoard(board, camera, SE3(T.rotation, place - T.rotation * middle), 0.7, 2, random);
    writePng8(pictures + "/frame_" + std::to_string(100 + i) + ".png", image.pixels.data(), image.width,
              image.height);
  }
  LogViewsRequest request;
  request.log = folder.path();
  request.target = target;
  const LogViews log = readLogViews(request);
  CHECK(log.camera_count == 1);
  CHECK(log.image_size[0] == Eigen::Vector2i(480, 360));
  CHECK(log.images[0] == kPictures);
  CHECK(log.with_board[0] >= kPictures - 2);
  CHECK(log.views.front().stamp.ns == 100'000'000'000);
  CHECK(log.samples.empty());

  CameraInput input;
  input.target = target;
  input.views = log.views;
  input.image_size = log.image_size;
  const CameraSolution solution = calibrateCameras(input);
  CHECK(solution.camera[0].model.kind() == CameraKind::kPinholeRadtan);
  CHECK((solution.camera[0].model.intrinsics() - camera.intrinsics()).cwiseAbs().maxCoeff() < 1);
  CHECK(solution.corner_sigma < 0.1);
}
