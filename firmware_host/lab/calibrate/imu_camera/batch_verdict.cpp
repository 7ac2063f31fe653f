#include "firmware_host/lab/calibrate/imu_camera/batch_verdict.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kToDeg = 180 / std::numbers::pi;
constexpr double kToMm = 1e3;
constexpr double kToMilliseconds = 1e3;
constexpr double kToPercent = 100;

// A result is refused if a standard deviation is large enough to affect a flight.
constexpr double kMostTurnSigma = 0.05;    // deg: a pixel at 1000 px of focal length
constexpr double kMostLeverSigma = 3;      // mm: half of what two good tools differ by
constexpr double kMostShiftSigma = 0.2;    // ms: at 3 rad/s 0.03 deg
constexpr double kMostLensSigma = 1e-3;    // of the focal length
constexpr double kMostMatrixSigma = 0.5;   // %; accuracy of an uncalibrated MEMS sensor
constexpr double kMostMatrix = 0.05;       // of an entry, from the identity: beyond, axes or units are wrong
constexpr double kMostResidual = 3;        // times the given noise
constexpr double kMostCornerNoise = 2e-3;  // rad
constexpr double kMostOutliers = 0.05;     // share of the corners
constexpr double kTestSigmas = 5;          // for one test, so that a good calibration never fails by chance
constexpr double kScaleMatters = 0.005;    // of the board; gravity anywhere on Earth varies less
constexpr double kDriftMatters = 5e-6;     // s/s: 0.15 ms from the middle of a minute to its end
constexpr double kShiftOfOneClock = 0.1;   // s; exposure, transfer and filters take less
constexpr double kLeastRate = 0.15;        // rad/s, root mean square about each axis
constexpr double kLeastForce = 0.3;        // m/s^2, root mean square along each axis
constexpr double kToldTurn = 10;           // deg from the given orientation of the IMU

struct NamedColumn {
  int column = 0;
  const char* unit = "";
  double factor = 1;  ///< from the batch's unit
  double value = 0;   ///< in the batch's unit
  std::string name;
};

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

std::vector<NamedColumn> columnsOf(const BatchState& state, bool rolling,
                                   const Eigen::Matrix<double, 6, 1>& bias) {
  std::vector<NamedColumn> all;
  const auto add = [&](int column, std::string name, const char* unit, double factor, double value) {
    all.push_back({column, unit, factor, value, std::move(name)});
  };
  for (std::size_t c = 0; c < state.camera_count; ++c) {
    const CameraModel& lens = state.camera[c];
    const bool radtan = lens.kind() == CameraKind::kPinholeRadtan;
    constexpr std::array<const char*, 4> kPinhole{"fx", "fy", "cx", "cy"};
    const std::array<const char*, 4> distortion = radtan ? std::array<const char*, 4>{"k1", "k2", "p1", "p2"}
                                                         : std::array<const char*, 4>{"k1", "k2", "k3", "k4"};
    for (int k = 0; k < 4; ++k) {
      add(batch::lens(c) + k, fmt::format("cam{} {}", c, kPinhole[static_cast<std::size_t>(k)]), "px", 1,
          lens.intrinsics()[k]);
    }
    for (int k = 0; k < 4; ++k) {
      add(batch::lens(c) + 4 + k, fmt::format("cam{} {}", c, distortion[static_cast<std::size_t>(k)]), "", 1,
          lens.distortion()[k]);
    }
    const Eigen::Vector3d turn = logSo3(state.T_body_cam[c].rotation);
    for (int k = 0; k < 3; ++k) {
      add(batch::rotation(c) + k,
          fmt::format("T_body_cam{} rotation {}", c, kAxes[static_cast<std::size_t>(k)]), "deg", kToDeg,
          turn[k]);
    }
    for (int k = 0; k < 3; ++k) {
      add(batch::position(c) + k,
          fmt::format("T_body_cam{} position {}", c, kAxes[static_cast<std::size_t>(k)]), "mm", kToMm,
          state.T_body_cam[c].translation[k]);
    }
  }
  add(batch::kShift, "time offset", "ms", kToMilliseconds, state.shift);
  if (rolling) add(batch::kReadout, "readout", "ms", kToMilliseconds, state.readout);
  const auto matrixEntry = [&](const char* sensor, int column, int i, int j, const Eigen::Matrix3d& M) {
    const std::string name =
        i == j ? fmt::format("{} scale {}", sensor, kAxes[static_cast<std::size_t>(i)])
               : fmt::format("{} misalignment {}{}", sensor, kAxes[static_cast<std::size_t>(i)],
                             kAxes[static_cast<std::size_t>(j)]);
    add(column, name, "%", kToPercent, M(i, j) - (i == j ? 1 : 0));
  };
  for (int k = 0; k < 9; ++k) matrixEntry("gyro", batch::kGyro + k, k / 3, k % 3, state.gyro_matrix);
  int column = batch::kAccel;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) matrixEntry("accel", column++, i, j, state.accel_matrix);
  }
  for (int k = 0; k < 6; ++k) {
    add(batch::kColumns + k,
        fmt::format("{} bias {}", k < 3 ? "gyro" : "accel", kAxes[static_cast<std::size_t>(k % 3)]),
        k < 3 ? "deg/s" : "m/s^2", k < 3 ? kToDeg : 1, bias[k]);
  }
  return all;
}

