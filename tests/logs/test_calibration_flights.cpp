// One recorded flight with its calibration told in every format: what comes out must not depend on the
// format.

#include <catch2/catch.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/long_run.hpp"
#include "tests/support/skip_case.hpp"

#include <fmt/format.h>

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

std::string numbers(const Eigen::MatrixXd& m) {
  std::string text;
  for (Eigen::Index row = 0; row < m.rows(); ++row) {
    for (Eigen::Index col = 0; col < m.cols(); ++col) {
      text += (text.empty() ? "" : ", ") + fmt::format("{:.17g}", m(row, col));
    }
  }
  return text;
}

std::string rows(const SE3& T) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = T.R();
  m.topRightCorner<3, 1>() = T.translation;
  return "[" + numbers(m) + "]";
}

Eigen::Matrix3d cameraMatrix(const CameraModel& lens) {
  const Eigen::Vector4d& k = lens.intrinsics();
  Eigen::Matrix3d K;
  K << k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1;
  return K;
}

/// Noise, and the place of camera 0.
void writeImuFile(const fs::path& folder, const Calibration& c) {
  write(folder / "imu.yaml",
        fmt::format("update_rate: {:g}\ngyroscope_noise_density: {:g}\ngyroscope_random_walk: {:g}\n"
                    "accelerometer_noise_density: {:g}\naccelerometer_random_walk: {:g}\nT_imu_cam0: {}\n",
                    c.noise.rate_hz, c.noise.gyro_density, c.noise.gyro_walk, c.noise.accel_density,
                    c.noise.accel_walk, rows(c.rig.T_body_cam[0])));
}

/// As camera_calibration writes a stereo pair: both cameras turned so that x lies along the baseline.
void writeCameraInfo(const fs::path& folder, const Calibration& c) {
  const SE3 T_c0_c1 = c.rig.T_cam1_cam0().inverse();
  Eigen::Matrix3d R_rect_c0;
  R_rect_c0.row(0) = T_c0_c1.translation.normalized();
  R_rect_c0.row(1) = Eigen::Vector3d::UnitZ().cross(R_rect_c0.row(0).transpose()).normalized();
  R_rect_c0.row(2) = R_rect_c0.row(0).cross(R_rect_c0.row(1));
  const double f = c.rig.camera[0].focal();
  for (std::size_t i = 0; i < 2; ++i) {
    const CameraModel& lens = c.rig.camera[i];
    Eigen::Matrix<double, 3, 4> P = Eigen::Matrix<double, 3, 4>::Zero();
    P.leftCols<3>() << f, 0, 370, 0, f, 245, 0, 0, 1;
    if (i == 1) P(0, 3) = -f * c.rig.baseline();
    const Eigen::Matrix3d R = i == 0 ? R_rect_c0 : Eigen::Matrix3d(R_rect_c0 * T_c0_c1.R());
    write(folder / (i == 0 ? "left.yaml" : "right.yaml"),
          fmt::format(
              "image_width: {}\nimage_height: {}\ncamera_name: {}\ncamera_matrix:\n  rows: 3\n  cols: 3\n  "
              "data: [{}]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  "
              "data: [{}, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [{}]\n"
              "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [{}]\n",
              lens.width(), lens.height(), i == 0 ? "left" : "right", numbers(cameraMatrix(lens)),
              numbers(lens.distortion()), numbers(R), numbers(P)));
  }
  writeImuFile(folder, c);
}

std::string storedMatrix(const char* name, const Eigen::MatrixXd& m) {
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", name,
                     m.rows(), m.cols(), numbers(m));
}

/// As OpenCV's sample of stereo calibration writes, with the size that it leaves out.
void writeOpenCv(const fs::path& folder, const Calibration& c) {
  std::string text = fmt::format("%YAML:1.0\n---\nimage_size: [ {}, {} ]\n", c.rig.camera[0].width(),
                                 c.rig.camera[0].height());
  for (std::size_t i = 0; i < 2; ++i) {
    Eigen::VectorXd D = Eigen::VectorXd::Zero(14);
    D.head<4>() = c.rig.camera[i].distortion();
    text += storedMatrix(i == 0 ? "M1" : "M2", cameraMatrix(c.rig.camera[i]));
    text += storedMatrix(i == 0 ? "D1" : "D2", D.transpose());
  }
  write(folder / "intrinsics.yml", text);
  const SE3 T = c.rig.T_cam1_cam0();
  write(folder / "extrinsics.yml",
        "%YAML:1.0\n---\n" + storedMatrix("R", T.R()) + storedMatrix("T", T.translation));
  writeImuFile(folder, c);
}

