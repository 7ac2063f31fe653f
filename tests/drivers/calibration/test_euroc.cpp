// Dialects of sensor.yaml, and an IMU that is turned or moved in the body.

#include "estimator/geometry/so3.hpp"
#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

using test::edited;
using test::errorOf;
using test::EurocTexts;

bool sameRig(const Rig& a, const Rig& b) {
  bool same = a.camera_count == b.camera_count;
  for (std::size_t i = 0; same && i < a.camera_count; ++i) {
    same = a.camera[i].intrinsics() == b.camera[i].intrinsics() &&
           a.camera[i].distortion() == b.camera[i].distortion() &&
           (a.T_body_cam[i].inverse() * b.T_body_cam[i]).translation.norm() < 1e-12 &&
           logSo3((a.T_body_cam[i].inverse() * b.T_body_cam[i]).rotation).norm() < 1e-12;
  }
  return same;
}

std::string withCrLf(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\n' ? std::string("\r\n") : std::string(1, c);
  return out;
}

TEST_CASE("dialects of sensor.yaml read the same", "[calibration]") {
  const Rig reference = EurocTexts().parse().rig;
  EurocTexts texts;
  SECTION("without OpenCV's first line") { texts.cam0 = edited(texts.cam0, "%YAML:1.0\n", ""); }
  SECTION("OpenCV's first line and a document start") {
    texts.cam0 = edited(texts.cam0, "%YAML:1.0\n", "%YAML:1.0\n---\n");
  }
  SECTION("OpenCV's matrix tag") {
    texts.cam0 = edited(texts.cam0, "T_BS:\n  cols: 4\n  rows: 4\n",
                        "T_BS: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: d\n");
  }
  SECTION("CRLF") {
    texts.cam0 = withCrLf(texts.cam0);
    texts.cam1 = withCrLf(texts.cam1);
    texts.imu = withCrLf(texts.imu);
  }
  SECTION("byte order mark") { texts.imu = "\xEF\xBB\xBF" + texts.imu; }
  SECTION("synonym of the lens model") { texts.cam0 = edited(texts.cam0, "radial-tangential", "radtan"); }
  SECTION("a fifth coefficient of zero") {
    texts.cam0 = edited(texts.cam0, "1.76187114e-05]", "1.76187114e-05, 0.0]");
  }
  SECTION("no T_BS in the IMU file") {
    texts.imu = texts.imu.substr(0, texts.imu.find("T_BS")) + texts.imu.substr(texts.imu.find("rate_hz"));
  }
  CHECK(sameRig(texts.parse().rig, reference));
}

TEST_CASE("a sensor.yaml may say how the camera's clock lies", "[calibration]") {
  EurocTexts texts;
  texts.cam0 += "timeshift_cam_imu: 0.004\n";
  texts.cam1 += "timeshift_cam_imu: 0.006\n";
  CHECK(texts.parse().rig.camera_to_imu_shift.ns == 5'000'000);
  texts.cam1 = edited(texts.cam1, "0.006", "6.0");
  const InputError error = errorOf([&] { static_cast<void>(texts.parse()); });
  CHECK(error.field == "timeshift_cam_imu");
  CHECK(test::contains(error.remedy, "milliseconds"));
}

TEST_CASE("a sensor.yaml may say that the shutter rolls", "[calibration]") {
  EurocTexts texts;
  const std::string cam0 = texts.cam0;
  const std::string cam1 = texts.cam1;
  const auto with = [&](const std::string& lines0, const std::string& lines1) {
    texts.cam0 = cam0 + lines0;
    texts.cam1 = cam1 + lines1;
  };
  CHECK_FALSE(texts.parse().rig.rolls());
  with("shutter: global\n", "");
  CHECK_FALSE(texts.parse().rig.rolls());
  with("shutter: rolling\nreadout_ms: 20\n", "readout_ms: 20.05\n");
  const Calibration rolling = texts.parse();
  CHECK(rolling.rig.readout.ns == 20'000'000);
  CHECK(rolling.rig.rowTime(0, 0) == Approx(-0.010));
  CHECK(rolling.rig.rowTime(1, 479) == Approx(0.010));
  CHECK(test::contains(describe(rolling), "20.000 ms readout"));

  const auto error = [&] { return errorOf([&] { static_cast<void>(texts.parse()); }); };
  with("shutter: rolling\n", "shutter: rolling\n");
  CHECK(error().field == "readout_ms");
  with("shutter: rolled\n", "");
  CHECK(error().field == "shutter");
  with("readout_ms: 20000\n", "readout_ms: 20000\n");
  CHECK(error().field == "readout_ms");
  with("readout_ms: 20\n", "readout_ms: 30\n");
  CHECK(test::contains(error().remedy, "same shutter"));
}

TEST_CASE("an equidistant lens is read as one", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "radial-tangential", "equidistant");
  texts.cam0 = edited(texts.cam0, "[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]",
                      "[-0.01, 0.005, -0.002, 0.0003]");
  const Calibration calibration = texts.parse();
  CHECK(calibration.rig.camera[0].kind() == CameraKind::kEquidistant);
  Eigen::Vector2d pixel;
  REQUIRE(calibration.rig.camera[0].project({0.3, -0.2, 1.0}, pixel));
  CHECK((pixel - Eigen::Vector2d(499.12542, 160.69510)).norm() < 1e-5);
}

TEST_CASE("one camera makes a mono rig", "[calibration]") {
  const EurocTexts texts;
  const Calibration calibration =
      parseEurocCalibration({{"cam0.yaml", texts.cam0}}, {"imu0.yaml", texts.imu});
  CHECK(calibration.rig.camera_count == 1);
}

TEST_CASE("an IMU turned and moved in the body keeps what the camera and the IMU measure", "[calibration]") {
  // The body's point p seen by camera and IMU must not depend on how the file expresses the rig.
  EurocTexts texts;
  texts.imu =
      edited(texts.imu, "[1.0, 0.0, 0.0, 0.0,\n         0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,",
             "[0.0, -1.0, 0.0, 0.1,\n         1.0, 0.0, 0.0, 0.2,\n         0.0, 0.0, 1.0, -0.3,");
  const Calibration moved = texts.parse();
  const Calibration plain = EurocTexts().parse();
  REQUIRE(moved.turnsImu());
  CHECK(moved.R_body_imu.isApprox((Eigen::Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished()));
  const SE3 T_filebody_body = moved.T_body_filebody.inverse();
  CHECK(T_filebody_body.translation.isApprox(Eigen::Vector3d(0.1, 0.2, -0.3)));
  for (std::size_t i = 0; i < 2; ++i) {
    // The camera in the file's body is what the file says, whichever way round the IMU sits.
    const SE3 T_filebody_cam = T_filebody_body * moved.rig.T_body_cam[i];
    CHECK((T_filebody_cam.translation - plain.rig.T_body_cam[i].translation).norm() < 1e-12);
  }
  CHECK(moved.rig.baseline() == Approx(plain.rig.baseline()).epsilon(1e-12));
  CHECK(test::anyContains(moved.warnings, "rotated to body axes"));
  CHECK(test::anyContains(moved.warnings, "0.3742 m"));
}

}  // namespace
}  // namespace swiftlet
