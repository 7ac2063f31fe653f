// ROS camera_info, OpenCV, Basalt, and Kalibr's models beside pinhole: published calibrations, and what is
// refused.

#include <numbers>

#include "drivers/calibration/camera_info.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::contains;
using test::edited;
using test::errorOf;

constexpr const char* kImu =
    "update_rate: 200\ngyroscope_noise_density: 2e-4\ngyroscope_random_walk: 2e-5\n"
    "accelerometer_noise_density: 2e-3\naccelerometer_random_walk: 3e-3\n"
    "T_imu_cam0: [[1, 0, 0, 0.02], [0, 1, 0, 0.01], [0, 0, 1, 0], [0, 0, 0, 1]]\n";

/// A pair whose rectified cameras are turned by `turn` about y from the raw ones.
std::string cameraInfo(bool right, double turn = 0.1, const std::string& model = "plumb_bob",
                       const std::string& D = "-0.28, 0.07, 0.0002, 0.00002, 0.0") {
  const double c = std::cos(turn);
  const double s = std::sin(turn);
  char text[1200];
  std::snprintf(
      text, sizeof text,
      "image_width: 752\nimage_height: 480\ncamera_name: %s\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [458.0, 0.0, 367.0, 0.0, 457.0, 248.0, 0.0, 0.0, 1.0]\n"
      "distortion_model: %s\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [%s]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [%.17g, 0, %.17g, 0, 1, 0, %.17g, 0, %.17g]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [430.0, 0, 370.0, %.17g, 0, 430.0, 245.0, 0, 0, 0, "
      "1, 0]\n",
      right ? "right" : "left", model.c_str(), D.c_str(), c, s, -s, c, right ? -430 * 0.11 : 0.0);
  return text;
}

Calibration fromRos(const std::vector<std::string>& cameras, const std::string& imu = kImu) {
  std::vector<NamedText> named;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    named.push_back({"cam" + std::to_string(i) + ".yaml", cameras[i]});
  return parseCameraInfoCalibration(named, {"imu.yaml", imu});
}

TEST_CASE("camera_info: a pair in any order, raw and rectified", "[calibration]") {
  const std::string left = cameraInfo(false);
  const std::string right = cameraInfo(true);
  for (const bool swapped : {false, true}) {
    const Calibration calibration = swapped ? fromRos({right, left}) : fromRos({left, right});
    const Rig& rig = calibration.rig;
    CHECK(calibration.form == "ROS CameraInfo");
    REQUIRE(rig.camera_count == 2);
    CHECK(rig.camera[0].kind() == CameraKind::kPinholeRadtan);
    CHECK(rig.camera[0].intrinsics() == Eigen::Vector4d(458, 457, 367, 248));
    CHECK(rig.camera[0].distortion() == Eigen::Vector4d(-0.28, 0.07, 0.0002, 0.00002));
    CHECK(calibration.conversion[0].empty());
    CHECK(rig.baseline() == Approx(0.11));
    // Both raw cameras are turned alike, and the baseline lies along the rectified x.
    const SE3 T_c1_c0 = rig.T_cam1_cam0();
    CHECK(T_c1_c0.R().isIdentity(1e-12));
    CHECK(T_c1_c0.translation.isApprox(Eigen::Vector3d(-0.11 * std::cos(0.1), 0, -0.11 * std::sin(0.1)),
                                       1e-12));
    CHECK(rig.T_body_cam[0].translation.isApprox(Eigen::Vector3d(0.02, 0.01, 0)));
  }
  const Calibration rectified = fromRos({left, right}, std::string(kImu) + "images: rectified\n");
  CHECK(rectified.rig.camera[1].intrinsics() == Eigen::Vector4d(430, 430, 370, 245));
  CHECK(rectified.rig.camera[1].distortion().isZero(0));
  CHECK(rectified.rig.T_cam1_cam0().translation.isApprox(Eigen::Vector3d(-0.11, 0, 0), 1e-12));
  CHECK(fromRos({left}).rig.camera_count == 1);
  CHECK(fromRos({cameraInfo(false, 0, "equidistant", "0.01, 0.002, -0.001, 0.0003")}).rig.camera[0].kind() ==
        CameraKind::kEquidistant);
}

