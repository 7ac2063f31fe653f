// What a reader can catch by itself: each case names file, line and field.

#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::contains;
using test::edited;
using test::errorOf;
using test::EurocTexts;
using test::KalibrTexts;

constexpr const char* kData0 =
    "[0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n"
    "         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n"
    "         -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n"
    "         0, 0, 0, 1]";

/// T_BS of both cameras replaced.
EurocTexts withTransforms(const SE3& T0, const SE3& T1) {
  EurocTexts texts;
  const auto replace = [](std::string& text, const SE3& T) {
    const std::size_t begin = text.find("T_BS:");
    const std::size_t end = text.find("rate_hz");
    text = text.substr(0, begin) + "T_BS:\n" + test::flowRows(T) + text.substr(end);
  };
  replace(texts.cam0, T0);
  replace(texts.cam1, T1);
  return texts;
}

TEST_CASE("both matrices inverted: refused, naming the line; accepted on demand", "[calibration]") {
  const Rig rig = EurocTexts().parse().rig;
  const EurocTexts texts = withTransforms(rig.T_body_cam[0].inverse(), rig.T_body_cam[1].inverse());
  const InputError error = errorOf([&] { (void)texts.parse(); });
  CHECK(error.file == "cam1.yaml");
  CHECK(error.line == 4);
  CHECK(error.field == "T_BS");
  CHECK(contains(error.message, "inverted transform"));
  CalibrationOptions accept;
  accept.accept_unusual_rig = true;
  CHECK(anyContains(texts.parse(accept).warnings, "are not side by side"));
}

TEST_CASE("Kalibr's matrices inverted are refused as well", "[calibration]") {
  const Rig rig = EurocTexts().parse().rig;
  std::string chain;
  for (int i = 0; i < 2; ++i) {
    chain +=
        test::chainCamera(i, "  T_cam_imu:\n" + test::flowRows(rig.T_body_cam[static_cast<std::size_t>(i)]));
  }
  const InputError error = errorOf([&] {
    parseKalibrCalibration({"chain.yaml", chain}, {"imu.yaml", KalibrTexts().imu});
  });
  CHECK(error.field == "cam1.T_cam_imu");
  CHECK(contains(error.message, "inverted transform"));
}

TEST_CASE("a rig whose axes are the body's, inverted: said", "[calibration]") {
  const SE3 left(Eigen::Quaterniond::Identity(), {0.05, 0, 0});
  const SE3 right(Eigen::Quaterniond::Identity(), {-0.05, 0, 0});
  CHECK(anyContains(withTransforms(left, right).parse().warnings, "to the left"));
  CHECK(withTransforms(right, left).parse().warnings.empty());
}

TEST_CASE("a real vertical pair is taken with a warning", "[calibration]") {
  const SE3 top(Eigen::Quaterniond::Identity(), {0, -0.05, 0});
  const SE3 bottom(Eigen::Quaterniond::Identity(), {0, 0.05, 0});
  CHECK(anyContains(withTransforms(top, bottom).parse().warnings, "are not side by side"));
}

TEST_CASE("both cameras in one place are refused", "[calibration]") {
  EurocTexts texts;
  texts.cam1 = texts.cam0;
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "same position"));
}

TEST_CASE("a rotation of few digits is repaired and said, a worse one refused", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "-0.999880929698", "-0.99988");
  const Calibration calibration = texts.parse();
  CHECK(anyContains(calibration.warnings, "cam0.yaml:4: T_BS: the rotation deviates from orthonormal"));
  const Eigen::Matrix3d R = calibration.rig.T_body_cam[0].R();
  CHECK((R.transpose() * R).isIdentity(1e-12));
  texts.cam0 = edited(EurocTexts().cam0, "-0.999880929698", "-0.99");
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "not orthonormal"));
}

TEST_CASE("a mirror is refused", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "0.0148655429818, -0.999880929698, 0.00414029679422,",
                      "-0.0148655429818, 0.999880929698, -0.00414029679422,");
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "reflection"));
}

TEST_CASE("a matrix written by columns is refused as that", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, kData0,
                      "[0.0148655429818, 0.999557249008, -0.0257744366974, 0,\n"
                      "-0.999880929698, 0.0149672133247, 0.00375618835797, 0,\n"
                      "0.00414029679422, 0.025715529948, 0.999660727178, 0,\n"
                      "-0.0216401454975, -0.064676986768, 0.00981073058949, 1]");
  // Inside a block map the continuation lines need their indent.
  for (std::size_t at = texts.cam0.find("\n-0."); at != std::string::npos;
       at = texts.cam0.find("\n-0.", at + 5)) {
    texts.cam0.insert(at + 1, "         ");
  }
  texts.cam0 = edited(texts.cam0, "\n0.004", "\n         0.004");
  const InputError error = errorOf([&] { (void)texts.parse(); });
  CHECK(contains(error.message, "stored by columns"));
  CHECK(error.line == 4);
}