/// Basalt's form with double sphere lenses: `lens` is fx, fy, cx, cy, xi, alpha.
void writeBasalt(const fs::path& folder, const std::array<SE3, 2>& T_imu_cam,
                 const std::array<std::array<double, 6>, 2>& lens) {
  std::string poses;
  std::string lenses;
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Quaterniond& q = T_imu_cam[i].rotation;
    const Eigen::Vector3d& p = T_imu_cam[i].translation;
    poses += fmt::format(
        R"({}{{"px": {:.17g}, "py": {:.17g}, "pz": {:.17g}, "qx": {:.17g}, "qy": {:.17g}, "qz": {:.17g}, "qw": {:.17g}}})",
        i > 0 ? ", " : "", p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
    lenses += fmt::format(
        R"({}{{"camera_type": "ds", "intrinsics": {{"fx": {}, "fy": {}, "cx": {}, "cy": {}, "xi": {}, "alpha": {}}}}})",
        i > 0 ? ", " : "", lens[i][0], lens[i][1], lens[i][2], lens[i][3], lens[i][4], lens[i][5]);
  }
  write(folder / "calib.json",
        fmt::format(
            R"({{"value0": {{"T_imu_cam": [{}], "intrinsics": [{}], "resolution": [[752, 480], [752, 480]],
  "imu_update_rate": 200.0, "accel_noise_std": 0.016, "gyro_noise_std": 0.000282, "accel_bias_std": 0.001,
  "gyro_bias_std": 0.0001, "cam_time_offset_ns": 0}}}})",
            poses, lenses));
}

/// EuRoC's cameras as Basalt's authors calibrated them (basalt, data/euroc_ds_calib.json).
constexpr std::array<std::array<double, 6>, 2> kBasaltLens = {
    {{349.7560023050409, 348.72454229977037, 365.89440762590149, 249.32995565708704, -0.2409573942178872,
      0.566996899163044},
     {361.6713883800533, 360.5856493689301, 379.40818394080869, 255.9772968522045, -0.21300835384809328,
      0.5767008625037023}}};
const std::array<SE3, 2> kBasaltPlace = {
    SE3(Eigen::Quaterniond(0.7123125505904486, -0.007239825785317818, 0.007541278561558601,
                           0.7017845426564943),
        {-0.016774788924641534, -0.068938940687127, 0.005139123188382424}),
    SE3(Eigen::Quaterniond(0.7115930283929829, -0.0023360576185881625, 0.013000769689092388,
                           0.7024677108343111),
        {-0.01507436282032619, 0.0412627204046637, 0.00316287258752953})};

TEST_CASE("a flight is the same with its calibration in any format", "[calibration_flights][long]") {
  const std::optional<std::string> log = longRun() ? findLog("euroc_mh01_20s") : shortLog();
  if (!log) {
    skipCase("euroc_mh01_20s is not there", "SWIFTLET_DATA=... ctest -R calibration_flights");
    return;
  }
  const ScratchFolder scratch("calibration_flights");
  const Calibration own = readCalibration(*log);
  writeCalibration(scratch.file("both"), own);
  for (const char* file : {"camchain-imucam.yaml", "imu.yaml"}) {
    fs::create_directories(scratch.file("kalibr"));
    fs::rename(fs::path(scratch.file("both")) / file, fs::path(scratch.file("kalibr")) / file);
  }
  writeCameraInfo(scratch.file("ros"), own);
  writeOpenCv(scratch.file("opencv"), own);
  writeBasalt(scratch.file("basalt"), kBasaltPlace, kBasaltLens);

  double first_error = 0;
  for (const char* form : {"", "both", "kalibr", "ros", "opencv", "basalt"}) {
    ReplayRequest request;
    request.accuracy = runAccuracyJson;
    request.log = *log;
    request.out = scratch.file(std::string("run_") + form);
    if (*form != 0) request.calibration = scratch.file(form);
    const ReplayResult result = runReplay(request, Settings{});
    REQUIRE(result.finished);
    const double error = result.summary["accuracy"]["odometry"]["all"]["se3"]["ate_m"]["rmse"].get<double>();
    std::printf("%-8s ATE %.5f m\n", *form != 0 ? form : "log's own", error);
    if (*form == 0) first_error = error;
    INFO(form);
    // Rounding to 12 digits makes runs differ by chance; another tool's calibration is another one.
    const bool other_calibration = std::string(form) == "basalt";
    CHECK(error < (other_calibration ? 2.0 : 1.1) * first_error + 5e-4);
  }
}

}  // namespace
}  // namespace swiftlet