TEST_CASE("camera_info: lenses with k3 or a denominator are converted, and the line says how well",
          "[calibration]") {
  // A phone's camera, as its driver published it.
  std::string phone = cameraInfo(false, 0, "rational_polynomial",
                                 "0.09370951394834764, -0.1640721737187069, 0, 0, 0.1224192868301668");
  phone = edited(phone, "image_width: 752", "image_width: 1920");
  phone = edited(phone, "image_height: 480", "image_height: 1080");
  phone = edited(phone, "458.0, 0.0, 367.0, 0.0, 457.0, 248.0",
                 "1484.120151053405, 0.0, 982.1869163422028, 0.0, 1483.296808359715, 543.0569322723705");
  const Calibration calibration = fromRos({phone});
  CHECK(contains(calibration.conversion[0], "rational_polynomial as equidistant: 0.0"));
  CHECK(contains(describe(calibration), "converted, rational_polynomial as"));

  // An OAK's preview: numerator and denominator of the sixth order.
  std::string oak =
      cameraInfo(false, 0, "rational_polynomial",
                 "-4.860828876495361, 17.2819766998291, 0.00020376102474983782, "
                 "0.0010251018684357405, -25.172250747680664, -4.943647384643555, 17.51442527770996, "
                 "-25.290760040283203");
  oak = edited(oak, "image_width: 752", "image_width: 250");
  oak = edited(oak, "image_height: 480", "image_height: 250");
  oak = edited(oak, "458.0, 0.0, 367.0, 0.0, 457.0, 248.0",
               "196.50531005859375, 0.0, 126.86713409423828, 0.0, 196.50531005859375, 125.84786987304688");
  const InputError error = errorOf([&] { fromRos({oak}); });
  CHECK(contains(error.message, "above 0.3 px RMS it is rejected"));
  CHECK(contains(error.remedy, "pinhole-radtan"));
}

TEST_CASE("camera_info: faults are refused by name", "[calibration]") {
  const std::string left = cameraInfo(false);
  const std::string right = cameraInfo(true);
  const auto refused = [&](const std::string& from, const std::string& to) {
    return errorOf([&] { fromRos({edited(left, from, to), right}); });
  };
  CHECK(refused("image_width: 752\n", "").field == "image_width");
  CHECK(contains(refused("image_width: 752", "image_width: 752.5").message, "752.5 x 480"));
  CHECK(contains(refused("0.0002, 0.00002, 0.0]", "0.0002]").message, "3 numbers"));
  CHECK(contains(refused("plumb_bob", "scaramuzza").message, "scaramuzza"));
  CHECK(contains(refused("458.0, 0.0, 367.0", "458.0, 0.3, 367.0").message, "skew of 0.3 px"));
  CHECK(contains(refused("458.0, 0.0, 367.0, 0.0, 457.0", "0.6, 0.0, 367.0, 0.0, 0.6").remedy, "in pixels"));
  CHECK(contains(
      refused("458.0, 0.0, 367.0, 0.0, 457.0, 248.0, 0.0, 0.0, 1.0", "0, 0, 0, 0, 0, 0, 0, 0, 0").message,
      "not calibrated"));
  CHECK(contains(
      refused("458.0, 0.0, 367.0, 0.0, 457.0, 248.0", "916.0, 0.0, 734.0, 0.0, 914.0, 496.0").message,
      "principal point"));
  CHECK(contains(refused("rows: 3\n  cols: 3\n  data: [458.0, 0.0, ", "data: [458.0, ").message,
                 "3x3 matrix has 9"));
  const InputError turned = errorOf([&] { fromRos({left, edited(right, ", 0, 1, 0, ", ", 0, 1.01, 0, ")}); });
  CHECK(contains(turned.message, "not orthonormal"));
  // Centimetres.
  const InputError centimetres = errorOf([&] {
    fromRos({left, edited(right, "370.0, -47.", "370.0, -3247.")});
  });
  CHECK(contains(centimetres.message, "a baseline of 7."));
  CHECK(contains(centimetres.remedy, "centimetres (OAK)"));
  // Two cameras that were not calibrated as a pair need the second place.
  CHECK(errorOf([&] { fromRos({left, left}); }).field == "T_imu_cam1");
  CHECK(fromRos({left, left},
                std::string(kImu) +
                    "T_imu_cam1: [[1, 0, 0, 0.12], [0, 1, 0, 0.01], [0, 0, 1, 0], [0, 0, 0, 1]]\n")
            .rig.baseline() == Approx(0.1));
  CHECK(errorOf([&] {
          fromRos({left, right}, std::string(kImu) + "T_imu_cam1: []\n");
        }).field == "T_imu_cam1");
  const InputError no_place = errorOf([&] {
    const std::string imu(kImu);
    fromRos({left, right}, imu.substr(0, imu.find("T_imu_cam0")));
  });
  CHECK(no_place.field == "T_imu_cam0");
  CHECK(contains(no_place.remedy, "four rows"));
  CHECK(errorOf([&] { fromRos({left, right}, std::string(kImu) + "images: bent\n"); }).field == "images");
}