TEST_CASE("a last row of anything else is refused", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "0, 0, 0, 1]", "0, 0, 0, 2]");
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "last row"));
  texts.cam0 = edited(EurocTexts().cam0, "0, 0, 0, 1]", "0, 0, 1]");
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "15 numbers"));
}

TEST_CASE("millimetres are refused", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "-0.064676986768", "-64.676986768");
  const InputError error = errorOf([&] { (void)texts.parse(); });
  CHECK(contains(error.remedy, "millimetres"));
}

TEST_CASE("a swapped resolution is refused as that", "[calibration]") {
  EurocTexts texts;
  // 367 is inside 480, so the wider image of another camera shows it.
  texts.cam0 = edited(texts.cam0, "resolution: [752, 480]", "resolution: [480, 1280]");
  texts.cam0 = edited(texts.cam0, "367.215, 248.375", "640.5, 240.5");
  const InputError error = errorOf([&] { (void)texts.parse(); });
  CHECK(error.field == "intrinsics");
  CHECK(contains(error.remedy, "[width, height]"));
  CHECK(error.line == 14);
}

TEST_CASE("intrinsics of another resolution are suspected", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "[458.654, 457.296, 367.215, 248.375]", "[229.327, 228.648, 183.6, 124.2]");
  CHECK(anyContains(texts.parse().warnings, "for this resolution"));
  texts.cam0 = edited(EurocTexts().cam0, "367.215", "1367.215");
  CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "outside the 752x480 image"));
}

TEST_CASE("noise figures in the wrong unit are suspected, zeros refused", "[calibration]") {
  EurocTexts texts;
  texts.imu = edited(texts.imu, "gyroscope_noise_density: 1.6968e-04", "gyroscope_noise_density: 0.5");
  CHECK(anyContains(texts.parse().warnings, "imu0.yaml:12: gyroscope_noise_density: 0.5 rad/s/sqrt(Hz)"));
  texts.imu =
      edited(EurocTexts().imu, "accelerometer_noise_density: 2.0000e-3", "accelerometer_noise_density: 2e-6");
  CHECK(anyContains(texts.parse().warnings, "accelerometer_noise_density"));
  for (const char* zero : {"0", "-1e-4"}) {
    texts.imu = edited(EurocTexts().imu, "1.9393e-05", zero);
    const InputError error = errorOf([&] { (void)texts.parse(); });
    CHECK(error.field == "gyroscope_random_walk");
    CHECK(error.line == 13);
  }
}

TEST_CASE("text, NaN and missing fields name their line", "[calibration]") {
  EurocTexts texts;
  SECTION("text") {
    texts.cam0 = edited(texts.cam0, "457.296", "four");
    const InputError error = errorOf([&] { (void)texts.parse(); });
    CHECK(std::string(error.what()) ==
          "cam0.yaml:14: intrinsics[1]: `four` is not a finite number. Write a decimal number, for example "
          "1.5e-3");
  }
  SECTION("NaN") {
    texts.cam0 = edited(texts.cam0, "457.296", "nan");
    CHECK(errorOf([&] { (void)texts.parse(); }).line == 14);
  }
  SECTION("missing") {
    texts.cam0 = edited(texts.cam0, "intrinsics:", "intrinsic:");
    CHECK(errorOf([&] { (void)texts.parse(); }).field == "intrinsics");
  }
  SECTION("camera file in the IMU's place") {
    texts.imu = texts.cam0;
    CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "camera, not an IMU"));
  }
  SECTION("no YAML") {
    texts.cam0 = "T_BS: [1, 2\nfoo: }";
    const InputError error = errorOf([&] { (void)texts.parse(); });
    CHECK(contains(error.message, "not valid YAML"));
    CHECK(error.line > 0);
  }
  SECTION("empty") {
    texts.cam0 = "";
    CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "not a YAML map"));
  }
  SECTION("brackets without end") {
    texts.cam0 = "a: " + std::string(100000, '[');
    CHECK(contains(errorOf([&] { (void)texts.parse(); }).message, "nested too deep"));
  }
}

TEST_CASE("a lens that folds back inside the image is said", "[calibration]") {
  EurocTexts texts;
  texts.cam0 = edited(texts.cam0, "[-0.28340811, 0.07395907,", "[-0.6, 0.0,");
  CHECK(anyContains(texts.parse().warnings, "no inverse"));
}

}  // namespace
}  // namespace swiftlet