/// a - b, per column.
Eigen::VectorXd differenceOf(const BatchState& a, const BatchState& b) {
  Eigen::VectorXd d = Eigen::VectorXd::Zero(batch::kColumns);
  for (std::size_t c = 0; c < a.camera_count; ++c) {
    d.segment<4>(batch::lens(c)) = a.camera[c].intrinsics() - b.camera[c].intrinsics();
    d.segment<4>(batch::lens(c) + 4) = a.camera[c].distortion() - b.camera[c].distortion();
    d.segment<3>(batch::rotation(c)) =
        logSo3(b.T_body_cam[c].rotation.conjugate() * a.T_body_cam[c].rotation);
    d.segment<3>(batch::position(c)) = a.T_body_cam[c].translation - b.T_body_cam[c].translation;
  }
  d[batch::kShift] = a.shift - b.shift;
  d[batch::kReadout] = a.readout - b.readout;
  for (int k = 0; k < 9; ++k) {
    d[batch::kGyro + k] = a.gyro_matrix(k / 3, k % 3) - b.gyro_matrix(k / 3, k % 3);
  }
  int column = batch::kAccel;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) d[column++] = a.accel_matrix(i, j) - b.accel_matrix(i, j);
  }
  return d;
}

/// "x (1.00 0.02 0.01)": the nearest axis of camera 0, and the direction.
std::string axisOfCamera(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  constexpr std::array<const char*, 3> kWords{"x (pitch: nod up and down)", "y (yaw: look left and right)",
                                              "z (roll: turn the image)"};
  return kWords[static_cast<std::size_t>(axis)];
}

struct Weakest {
  double rms = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
};

Weakest weakestOf(const Eigen::Matrix3d& moments) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
  return {std::sqrt(std::max(eigen.eigenvalues()[0], 0.0)), eigen.eigenvectors().col(0)};
}

}  // namespace