TEST_CASE("CameraInfo messages: both lenses of a topic", "[calibration]") {
  CameraInfo info;
  info.width = 752;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.D = {-0.05, 0.06, 0.0002, 0.0003, -0.02};
  info.K = {458, 0, 367, 0, 457, 248, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {430, 0, 370, -47.3, 0, 430, 245, 0, 0, 0, 1, 0};
  Warnings warnings;
  CHECK(rawLens(info, "/left/camera_info", warnings).width() == 752);
  CHECK(anyContains(warnings, "/left/camera_info: plumb_bob as "));
  CHECK(rectifiedLens(info, "/left/camera_info", warnings).intrinsics() ==
        Eigen::Vector4d(430, 430, 370, 245));
  CHECK(rectifiedPair(info, "x").translation.isApprox(Eigen::Vector3d(-0.11, 0, 0)));
  info.P[3] = 0;
  CHECK(errorOf([&] { (void)rectifiedPair(info, "/right/camera_info"); }).field == "P");
  info.D.clear();
  CHECK(rawLens(info, "x", warnings).distortion().isZero(0));
  info.D = {0.1, std::nan(""), 0, 0};
  CHECK(errorOf([&] { (void)rawLens(info, "x", warnings); }).field == "D");
}

constexpr const char* kOpenCvLenses =
    "%YAML:1.0\n---\nimage_size: [ 752, 480 ]\n"
    "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 458., 0., 367., 0., 457., 248., 0., "
    "0., 1. ]\n"
    "D1: !!opencv-matrix\n   rows: 1\n   cols: 14\n   dt: d\n"
    "   data: [ -0.28, 0.07, 0.0002, 0.00002, 0., 0., 0., 0., 0., 0., 0., 0., 0., 0. ]\n"
    "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 456., 0., 379., 0., 455., 255., 0., "
    "0., 1. ]\n"
    "D2: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.28, 0.07, 0.0002, 0.00002, 0. ]\n";
constexpr const char* kOpenCvPair =
    "%YAML:1.0\n---\nR: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 0., 0., 0., 1., "
    "0., 0., 0., 1. ]\n"
    "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ -0.11, 0.001, 0.002 ]\n";

Calibration fromOpenCv(const std::string& lenses, const std::string& pair = kOpenCvPair) {
  return parseOpenCvCalibration({{"intrinsics.yml", lenses}, {"extrinsics.yml", pair}}, {"imu.yaml", kImu});
}

TEST_CASE("OpenCV's files of a pair, of one camera and of a fisheye", "[calibration]") {
  const Calibration pair = fromOpenCv(kOpenCvLenses);
  CHECK(pair.form == "OpenCV");
  REQUIRE(pair.rig.camera_count == 2);
  CHECK(pair.rig.T_cam1_cam0().translation.isApprox(Eigen::Vector3d(-0.11, 0.001, 0.002), 1e-12));
  CHECK(pair.rig.camera[1].intrinsics() == Eigen::Vector4d(456, 455, 379, 255));
  CHECK(pair.warnings.empty());

  const std::string single =
      "image_width: 640\nimage_height: 480\n"
      "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 300., 0., 320., 0., "
      "300., 240., 0., "
      "0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 0.01, 0.002, "
      "-0.001, 0.0003 "
      "]\n";
  const auto one = [](const std::string& text) {
    return parseOpenCvCalibration({{"camera.yml", text}}, {"imu.yaml", kImu});
  };
  CHECK(one(single).rig.camera[0].kind() == CameraKind::kPinholeRadtan);
  CHECK(anyContains(one(single).warnings, "fisheye_model: 1"));
  const Calibration fisheye = one("fisheye_model: 1\n" + single);
  CHECK(fisheye.rig.camera[0].kind() == CameraKind::kEquidistant);
  CHECK(fisheye.warnings.empty());
}

TEST_CASE("OpenCV: faults are refused by name", "[calibration]") {
  const std::string lenses(kOpenCvLenses);
  const InputError size = errorOf([&] { fromOpenCv(edited(lenses, "image_size: [ 752, 480 ]\n", "")); });
  CHECK(contains(size.message, "image size is missing"));
  CHECK(contains(size.remedy, "image_size: [width, height]"));
  CHECK(
      contains(errorOf([&] { fromOpenCv("<?xml version=\"1.0\"?>\n<opencv_storage/>\n"); }).remedy, ".yml"));
  CHECK(errorOf([&] { fromOpenCv(edited(lenses, "D1:", "D9:")); }).field == "M1");
  CHECK(contains(errorOf([&] { fromOpenCv(edited(lenses, "0.00002, 0. ]", "0.00002, 0., 0. ]")); }).message,
                 "6 numbers, expected 4, 5, 8, 12 or 14"));
  // Millimetres, and board squares.
  CHECK(contains(errorOf([&] { fromOpenCv(lenses, edited(kOpenCvPair, "-0.11, 0.001", "-110, 1")); }).remedy,
                 "millimetres"));
  CHECK(contains(
      errorOf([&] { fromOpenCv(lenses, edited(kOpenCvPair, "-0.11, 0.001", "-3.34, 0.01")); }).remedy,
      "board squares"));
  CHECK(contains(errorOf([&] { fromOpenCv(lenses, edited(kOpenCvPair, "[ 1., 0.", "[ 1.1, 0.")); }).message,
                 "not orthonormal"));
  CHECK(errorOf([&] { fromOpenCv(lenses, edited(kOpenCvPair, "R:", "Q:")); }).field == "T_imu_cam1");
}

/// EuRoC's rig as Basalt's authors calibrated it (basalt, data/euroc_ds_calib.json).
constexpr const char* kBasaltEuroc = R"({"value0": {
  "T_imu_cam": [
    {"px": -0.016774788924641534, "py": -0.068938940687127, "pz": 0.005139123188382424,
     "qx": -0.007239825785317818, "qy": 0.007541278561558601, "qz": 0.7017845426564943, "qw": 0.7123125505904486},
    {"px": -0.01507436282032619, "py": 0.0412627204046637, "pz": 0.00316287258752953,
     "qx": -0.0023360576185881625, "qy": 0.013000769689092388, "qz": 0.7024677108343111, "qw": 0.7115930283929829}],
  "intrinsics": [
    {"camera_type": "ds", "intrinsics": {"fx": 349.7560023050409, "fy": 348.72454229977037,
     "cx": 365.89440762590149, "cy": 249.32995565708704, "xi": -0.2409573942178872, "alpha": 0.566996899163044}},
    {"camera_type": "ds", "intrinsics": {"fx": 361.6713883800533, "fy": 360.5856493689301,
     "cx": 379.40818394080869, "cy": 255.9772968522045, "xi": -0.21300835384809328, "alpha": 0.5767008625037023}}],
  "resolution": [[752, 480], [752, 480]],
  "calib_accel_bias": [0.001725405479279035, 0.1500005286487319, 0.06708820471592454, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
  "imu_update_rate": 200.0, "accel_noise_std": 0.016, "gyro_noise_std": 0.000282, "accel_bias_std": 0.001,
  "gyro_bias_std": [0.0001, 0.00011, 0.0001], "cam_time_offset_ns": 0}})";

