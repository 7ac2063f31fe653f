#pragma once
// Calibration texts for tests, and edits of them.

#include <catch2/catch.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {

inline std::string golden(const std::string& name) {
  const std::filesystem::path path = std::filesystem::path(SWIFTLET_TEST_DATA) / "calibration" / name;
  std::ifstream in(path, std::ios::binary);
  REQUIRE(in);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// `text` with the first `from` replaced by `to`; the test fails when `from` is not there.
inline std::string edited(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  INFO("edit of `" << from << "`");
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

struct EurocTexts {
  std::string cam0 = golden("calib_euroc_cam0_sensor.yaml");
  std::string cam1 = golden("calib_euroc_cam1_sensor.yaml");
  std::string imu = golden("calib_euroc_imu0_sensor.yaml");
  [[nodiscard]] Calibration parse(const CalibrationOptions& options = {}) const {
    return parseEurocCalibration({{"cam0.yaml", cam0}, {"cam1.yaml", cam1}}, {"imu0.yaml", imu}, options);
  }
};

struct KalibrTexts {
  std::string chain = golden("calib_kalibr_camchain.yaml");
  std::string imu = golden("calib_kalibr_imu.yaml");
  [[nodiscard]] Calibration parse(const CalibrationOptions& options = {}) const {
    return parseKalibrCalibration({"chain.yaml", chain}, {"imu.yaml", imu}, options);
  }
};

/// The four rows of a transform as YAML flow lists.
inline std::string flowRows(const SE3& T) {
  const Eigen::Matrix3d R = T.R();
  std::string text;
  char number[40];
  for (int row = 0; row < 4; ++row) {
    text += "  - [";
    for (int col = 0; col < 4; ++col) {
      const double v = row == 3 ? (col == 3) : col == 3 ? T.translation[row] : R(row, col);
      std::snprintf(number, sizeof number, "%.16g", v);
      text += std::string(col > 0 ? ", " : "") + number;
    }
    text += "]\n";
  }
  return text;
}

/// One camera of a Kalibr camchain with the given transform lines under it.
inline std::string chainCamera(int index, const std::string& transforms) {
  return "cam" + std::to_string(index) + ":\n" + transforms +
         "  camera_model: pinhole\n"
         "  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]\n"
         "  distortion_model: radtan\n"
         "  intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
         "  resolution: [752, 480]\n";
}

}  // namespace swiftlet::test