ImuCameraSolution BatchVerdict::solutionOf(const BatchProblem& problem) const {
  const BatchState& state = problem.state();
  ImuCameraSolution solution;
  Rig& rig = solution.rig;
  rig.camera_count = state.camera_count;
  rig.camera = state.camera;
  rig.T_body_cam = state.T_body_cam;
  rig.camera_to_imu_shift = Duration::fromSeconds(state.shift);
  rig.readout = Duration::fromSeconds(state.readout);
  solution.gyro_matrix = state.gyro_matrix;
  solution.accel_matrix = state.accel_matrix;
  const Eigen::Matrix<double, 6, 1> bias = problem.meanBias();
  solution.gyro_bias = bias.head<3>();
  solution.accel_bias = bias.tail<3>();
  solution.gravity_board = state.gravity;
  solution.corner_sigma = problem.noise().corner;
  solution.gyro_sigma = problem.noise().gyro;
  solution.accel_sigma = problem.noise().accel;

  const std::vector<NamedColumn> columns = columnsOf(state, rolling, bias);
  const Eigen::MatrixXd covariance = problem.covariance();
  const auto count = static_cast<Eigen::Index>(columns.size());
  solution.covariance.resize(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const NamedColumn& a = columns[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < count; ++j) {
      const NamedColumn& b = columns[static_cast<std::size_t>(j)];
      solution.covariance(i, j) = a.factor * b.factor * covariance(a.column, b.column);
    }
    solution.values.push_back({a.name, a.unit, a.factor * a.value, std::sqrt(solution.covariance(i, i))});
  }

  for (const TimedReading& reading : start.data.readings) {
    if (!problem.covers(reading.time)) continue;
    const Eigen::Matrix<double, 6, 1> r = problem.residual(reading);
    solution.imu_residuals.push_back(
        {start.origin + Duration::fromSeconds(reading.time), r.head<3>(), r.tail<3>()});
  }
  for (const SeenView& view : start.data.views) {
    const double time = view.time + state.shift;
    if (!problem.covers(time)) continue;
    const Stamp stamp = start.origin + Duration::fromSeconds(view.time);
    if (solution.views.empty() || solution.views.back().stamp != stamp) {
      solution.views.push_back({stamp, (state.spline.pose(time) * state.T_body_cam[0]).inverse()});
    }
    for (const SeenCorner& corner : view.corners) {
      CornerResidual seen{view.camera,  solution.views.size() - 1, corner.id,
                          corner.pixel, Eigen::Vector2d::Zero(),   corner.outlier};
      // One that the lens cannot project is an outlier without a residual.
      if (problem.residual(view, corner, seen.residual) || corner.outlier) solution.corners.push_back(seen);
    }
  }
  return solution;
}

void BatchVerdict::judge(BatchProblem problem, ImuCameraSolution& solution) const {
  std::vector<std::string>& reasons = solution.reasons;
  if (!settled) {
    reasons.push_back(
        "The optimization did not converge: its last steps are not small. Record again, starting slower.");
  }
  judgeResiduals(solution, reasons);
  const bool known = judgeSigmas(solution, reasons);
  judgeMotion(problem, known, reasons);
  judgeMatrices(solution, reasons);
  judgeHalves(problem, reasons);

  // Two additional unknowns that a good calibration does not need.
  problem.hold(batch::kScale, 1, false);
  problem.hold(batch::kDrift, 1, false);
  const Eigen::VectorXd step = problem.nextStep();
  const Eigen::MatrixXd covariance = problem.covariance();
  const auto sigmaOf = [&](int column) { return std::sqrt(covariance(column, column)); };
  const double scale = step[batch::kScale];
  if (std::abs(scale) > std::max(kTestSigmas * sigmaOf(batch::kScale), kScaleMatters)) {
    reasons.push_back(fmt::format(
        "According to the accelerometer the board is {:.2f} +- {:.2f} % {} than in its file. Measure the "
        "board; if it is right, the accelerometer does not match gravity of {:.3f} m/s^2.",
        kToPercent * std::abs(scale), kToPercent * sigmaOf(batch::kScale), scale > 0 ? "larger" : "smaller",
        problem.state().gravity.norm()));
  }
  const double drift = step[batch::kDrift];
  if (std::abs(drift) > std::max(kTestSigmas * sigmaOf(batch::kDrift), kDriftMatters)) {
    reasons.push_back(
        fmt::format("The time offset between cameras and IMU drifts by {:.1f} +- {:.1f} us per second: their "
                    "stamps come from two clocks. Stamp both with one clock, or map one clock to the other.",
                    1e6 * drift, 1e6 * sigmaOf(batch::kDrift)));
  }
  const double shift = problem.state().shift;
  if (std::abs(shift) > kShiftOfOneClock) {
    reasons.push_back(fmt::format(
        "Images and samples are {:.3f} s apart: their stamps probably do not come from one clock. Find out "
        "which is wrong; an offset that differs at each start cannot be calibrated.",
        shift));
  }
}