double degreesBetween(const SE3& a, const SE3& b) {
  return logSo3((a.inverse() * b).rotation).norm() * 180 / std::numbers::pi;
}

TEST_CASE("Basalt's calibration of EuRoC beside EuRoC's own", "[calibration]") {
  const Calibration basalt = parseBasaltCalibration({"basalt.json", kBasaltEuroc});
  const Rig own = test::EurocTexts().parse().rig;
  CHECK(basalt.form == "Basalt");
  CHECK(basalt.warnings.empty());
  CHECK(basalt.noise.accel_density == 0.016);
  CHECK(basalt.noise.gyro_walk == 0.00011);
  CHECK(basalt.rig.baseline() == Approx(0.11023).margin(5e-6));
  constexpr std::array<double, 2> kTurned = {0.34, 0.27};  // deg
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(degreesBetween(own.T_body_cam[i], basalt.rig.T_body_cam[i]) == Approx(kTurned[i]).margin(0.005));
    CHECK((own.T_body_cam[i].translation - basalt.rig.T_body_cam[i].translation).norm() ==
          Approx(8.0e-3).margin(2.5e-4));
    CHECK(contains(basalt.conversion[i], "ds as equidistant: 0.000 px RMS"));
  }
}

TEST_CASE("Basalt: other lenses, the time offset's sign, scale and misalignment", "[calibration]") {
  std::string text(kBasaltEuroc);
  // T265 (basalt, data/t265_kb4_calib.json).
  text =
      edited(text, R"("camera_type": "ds", "intrinsics": {"fx": 349.7560023050409, "fy": 348.72454229977037,
     "cx": 365.89440762590149, "cy": 249.32995565708704, "xi": -0.2409573942178872, "alpha": 0.566996899163044})",
             R"("camera_type": "kb4", "intrinsics": {"fx": 286.60144163375528, "fy": 286.4617087423328,
     "cx": 422.2765876951761, "cy": 395.2246466040553, "k1": -0.006762412326815424, "k2": 0.04517028332572,
     "k3": -0.04351516727821064, "k4": 0.008374959821591333})");
  text = edited(text, "[752, 480]", "[848, 800]");
  text = edited(text, "\"cam_time_offset_ns\": 0", "\"cam_time_offset_ns\": 2124029");
  text = edited(text, "0.06708820471592454, 0.0,", "0.06708820471592454, 0.016180888150195365,");
  const Calibration calibration = parseBasaltCalibration({"basalt.json", text});
  CHECK(calibration.rig.camera[0].kind() == CameraKind::kEquidistant);
  CHECK(calibration.conversion[0].empty());
  CHECK(calibration.rig.camera[0].distortion()[1] == 0.04517028332572);
  CHECK(calibration.rig.camera_to_imu_shift.ns == 2124029);
  CHECK(anyContains(calibration.warnings, "calib_accel_bias: scale and misalignment of up to 1.6 %"));

  const auto lens = [](const std::string& type, const std::string& last) {
    std::string basalt(kBasaltEuroc);
    for (int i = 0; i < 2; ++i)
      basalt = edited(basalt, "\"camera_type\": \"ds\"", "\"camera_type\": \"" + type + "\"");
    basalt = edited(basalt, "\"xi\": -0.2409573942178872, \"alpha\": 0.566996899163044", last);
    basalt = edited(basalt, "\"xi\": -0.21300835384809328, \"alpha\": 0.5767008625037023", last);
    basalt = edited(edited(basalt, "349.756", "459.756"), "348.724", "458.724");
    basalt = edited(edited(basalt, "361.671", "459.671"), "360.585", "458.585");
    return parseBasaltCalibration({"basalt.json", basalt});
  };
  CHECK(contains(lens("eucm", R"("alpha": 0.59, "beta": 1.127)").conversion[0],
                 "eucm as equidistant: 0.000 px"));
  CHECK(contains(lens("ucm", R"("alpha": 0.59)").conversion[0], "ucm as equidistant: 0.000 px"));
  CHECK(contains(lens("fov", R"("w": 0.93)").conversion[1], "fov as equidistant: 0.000 px"));
  CHECK(lens("pinhole", R"("w": 0)").rig.camera[0].distortion().isZero(0));
  CHECK(lens("pinhole-radtan8",
             R"("k1": -0.28, "k2": 0.07, "p1": 0, "p2": 0, "k3": 0, "k4": 0, "k5": 0, "k6": 0)")
            .rig.camera[0]
            .distortion()[0] == -0.28);
}

