// Kalibr's directions, nestings and variants.

#include "estimator/geometry/so3.hpp"
#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

using test::chainCamera;
using test::edited;
using test::errorOf;
using test::flowRows;
using test::KalibrTexts;

double gap(const SE3& a, const SE3& b) {
  const SE3 d = a.inverse() * b;
  return std::max(d.translation.norm(), logSo3(d.rotation).norm());
}

struct TwoCameras {
  Rig rig = test::EurocTexts().parse().rig;
  std::string T_cam_imu(std::size_t i) const {
    return "  T_cam_imu:\n" + flowRows(rig.T_body_cam[i].inverse());
  }
  std::string T_imu_cam(std::size_t i) const { return "  T_imu_cam:\n" + flowRows(rig.T_body_cam[i]); }
  std::string T_cn_cnm1() const { return "  T_cn_cnm1:\n" + flowRows(rig.T_cam1_cam0()); }
  void check(const std::string& chain) const {
    const Rig got = parseKalibrCalibration({"chain.yaml", chain}, {"imu.yaml", KalibrTexts().imu}).rig;
    REQUIRE(got.camera_count == 2);
    CHECK(gap(got.T_body_cam[0], rig.T_body_cam[0]) < 1e-10);
    CHECK(gap(got.T_body_cam[1], rig.T_body_cam[1]) < 1e-10);
  }
};

TEST_CASE("every way to write the extrinsics gives the same rig", "[calibration]") {
  const TwoCameras c;
  SECTION("T_cam_imu twice") { c.check(chainCamera(0, c.T_cam_imu(0)) + chainCamera(1, c.T_cam_imu(1))); }
  SECTION("the chain forward") { c.check(chainCamera(0, c.T_cam_imu(0)) + chainCamera(1, c.T_cn_cnm1())); }
  SECTION("the chain backward") {
    c.check(chainCamera(0, "") + chainCamera(1, c.T_cam_imu(1) + c.T_cn_cnm1()));
  }
  SECTION("T_imu_cam") { c.check(chainCamera(0, c.T_imu_cam(0)) + chainCamera(1, c.T_imu_cam(1))); }
  SECTION("both kinds mixed") { c.check(chainCamera(0, c.T_imu_cam(0)) + chainCamera(1, c.T_cam_imu(1))); }
  SECTION("both kinds for one camera") {
    c.check(chainCamera(0, c.T_imu_cam(0) + c.T_cam_imu(0)) + chainCamera(1, c.T_cn_cnm1()));
  }
}

TEST_CASE("a chain that contradicts itself is refused with both names", "[calibration]") {
  const TwoCameras c;
  SE3 wrong = c.rig.T_cam1_cam0();
  wrong.translation.x() += 1e-5;
  const std::string chain =
      chainCamera(0, c.T_cam_imu(0)) + chainCamera(1, c.T_cam_imu(1) + "  T_cn_cnm1:\n" + flowRows(wrong));
  const InputError error = errorOf([&] {
    parseKalibrCalibration({"chain.yaml", chain}, {"imu.yaml", KalibrTexts().imu});
  });
  CHECK(error.field == "cam1.T_cn_cnm1");
  CHECK(error.line > 17);
  CHECK(test::contains(error.message, "cam0.T_cam_imu"));
  CHECK(test::contains(error.message, "cam1.T_cam_imu"));
}

TEST_CASE("the chain's inverse puts cam1 on the wrong side, which is said", "[calibration]") {
  const TwoCameras c;
  const std::string chain = chainCamera(0, c.T_cam_imu(0)) +
                            chainCamera(1, "  T_cn_cnm1:\n" + flowRows(c.rig.T_cam1_cam0().inverse()));
  const Calibration calibration =
      parseKalibrCalibration({"chain.yaml", chain}, {"imu.yaml", KalibrTexts().imu});
  CHECK(test::anyContains(calibration.warnings, "cam1 is to the left of cam0"));
}