void BatchVerdict::judgeResiduals(const ImuCameraSolution& solution,
                                  std::vector<std::string>& reasons) const {
  const double corners = static_cast<double>(solution.corners.size());
  if (static_cast<double>(outliers) > kMostOutliers * corners) {
    reasons.push_back(
        fmt::format("{:.1f} % of the corners are outliers. Check the residuals over the image: the lens "
                    "model is wrong, or the board is bent or moved.",
                    kToPercent * static_cast<double>(outliers) / corners));
  }
  const double noise = solution.corner_sigma / solution.rig.camera[0].focal();
  if (noise > kMostCornerNoise) {
    reasons.push_back(
        fmt::format("Corner residuals are {:.2f} px. Reduce blur (shorter exposure, slower motion), use a "
                    "flat board, and set the right kind of shutter.",
                    solution.corner_sigma));
  }
  const auto sensor = [&](const char* name, double times) {
    if (!input.noise_told || times < kMostResidual) return;
    reasons.push_back(fmt::format(
        "The {}'s residuals are {:.1f} times its noise. Possible causes: noise densities from a datasheet "
        "(measure them with `calibrate imu-noise`), stamp jitter, shocks, a board that moved.",
        name, times));
  };
  sensor("gyro", solution.gyro_sigma);
  sensor("accelerometer", solution.accel_sigma);
}

void BatchVerdict::judgeMotion(const BatchProblem& problem, bool known,
                               std::vector<std::string>& reasons) const {
  const BatchState& state = problem.state();
  Eigen::Matrix3d rates = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d forces = Eigen::Matrix3d::Zero();
  double count = 0;
  const Eigen::Matrix3d R_cam_body = state.T_body_cam[0].R().transpose();
  for (const TimedReading& reading : start.data.readings) {
    if (!problem.covers(reading.time)) continue;
    const MotionState motion = state.spline.at(reading.time);
    const Eigen::Vector3d rate = R_cam_body * motion.omega_body;
    const Eigen::Vector3d force =
        R_cam_body * (motion.T_world_body.rotation.conjugate() * motion.a_world_body);
    rates += rate * rate.transpose();
    forces += force * force.transpose();
    ++count;
  }
  const Weakest turn = weakestOf(rates / count);
  if (turn.rms < kLeastRate) {
    reasons.push_back(
        fmt::format("The rig hardly rotated about camera 0's axis {}: {:.1f} deg/s. Rotate it back and forth "
                    "about this axis by 30 deg and more.",
                    axisOfCamera(turn.direction), kToDeg * turn.rms));
  }
  const Weakest force = weakestOf(forces / count);
  // Rotations alone reveal much about the accelerometer, because gravity changes its direction.
  if (!known && force.rms < kLeastForce) {
    Eigen::Index axis = 0;
    force.direction.cwiseAbs().maxCoeff(&axis);
    reasons.push_back(
        fmt::format("The rig hardly accelerated along camera 0's {} axis: {:.2f} m/s^2. Swing it back and "
                    "forth along this axis.",
                    kAxes[static_cast<std::size_t>(axis)], force.rms));
  }
  if (!input.told) return;
  const SE3& told = input.told->T_body_cam[0];
  const double turned = kToDeg * logSo3(told.rotation.conjugate() * state.T_body_cam[0].rotation).norm();
  if (turned > kToldTurn) {
    reasons.push_back(
        fmt::format("In the IMU's axes, camera 0 is rotated by {:.0f} deg from the given calibration. "
                    "Swapped IMU axes cause this; if the IMU was remounted, omit the old calibration.",
                    turned));
  }
}