TEST_CASE("Basalt: faults are refused by name, with their line", "[calibration]") {
  const auto refused = [](const std::string& from, const std::string& to) {
    return errorOf([&] { parseBasaltCalibration({"basalt.json", edited(kBasaltEuroc, from, to)}); });
  };
  CHECK(contains(refused("\"ds\"", "\"mei\"").message, "`mei` is not supported"));
  CHECK(refused("\"ds\"", "\"mei\"").line == 8);
  CHECK(contains(refused("\"qw\": 0.7123125505904486", "\"qw\": 0.9").message, "unit length"));
  CHECK(contains(refused("\"px\": -0.016774788924641534", "\"px\": -16.77").remedy, "millimetres"));
  CHECK(contains(refused("[[752, 480], [752, 480]]", "[[752, 480]]").message, "2 lenses, 1 resolutions"));
  CHECK(contains(refused("\"gyro_noise_std\": 0.000282", "\"gyro_noise_std\": 0").message, "not positive"));
  CHECK(contains(refused("\"xi\": -0.2409573942178872,", "").field, "intrinsics.xi"));
  CHECK(contains(refused("\"alpha\": 0.566996899163044", "\"alpha\": 4").message, "no inverse"));
}

TEST_CASE("Kalibr's models beside pinhole", "[calibration]") {
  const auto lens = [](const std::string& model, const std::string& distortion,
                       const std::string& coefficients, const std::string& intrinsics) {
    test::KalibrTexts texts;
    texts.chain = edited(texts.chain, "camera_model: pinhole", "camera_model: " + model);
    texts.chain = edited(texts.chain, "distortion_model: radtan", "distortion_model: " + distortion);
    texts.chain =
        edited(texts.chain, "distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]",
               "distortion_coeffs: [" + coefficients + "]");
    texts.chain = edited(texts.chain, "intrinsics: [458.654, 457.296, 367.215, 248.375]",
                         "intrinsics: [" + intrinsics + "]");
    return texts.parse();
  };
  // From Kalibr's wiki (Yaml formats), a camera like EuRoC's.
  const Calibration omni = lens("omni", "radtan", "-0.33518750, 0.13211436, 0.00055967, 0.00057686",
                                "0.80065662, 833.006, 830.345, 373.850, 253.749");
  CHECK(contains(omni.conversion[0], "omni-radtan as equidistant: 0.14"));
  CHECK(omni.conversion[1].empty());
  CHECK(contains(lens("ds", "none", "", "-0.24, 0.567, 349.8, 348.7, 365.9, 249.3").conversion[0],
                 "ds-none as equidistant: 0.000 px"));
  CHECK(contains(lens("eucm", "none", "", "0.59, 1.127, 460.8, 459.4, 365.9, 249.3").conversion[0],
                 "eucm-none as equidistant: 0.000 px"));
  CHECK(contains(lens("pinhole", "fov", "0.93", "420, 420, 365.9, 249.3").conversion[0],
                 "fov as equidistant: 0.000 px"));
  CHECK(errorOf([&] { lens("pinhole", "fov", "7", "420, 420, 365.9, 249.3"); }).field ==
        "cam0.distortion_coeffs");
  CHECK(errorOf([&] {
          lens("ds", "radtan", "0, 0, 0, 0", "-0.24, 0.567, 349.8, 348.7, 365.9, 249.3");
        }).field == "cam0.distortion_model");
}

}  // namespace
}  // namespace swiftlet