TEST_CASE("extrinsics that are nowhere are asked for", "[calibration]") {
  const TwoCameras c;
  const InputError error = errorOf([&] {
    parseKalibrCalibration({"chain.yaml", chainCamera(0, "") + chainCamera(1, c.T_cn_cnm1())},
                           {"imu.yaml", KalibrTexts().imu});
  });
  CHECK(error.field == "cam0");
  CHECK(test::contains(error.remedy, "camera-IMU step"));
}

TEST_CASE("the IMU file is read flat and nested", "[calibration]") {
  KalibrTexts texts;
  std::string nested =
      "imu0:\n  T_i_b:\n  - [1.0, 0.0, 0.0, 0.0]\n  - [0.0, 1.0, 0.0, 0.0]\n"
      "  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  model: calibrated\n  time_offset: 0.0\n";
  std::size_t begin = 0;
  while (begin < texts.imu.size()) {
    const std::size_t end = texts.imu.find('\n', begin);
    nested += "  " + texts.imu.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  KalibrTexts other;
  other.imu = nested;
  CHECK(other.parse().noise.gyro_density == texts.parse().noise.gyro_density);
  CHECK(other.parse().noise.rate_hz == 200);

  SECTION("another model is refused") {
    other.imu = edited(nested, "model: calibrated", "model: scale-misalignment-size-effect");
    const InputError error = errorOf([&] { (void)other.parse(); });
    CHECK(error.field == "imu0.model");
    CHECK(error.line == 7);
  }
  SECTION("an IMU that is not the body is refused") {
    other.imu = edited(nested, "[1.0, 0.0, 0.0, 0.0]", "[1.0, 0.0, 0.0, 0.02]");
    CHECK(errorOf([&] { (void)other.parse(); }).field == "imu0.T_i_b");
    other.imu = edited(nested, "time_offset: 0.0", "time_offset: 0.01");
    CHECK(errorOf([&] { (void)other.parse(); }).field == "imu0.time_offset");
  }
  SECTION("scale and misalignment, from true to measured") {
    other.imu = edited(nested, "model: calibrated", "model: scale-misalignment") +
                "  accelerometers:\n    M:\n    - [1.01, 0.0, 0.0]\n    - [0.002, 0.99, 0.0]\n"
                "    - [-0.003, 0.004, 1.0]\n"
                "  gyroscopes:\n    A:\n    - [0.0001, 0.0, 0.0]\n    - [0.0, 0.0, 0.0]\n"
                "    - [0.0, -0.0002, 0.0]\n"
                "    C_gyro_i:\n    - [0.9999500004, -0.0099998333, 0.0]\n"
                "    - [0.0099998333, 0.9999500004, 0.0]\n    - [0.0, 0.0, 1.0]\n"
                "    M:\n    - [1.02, 0.0, 0.0]\n    - [0.001, 1.0, 0.0]\n    - [0.0, 0.0, 0.98]\n";
    const Calibration calibration = other.parse();
    CHECK(calibration.hasImuMatrices());
    // A sensor with these errors, by Kalibr's model, its biases zero.
    const Eigen::Vector3d rate(0.3, -1.1, 0.7);
    const Eigen::Vector3d force(-2.0, 4.0, 9.0);
    const Eigen::Vector3d turned(0.9999500004 * 0.3 + 0.0099998333 * 1.1,
                                 0.0099998333 * 0.3 - 0.9999500004 * 1.1, 0.7);
    ImuSample sample;
    sample.accel = {1.01 * -2.0, 0.002 * -2.0 + 0.99 * 4.0, -0.003 * -2.0 + 0.004 * 4.0 + 9.0};
    sample.gyro = {1.02 * turned.x() + 0.0001 * -2.0, 0.001 * turned.x() + turned.y(),
                   0.98 * 0.7 - 0.0002 * 4.0};
    const ImuSample reading = sample;
    calibration.imuCorrection().apply(sample);
    CHECK((sample.gyro - rate).norm() < 1e-9);
    CHECK((sample.accel - force).norm() < 1e-12);
    calibration.imuCorrection().inverse().apply(sample);
    CHECK((sample.gyro - reading.gyro).norm() < 1e-12);
    CHECK((sample.accel - reading.accel).norm() < 1e-12);

    other.imu = edited(other.imu, "[1.01, 0.0, 0.0]", "[0.0, 1.0, 0.0]");
    CHECK(errorOf([&] { (void)other.parse(); }).field == "imu0.accelerometers.M");
  }
  SECTION("OpenVINS' matrices are Kalibr's under other names") {
    const std::string identity = "  Tw:\n  - [1.0, 0.0, 0.0]\n  - [0.0, 1.0, 0.0]\n  - [0.0, 0.0, 1.0]\n";
    other.imu = edited(nested, "model: calibrated", "model: kalibr") + identity;
    CHECK(!other.parse().hasImuMatrices());
    other.imu = edited(other.imu, "[0.0, 1.0, 0.0]\n  - [0.0, 0.0, 1.0]\n",
                       "[0.0, 1.01, 0.0]\n  - [0.0, 0.0, 1.0]\n");
    CHECK(other.parse().gyro_matrix(1, 1) == 1.01);
    other.imu = edited(other.imu, "[0.0, 1.01, 0.0]", "[0.0, -1.0, 0.0]");
    CHECK(errorOf([&] { (void)other.parse(); }).field == "imu0.Tw");
  }
}

TEST_CASE("time shifts: unit and difference are watched", "[calibration]") {
  KalibrTexts texts;
  SECTION("cameras that differ") {
    texts.chain = edited(texts.chain, "timeshift_cam_imu: 0.00135", "timeshift_cam_imu: 0.0025");
    const Calibration calibration = texts.parse();
    CHECK(test::anyContains(calibration.warnings, "differs by 1.250 ms"));
    CHECK(calibration.rig.camera_to_imu_shift.ns == 1'875'000);
  }
  SECTION("milliseconds") {
    texts.chain = edited(texts.chain, "timeshift_cam_imu: 0.00125", "timeshift_cam_imu: 1.25");
    const InputError error = errorOf([&] { (void)texts.parse(); });
    CHECK(error.field == "cam0.timeshift_cam_imu");
    CHECK(error.line == 14);
  }
  SECTION("negative") {
    texts.chain = edited(texts.chain, "timeshift_cam_imu: 0.00125", "timeshift_cam_imu: -0.00125");
    texts.chain = edited(texts.chain, "timeshift_cam_imu: 0.00135", "timeshift_cam_imu: -0.00125");
    CHECK(texts.parse().rig.camera_to_imu_shift.ns == -1'250'000);
  }
}

TEST_CASE("models without a projection are refused by name", "[calibration]") {
  KalibrTexts texts;
  texts.chain = edited(texts.chain, "camera_model: pinhole", "camera_model: scaramuzza");
  InputError error = errorOf([&] { (void)texts.parse(); });
  CHECK(error.field == "cam0.camera_model");
  CHECK(test::contains(error.message, "scaramuzza"));
  texts = KalibrTexts();
  texts.chain = edited(texts.chain, "camera_model: pinhole", "camera_model: omni");
  error = errorOf([&] { (void)texts.parse(); });
  CHECK(error.field == "cam0.intrinsics");
  CHECK(test::contains(error.remedy, "xi, fu, fv, cu, cv"));
  texts = KalibrTexts();
  texts.chain = edited(texts.chain, "distortion_model: radtan", "distortion_model: equidistant7");
  CHECK(errorOf([&] { (void)texts.parse(); }).field == "cam0.distortion_model");
  texts = KalibrTexts();
  texts.chain = edited(texts.chain, "distortion_model: radtan", "distortion_model: none");
  CHECK(texts.parse().rig.camera[0].distortion().isZero(0));
}

}  // namespace
}  // namespace swiftlet