void BatchVerdict::judgeMatrices(const ImuCameraSolution& solution, std::vector<std::string>& reasons) const {
  const auto sensor = [&](const char* name, const Eigen::Matrix3d& M) {
    Eigen::Index i = 0;
    Eigen::Index j = 0;
    const double most = (M - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(&i, &j);
    if (most < kMostMatrix) return;
    reasons.push_back(
        fmt::format("The {}'s axes do not fit: its {} reading has {:.2f} times the true {}. Possible causes: "
                    "swapped or reversed axes of one sensor, a wrong unit, or too little motion.",
                    name, kAxes[static_cast<std::size_t>(i)], M(i, j), kAxes[static_cast<std::size_t>(j)]));
  };
  sensor("gyro", solution.gyro_matrix);
  sensor("accelerometer", solution.accel_matrix);
}

bool BatchVerdict::judgeSigmas(const ImuCameraSolution& solution, std::vector<std::string>& reasons) const {
  std::string text;
  for (const SolvedValue& value : solution.values) {
    double most = 0;
    if (value.unit == "deg") most = kMostTurnSigma;
    if (value.unit == "mm") most = kMostLeverSigma;
    if (value.unit == "ms") most = kMostShiftSigma;
    if (value.unit == "%") most = kMostMatrixSigma;
    if (value.unit == "px") most = kMostLensSigma * solution.rig.camera[0].focal();
    if (most == 0 || value.sigma <= most) continue;
    text += fmt::format("{}{} +- {:.3g} {}", text.empty() ? "" : ", ", value.name, value.sigma, value.unit);
  }
  if (text.empty()) return true;
  reasons.push_back("Not determined well enough: " + text +
                    ". Record longer, with faster rotations about all axes.");
  return false;
}

void BatchVerdict::judgeHalves(const BatchProblem& problem, std::vector<std::string>& reasons) const {
  const Eigen::VectorXd d = differenceOf(halves[1], halves[0]);
  std::vector<int> free;
  for (int k = 0; k < batch::kColumns; ++k) {
    const bool gravity = k == batch::kGravity || k == batch::kGravity + 1;
    if (!problem.held(k) && !gravity) free.push_back(k);
  }
  const auto count = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd covariance(count, count);
  Eigen::VectorXd difference(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const int a = free[static_cast<std::size_t>(i)];
    difference[i] = d[a];
    for (Eigen::Index j = 0; j < count; ++j) {
      const int b = free[static_cast<std::size_t>(j)];
      covariance(i, j) = half_covariances[0](a, b) + half_covariances[1](a, b);
    }
  }
  const double chi2 = difference.dot(covariance.llt().solve(difference));
  const double dimension = static_cast<double>(count);
  if (chi2 < dimension + kTestSigmas * std::sqrt(2 * dimension)) return;
  Eigen::Index worst = 0;
  const Eigen::VectorXd sigmas = covariance.diagonal().cwiseSqrt();
  difference.cwiseQuotient(sigmas).cwiseAbs().maxCoeff(&worst);
  std::string name = "the calibration";
  for (const NamedColumn& column : columnsOf(problem.state(), rolling, problem.meanBias())) {
    if (column.column == free[static_cast<std::size_t>(worst)]) name = column.name;
  }
  reasons.push_back(
      fmt::format("The first and the second half of the log disagree: chi^2 {:.0f} of {} values, most in "
                  "`{}` ({:.1f} sigma). Something moved, a clock drifted, or a model does not fit.",
                  chi2, count, name, std::abs(difference[worst]) / sigmas[worst]));
}

}  // namespace swiftlet
