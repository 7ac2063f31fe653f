// One rig in both dialects against the values that both must give.

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

using nlohmann::json;

Eigen::Matrix4d matrixOf(const json& rows) {
  Eigen::Matrix4d T;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) T(r, c) = rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
  }
  return T;
}

Eigen::Matrix4d matrixOf(const SE3& T) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = T.R();
  out.topRightCorner<3, 1>() = T.translation;
  return out;
}

void checkAgainst(const json& expected, const Calibration& calibration) {
  constexpr double kTolerance = 1e-10;
  const Rig& rig = calibration.rig;
  REQUIRE(rig.camera_count == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK((matrixOf(rig.T_body_cam[i]) - matrixOf(expected["T_B_C"][i])).cwiseAbs().maxCoeff() < kTolerance);
    CHECK((matrixOf(rig.T_body_cam[i].inverse()) - matrixOf(expected["T_C_B"][i])).cwiseAbs().maxCoeff() <
          kTolerance);
  }
  CHECK((matrixOf(rig.T_cam1_cam0()) - matrixOf(expected["T_C1_C0"])).cwiseAbs().maxCoeff() < kTolerance);
  CHECK(std::abs(rig.baseline() - expected["baseline_m"].get<double>()) < kTolerance);
  for (const json& point : expected["points"]) {
    const Eigen::Vector3d p_body(point["body"][0], point["body"][1], point["body"][2]);
    for (std::size_t i = 0; i < 2; ++i) {
      Eigen::Vector2d pixel;
      REQUIRE(rig.camera[i].project(rig.T_body_cam[i].inverse() * p_body, pixel));
      const json& truth = point[i == 0 ? "pixel0" : "pixel1"];
      CHECK((pixel - Eigen::Vector2d(truth[0], truth[1])).norm() < 1e-7);
    }
  }
  const json& noise = expected["noise"];
  CHECK(calibration.noise.gyro_density == noise["gyro_density"].get<double>());
  CHECK(calibration.noise.gyro_walk == noise["gyro_walk"].get<double>());
  CHECK(calibration.noise.accel_density == noise["accel_density"].get<double>());
  CHECK(calibration.noise.accel_walk == noise["accel_walk"].get<double>());
  CHECK(calibration.noise.rate_hz == noise["rate_hz"].get<double>());
  CHECK(calibration.warnings.empty());
}

TEST_CASE("the EuRoC form gives the expected rig", "[calibration]") {
  const Calibration calibration = test::EurocTexts().parse();
  checkAgainst(json::parse(test::golden("calib_expected.json")), calibration);
  CHECK(calibration.rig.camera_to_imu_shift.ns == 0);
  CHECK(calibration.camera_rate_hz[0] == 20);
  CHECK(!calibration.turnsImu());
}

TEST_CASE("the Kalibr form gives the expected rig and the mean shift", "[calibration]") {
  const Calibration calibration = test::KalibrTexts().parse();
  const json expected = json::parse(test::golden("calib_expected.json"));
  checkAgainst(expected, calibration);
  CHECK(calibration.rig.camera_to_imu_shift.ns == 1'300'000);
  CHECK(calibration.camera_topic[1] == "/cam1/image_raw");
  CHECK(calibration.imu_topic == "/imu0");
}

TEST_CASE("both forms agree to 1e-10", "[calibration]") {
  const Rig euroc = test::EurocTexts().parse().rig;
  const Rig kalibr = test::KalibrTexts().parse().rig;
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK((matrixOf(euroc.T_body_cam[i]) - matrixOf(kalibr.T_body_cam[i])).cwiseAbs().maxCoeff() < 1e-10);
    CHECK(euroc.camera[i].intrinsics() == kalibr.camera[i].intrinsics());
    CHECK(euroc.camera[i].distortion() == kalibr.camera[i].distortion());
  }
}

TEST_CASE("the description says where the cameras sit and look", "[calibration]") {
  const std::string text = describe(test::EurocTexts().parse());
  CHECK(test::contains(text, "optical axis along body +z"));
  CHECK(test::contains(text, "baseline 0.1101 m; cam1 is to the right of cam0"));
  CHECK(test::contains(text, "0.0024 rad/s per sample"));
}

}  // namespace
}  // namespace swiftlet
