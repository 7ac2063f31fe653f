#include "firmware_host/lab/calibrate/imu_camera/batch_problem.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <thread>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kControls = SplineTrajectory::kOrder;
constexpr int kSplineColumns = 6 * static_cast<int>(kControls);
constexpr int kViewColumns = kSplineColumns + batch::kPerCamera + 4;  // shift readout scale drift
constexpr int kReadingColumns = kSplineColumns + 12 + 2 + 9 + 6;      // two biases, gravity, matrices
constexpr double kHuber = 3;                                          // sigmas
constexpr int kParts = 2;                                             // threads
constexpr int kReadingsAtOnce = 64;

// Priors. They are wide: a log with information on a value determines it far better.
constexpr double kLensSpread = 0.3;      // of the focal length: focal length and centre
constexpr double kDistortionSpread = 3;  // of each coefficient
constexpr double kTurnSpread = 3;        // rad
constexpr double kLeverSpread = 1;       // m
constexpr double kShiftSpread = 1;       // s
constexpr double kReadoutSpread = 0.05;  // s
constexpr double kMatrixSpread = 0.1;    // of each entry
constexpr double kScaleSpread = 0.3;
constexpr double kDriftSpread = 0.01;  // s/s
// Controls that no reading depends on move little; 1 m and 1 rad are far above the uncertainty of any
// control.
constexpr double kControlInformation = 1;

using SplineBlock = Eigen::Matrix<double, 2, kSplineColumns>;

// Two directions perpendicular to gravity.
Eigen::Matrix<double, 3, 2> gravityTangent(const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d direction = gravity.normalized();
  Eigen::Index smallest = 0;
  direction.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> tangent;
  tangent.col(0) = direction.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  tangent.col(1) = direction.cross(tangent.col(0));
  return tangent;
}

constexpr std::array<std::array<int, 2>, 6> kLower{{{0, 0}, {1, 0}, {1, 1}, {2, 0}, {2, 1}, {2, 2}}};

}  // namespace

Eigen::Matrix<double, 6, 1> BatchState::biasAt(double time) const {
  const double place = std::clamp((time - spline.startTime()) / (spline.spacing() * bias_every), 0.0,
                                  static_cast<double>(bias.size() - 1));
  const auto first = std::min(static_cast<std::size_t>(place), bias.size() - 2);
  const double part = place - static_cast<double>(first);
  return (1 - part) * bias[first] + part * bias[first + 1];
}

struct BatchProblem::Sum {
  Sum(ArrowSystem empty, bool robust_corners, bool with_probes)
      : system(std::move(empty)), robust(robust_corners), probes(with_probes) {}

  ArrowSystem system;
  double cost = 0;
  bool robust;
  bool probes;  ///< one right-hand side of random signs per kind of residual
  Random signs{1, 77};
  std::vector<int> columns;
  Eigen::MatrixXd J;
  Eigen::MatrixXd r;

  void reserve(Eigen::Index rows, Eigen::Index unknowns) {
    J.resize(rows, unknowns);
    r.setZero(rows, probes ? kResidualKinds : 1);
  }
  void setResidual(Eigen::Index row, Residuals kind, double value) {
    if (!probes) {
      r(row, 0) = value;
      return;
    }
    r.row(row).setZero();
    r(row, static_cast<int>(kind)) = signs.below(2) == 0 ? -1 : 1;
  }
  void flush(Eigen::Index rows) {
    const auto top = J.topRows(rows);
    cost += r.topRows(rows).squaredNorm();
    system.add(columns, top.transpose() * top, top.transpose() * r.topRows(rows));
  }
};

BatchProblem::BatchProblem(const BatchData& data, BatchState state, const BatchNoise& noise)
    : data_(data), state_(std::move(state)), noise_(noise) {
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    lens_start_[c] << state_.camera[c].intrinsics(), state_.camera[c].distortion();
    if (c >= state_.camera_count) hold(batch::lens(c), batch::kPerCamera);
  }
  middle_ = 0.5 * (state_.spline.startTime() + state_.spline.endTime());
  hold(batch::kScale, 1);
  hold(batch::kDrift, 1);
  layOut();
}

void BatchProblem::layOut() {
  const std::size_t knots = state_.spline.controls().size() + 1 - kControls;
  const auto every = static_cast<std::size_t>(state_.bias_every);
  const std::size_t biases = (knots + every - 1) / every + 1;
  state_.bias.resize(biases,
                     state_.bias.empty() ? Eigen::Matrix<double, 6, 1>::Zero().eval() : state_.bias.back());
  chain_ = 6 * static_cast<int>(state_.spline.controls().size() + biases);
  width_ = 0;
  for (std::size_t k = 0; k < knots; ++k) {
    const int first = std::min(controlColumn(k), biasColumn(k / every));
    const int last = std::max(controlColumn(k + kControls - 1), biasColumn(k / every + 1)) + 5;
    width_ = std::max(width_, last - first);
  }
}

void BatchProblem::hold(int first, int count, bool held) { std::fill_n(held_.begin() + first, count, held); }

// A bias is placed before the control in the middle of the segment where it begins.
int BatchProblem::controlColumn(std::size_t control) const {
  const auto every = static_cast<std::size_t>(state_.bias_every);
  const std::size_t before =
      control < SplineTrajectory::kCentreOffset
          ? 0
          : std::min((control - SplineTrajectory::kCentreOffset) / every + 1, state_.bias.size());
  return 6 * static_cast<int>(control + before);
}

int BatchProblem::biasColumn(std::size_t bias) const {
  const std::size_t control =
      bias * static_cast<std::size_t>(state_.bias_every) + SplineTrajectory::kCentreOffset;
  return 6 * static_cast<int>(std::min(control, state_.spline.controls().size()) + bias);
}

std::size_t BatchProblem::segmentOf(double time) const {
  const std::size_t segments = state_.spline.controls().size() + 1 - kControls;
  const double place = (time - state_.spline.startTime()) / state_.spline.spacing();
  return std::min(static_cast<std::size_t>(std::max(place, 0.0)), segments - 1);
}

double BatchProblem::seconds(const SeenView& view, const SeenCorner& corner) const {
  return view.time + state_.shift + state_.drift * (view.time - middle_) +
         state_.readout * state_.row(view.camera, corner.pixel.y());
}

bool BatchProblem::residual(const SeenView& view, const SeenCorner& corner, Eigen::Vector2d& pixels) const {
  const double time = seconds(view, corner);
  if (!covers(time)) return false;
  const SE3 T_board_cam = state_.spline.pose(time) * state_.T_body_cam[view.camera];
  Eigen::Vector2d predicted;
  if (!state_.camera[view.camera].project(T_board_cam.inverse() * (state_.scale * corner.point), predicted)) {
    return false;
  }
  pixels = corner.pixel - predicted;
  return true;
}

Eigen::Matrix<double, 6, 1> BatchProblem::residual(const TimedReading& reading) const {
  const MotionState motion = state_.spline.at(reading.time);
  const Eigen::Matrix<double, 6, 1> bias = state_.biasAt(reading.time);
  const Eigen::Vector3d force =
      motion.T_world_body.rotation.conjugate() * (motion.a_world_body - state_.gravity);
  Eigen::Matrix<double, 6, 1> r;
  r << reading.gyro - state_.gyro_matrix * motion.omega_body - bias.head<3>(),
      reading.accel - state_.accel_matrix * force - bias.tail<3>();
  return r;
}

void BatchProblem::addView(const SeenView& view, Sum& sum) const {
  const std::size_t c = view.camera;
  const CameraModel& lens = state_.camera[c];
  const SE3& T_body_cam = state_.T_body_cam[c];
  const Eigen::Matrix3d R_cam_body = T_body_cam.R().transpose();
  sum.reserve(2 * static_cast<Eigen::Index>(view.corners.size()), kViewColumns);
  Eigen::Index rows = 0;
  std::size_t open = 0;
  double known_time = -1;
  SplineJacobian by_controls;
  MotionState motion;
  Eigen::Matrix3d R_body_board = Eigen::Matrix3d::Identity();
  const auto flush = [&] {
    if (rows == 0) return;
    sum.columns.clear();
    for (std::size_t l = 0; l < kControls; ++l) {
      for (int k = 0; k < 6; ++k) sum.columns.push_back(controlColumn(open + l) + k);
    }
    for (int k = 0; k < batch::kPerCamera; ++k) sum.columns.push_back(chain_ + batch::lens(c) + k);
    for (const int k : {batch::kShift, batch::kReadout, batch::kScale, batch::kDrift}) {
      sum.columns.push_back(chain_ + k);
    }
    sum.flush(rows);
    rows = 0;
  };
  for (const SeenCorner& corner : view.corners) {
    if (corner.outlier) continue;
    const double time = seconds(view, corner);
    if (!covers(time)) continue;
    const std::size_t segment = segmentOf(time);
    if (segment != open) flush();
    open = segment;
    if (time != known_time) {
      motion = state_.spline.at(time, by_controls);
      R_body_board = motion.T_world_body.R().transpose();
      known_time = time;
    }
    const Eigen::Vector3d p_body =
        R_body_board * (state_.scale * corner.point - motion.T_world_body.translation);
    const Eigen::Vector3d p_cam = R_cam_body * (p_body - T_body_cam.translation);
    Eigen::Vector2d predicted;
    Matrix23d by_point;
    if (!lens.project(p_cam, predicted, &by_point)) {
      const double lost = kNoPixel / noise_.corner;
      sum.cost += sum.robust ? kHuber * lost : lost * lost;
      continue;
    }
    const Eigen::Vector2d left = (corner.pixel - predicted) / noise_.corner;
    double weight = 1 / noise_.corner;
    double factor = 1;
    if (sum.robust && left.norm() > kHuber) factor = std::sqrt(kHuber / left.norm());
    weight *= factor;

    // Residuals are measured minus predicted.
    const Matrix23d by_body = -weight * by_point * R_cam_body;  // d r / d p_body
    const Matrix23d by_turn = by_body * hat(p_body);
    const Matrix23d by_position = -by_body * R_body_board;
    auto J = sum.J.middleRows<2>(rows);
    for (std::size_t l = 0; l < kControls; ++l) {
      const int at = 6 * static_cast<int>(l);
      J.block<2, 3>(0, at) = by_turn * by_controls.rotation[l];
      J.block<2, 3>(0, at + 3) = by_controls.position[l] * by_position;
    }
    int at = kSplineColumns;
    J.block<2, kLensParameters>(0, at) = -weight * lensJacobian(lens, p_cam);
    J.block<2, 3>(0, at + kLensParameters) = -weight * by_point * hat(p_cam);
    J.block<2, 3>(0, at + kLensParameters + 3) = -by_body;
    at += batch::kPerCamera;
    const Eigen::Vector2d by_time = by_turn * motion.omega_body + by_position * motion.v_world_body;
    J.col(at) = by_time;
    J.col(at + 1) = by_time * state_.row(c, corner.pixel.y());
    J.col(at + 2) = -by_position * corner.point;
    J.col(at + 3) = by_time * (view.time - middle_);
    sum.setResidual(rows, Residuals::kCorner, factor * left.x());
    sum.setResidual(rows + 1, Residuals::kCorner, factor * left.y());
    rows += 2;
  }
  flush();
}

void BatchProblem::addReadings(std::size_t first, std::size_t last, Sum& sum) const {
  const double gyro_weight = 1 / (noise_.gyro * data_.noise.gyro_density * std::sqrt(data_.noise.rate_hz));
  const double accel_weight = 1 / (noise_.accel * data_.noise.accel_density * std::sqrt(data_.noise.rate_hz));
  const Eigen::Matrix<double, 3, 2> by_tilt = state_.gravity.norm() * gravityTangent(state_.gravity);
  sum.reserve(Eigen::Index{6} * kReadingsAtOnce, kReadingColumns);
  Eigen::Index rows = 0;
  std::size_t open = 0;
  const auto every = static_cast<std::size_t>(state_.bias_every);
  const auto flush = [&] {
    if (rows == 0) return;
    sum.columns.clear();
    for (std::size_t l = 0; l < kControls; ++l) {
      for (int k = 0; k < 6; ++k) sum.columns.push_back(controlColumn(open + l) + k);
    }
    for (int k = 0; k < 6; ++k) sum.columns.push_back(biasColumn(open / every) + k);
    for (int k = 0; k < 6; ++k) sum.columns.push_back(biasColumn(open / every + 1) + k);
    for (int k = 0; k < 17; ++k) sum.columns.push_back(chain_ + batch::kGravity + k);
    sum.flush(rows);
    rows = 0;
  };
  SplineJacobian by_controls;
  for (std::size_t i = first; i < last; ++i) {
    const TimedReading& reading = data_.readings[i];
    if (!covers(reading.time)) continue;
    const std::size_t segment = segmentOf(reading.time);
    if (segment != open || rows == sum.J.rows()) flush();
    open = segment;
    const MotionState motion = state_.spline.at(reading.time, by_controls);
    const Eigen::Matrix3d R_body_board = motion.T_world_body.R().transpose();
    const Eigen::Vector3d force = R_body_board * (motion.a_world_body - state_.gravity);
    const double place = (reading.time - state_.spline.startTime()) / state_.spline.spacing();
    const double part = std::clamp(
        (place - static_cast<double>(segment / every * every)) / static_cast<double>(every), 0.0, 1.0);
    const Eigen::Matrix<double, 6, 1> bias =
        (1 - part) * state_.bias[segment / every] + part * state_.bias[segment / every + 1];

    auto J = sum.J.middleRows<6>(rows);
    J.setZero();
    const Eigen::Matrix3d by_force = -accel_weight * state_.accel_matrix;
    const Eigen::Matrix3d by_turn = by_force * hat(force);
    for (std::size_t l = 0; l < kControls; ++l) {
      const int at = 6 * static_cast<int>(l);
      J.block<3, 3>(0, at) = -gyro_weight * state_.gyro_matrix * by_controls.rate[l];
      J.block<3, 3>(3, at) = by_turn * by_controls.rotation[l];
      J.block<3, 3>(3, at + 3) = by_controls.acceleration[l] * by_force * R_body_board;
    }
    int at = kSplineColumns;
    for (int k = 0; k < 3; ++k) {
      J(k, at + k) = -gyro_weight * (1 - part);
      J(k, at + 6 + k) = -gyro_weight * part;
      J(3 + k, at + 3 + k) = -accel_weight * (1 - part);
      J(3 + k, at + 9 + k) = -accel_weight * part;
    }
    at += 12;
    J.block<3, 2>(3, at) = -by_force * R_body_board * by_tilt;
    at += 2;
    for (int k = 0; k < 9; ++k) J(k / 3, at + k) = -gyro_weight * motion.omega_body[k % 3];
    at += 9;
    for (std::size_t k = 0; k < kLower.size(); ++k) {
      J(3 + kLower[k][0], at + static_cast<int>(k)) = -accel_weight * force[kLower[k][1]];
    }
    const Eigen::Vector3d gyro = reading.gyro - state_.gyro_matrix * motion.omega_body - bias.head<3>();
    const Eigen::Vector3d accel = reading.accel - state_.accel_matrix * force - bias.tail<3>();
    for (int k = 0; k < 3; ++k) sum.setResidual(rows + k, Residuals::kGyro, gyro_weight * gyro[k]);
    for (int k = 0; k < 3; ++k) sum.setResidual(rows + 3 + k, Residuals::kAccel, accel_weight * accel[k]);
    rows += 6;
  }
  flush();
}

double BatchProblem::addPriors(ArrowSystem& system) const {
  double cost = 0;
  const auto add = [&](int column, double value, double sigma) {
    const double weight = 1 / (sigma * sigma);
    const std::array<int, 1> columns{chain_ + column};
    system.add(columns, Eigen::Matrix<double, 1, 1>(weight), Eigen::Matrix<double, 1, 1>(weight * value));
    cost += weight * value * value;
  };
  for (std::size_t c = 0; c < state_.camera_count; ++c) {
    Eigen::Matrix<double, 8, 1> step;
    step << state_.camera[c].intrinsics(), state_.camera[c].distortion();
    step -= lens_start_[c];
    for (int k = 0; k < 8; ++k) {
      add(batch::lens(c) + k, step[k], k < 4 ? kLensSpread * state_.camera[c].focal() : kDistortionSpread);
    }
    for (int k = 0; k < 3; ++k) {
      add(batch::rotation(c) + k, 0, kTurnSpread);
      add(batch::position(c) + k, state_.T_body_cam[c].translation[k], kLeverSpread);
    }
  }
  add(batch::kShift, 0, kShiftSpread);
  add(batch::kReadout, state_.readout, kReadoutSpread);
  add(batch::kGravity, 0, kTurnSpread);
  add(batch::kGravity + 1, 0, kTurnSpread);
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  for (int k = 0; k < 9; ++k) {
    add(batch::kGyro + k, state_.gyro_matrix(k / 3, k % 3) - identity(k / 3, k % 3), kMatrixSpread);
  }
  for (std::size_t k = 0; k < kLower.size(); ++k) {
    const auto [i, j] = kLower[k];
    add(batch::kAccel + static_cast<int>(k), state_.accel_matrix(i, j) - identity(i, j), kMatrixSpread);
  }
  add(batch::kScale, state_.scale - 1, kScaleSpread);
  add(batch::kDrift, state_.drift, kDriftSpread);

  const Eigen::Matrix<double, 6, 6> loose = kControlInformation * Eigen::Matrix<double, 6, 6>::Identity();
  const auto columnsOf = [](int first) {
    std::array<int, 6> columns{};
    for (int k = 0; k < 6; ++k) columns[static_cast<std::size_t>(k)] = first + k;
    return columns;
  };
  for (std::size_t k = 0; k < state_.spline.controls().size(); ++k) {
    system.add(columnsOf(controlColumn(k)), loose, Eigen::Matrix<double, 6, 1>::Zero());
  }
  const double between = std::sqrt(state_.spline.spacing() * state_.bias_every);
  Eigen::Matrix<double, 6, 1> weight;
  weight << Eigen::Vector3d::Constant(1 / (data_.noise.gyro_walk * between)),
      Eigen::Vector3d::Constant(1 / (data_.noise.accel_walk * between));
  for (std::size_t k = 1; k < state_.bias.size(); ++k) {
    Eigen::Matrix<double, 6, 12> J = Eigen::Matrix<double, 6, 12>::Zero();
    J.leftCols<6>().diagonal() = -weight;
    J.rightCols<6>().diagonal() = weight;
    const Eigen::Matrix<double, 6, 1> r = weight.cwiseProduct(state_.bias[k] - state_.bias[k - 1]);
    std::array<int, 12> columns{};
    for (int i = 0; i < 6; ++i) {
      columns[static_cast<std::size_t>(i)] = biasColumn(k - 1) + i;
      columns[static_cast<std::size_t>(6 + i)] = biasColumn(k) + i;
    }
    system.add(columns, J.transpose() * J, J.transpose() * r);
    cost += r.squaredNorm();
  }
  return cost;
}

double BatchProblem::assemble(ArrowSystem& system, bool robust, bool probes) const {
  std::vector<Sum> sums;
  for (int part = 0; part < kParts; ++part) {
    sums.emplace_back(emptySystem(probes ? kResidualKinds : 1), robust, probes);
  }
  const auto work = [&](int part) {
    Sum& sum = sums[static_cast<std::size_t>(part)];
    sum.signs = Random(static_cast<std::uint64_t>(part) + 1, 77);
    const auto bound = [&](std::size_t count, int k) { return count * static_cast<std::size_t>(k) / kParts; };
    for (std::size_t i = bound(data_.views.size(), part); i < bound(data_.views.size(), part + 1); ++i) {
      addView(data_.views[i], sum);
    }
    addReadings(bound(data_.readings.size(), part), bound(data_.readings.size(), part + 1), sum);
  };
  std::thread other(work, 1);
  work(0);
  other.join();
  system = std::move(sums[0].system);
  system.add(sums[1].system);
  double cost = sums[0].cost + sums[1].cost;
  ArrowSystem priors = emptySystem();
  cost += addPriors(priors);
  system.add(priors);
  for (int k = 0; k < batch::kColumns; ++k) {
    if (held(k)) system.hold(k);
  }
  return cost;
}

BatchState BatchProblem::moved(const Eigen::VectorXd& step) const {
  BatchState next = state_;
  std::vector<SE3>& controls = next.spline.controls();
  for (std::size_t k = 0; k < controls.size(); ++k) {
    const Eigen::Matrix<double, 6, 1> d = step.segment<6>(controlColumn(k));
    controls[k] = SE3(controls[k].rotation * expSo3(d.head<3>()), controls[k].translation + d.tail<3>());
  }
  for (std::size_t k = 0; k < next.bias.size(); ++k) next.bias[k] += step.segment<6>(biasColumn(k));
  const Eigen::VectorXd border = step.tail<batch::kColumns>();
  for (std::size_t c = 0; c < next.camera_count; ++c) {
    const Eigen::Matrix<double, 8, 1> lens = border.segment<8>(batch::lens(c));
    if (!lens.isZero(0)) next.camera[c] = movedLens(next.camera[c], lens);
    SE3& T = next.T_body_cam[c];
    T = SE3(T.rotation * expSo3(border.segment<3>(batch::rotation(c))),
            T.translation + border.segment<3>(batch::position(c)));
  }
  next.shift += border[batch::kShift];
  next.readout += border[batch::kReadout];
  const Eigen::Vector3d tilted =
      next.gravity + next.gravity.norm() * gravityTangent(next.gravity) * border.segment<2>(batch::kGravity);
  next.gravity = next.gravity.norm() * tilted.normalized();
  for (int k = 0; k < 9; ++k) next.gyro_matrix(k / 3, k % 3) += border[batch::kGyro + k];
  for (std::size_t k = 0; k < kLower.size(); ++k) {
    next.accel_matrix(kLower[k][0], kLower[k][1]) += border[batch::kAccel + static_cast<int>(k)];
  }
  next.scale += border[batch::kScale];
  next.drift += border[batch::kDrift];
  return next;
}

bool BatchProblem::solve(int iterations, bool robust, double settled) {
  constexpr double kLeastDamping = 1e-9;
  constexpr double kMostDamping = 1e6;
  double damping = kLeastDamping;
  ArrowSystem system = emptySystem();
  double cost = assemble(system, robust);
  for (int i = 0; i < iterations; ++i) {
    const ArrowFactor factor(system, damping);
    if (!factor.ok()) {
      damping *= 100;
      if (damping > kMostDamping) return false;
      continue;
    }
    const Eigen::VectorXd gradient = system.gradient();
    const Eigen::VectorXd step = factor.solve(-gradient);
    const double gain = -step.dot(gradient);
    if (gain < settled && damping < 1e-6) {
      state_ = moved(step);
      return true;
    }
    BatchProblem trial = *this;
    trial.state_ = moved(step);
    ArrowSystem next = emptySystem();
    const double next_cost = trial.assemble(next, robust);
    // Corners that leave the spline's time leave the sum, so a slight increase is no failure.
    if (std::isfinite(next_cost) && next_cost <= cost * (1 + 1e-9)) {
      state_ = std::move(trial.state_);
      cost = next_cost;
      system = std::move(next);
      damping = std::max(damping / 100, kLeastDamping);
      if (gain < settled) return true;
    } else {
      damping = std::max(damping * 100, 1e-4);
      if (damping > kMostDamping) return false;
    }
  }
  return false;
}

void BatchProblem::refineSpline() {
  const double spacing = state_.spline.spacing() / 2;
  const double start = state_.spline.startTime();
  const auto count = static_cast<std::size_t>(std::lround((state_.spline.endTime() - start) / spacing)) + 1;
  std::vector<SE3> samples;
  samples.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    samples.push_back(state_.spline.pose(start + spacing * static_cast<double>(k)));
  }
  state_.spline = SplineTrajectory::interpolate(start, spacing, samples);
  state_.bias_every *= 2;
  layOut();
}

double BatchProblem::cost(Residuals which) const {
  double sum = 0;
  if (which == Residuals::kCorner) {
    for (const SeenView& view : data_.views) {
      for (const SeenCorner& corner : view.corners) {
        Eigen::Vector2d r;
        if (!corner.outlier && residual(view, corner, r)) sum += r.squaredNorm();
      }
    }
    return sum / (noise_.corner * noise_.corner);
  }
  const bool gyro = which == Residuals::kGyro;
  for (const TimedReading& reading : data_.readings) {
    if (!covers(reading.time)) continue;
    const Eigen::Matrix<double, 6, 1> r = residual(reading);
    sum += gyro ? r.head<3>().squaredNorm() : r.tail<3>().squaredNorm();
  }
  const double sigma =
      (gyro ? noise_.gyro * data_.noise.gyro_density : noise_.accel * data_.noise.accel_density) *
      std::sqrt(data_.noise.rate_hz);
  return sum / (sigma * sigma);
}

std::size_t BatchProblem::count(Residuals which) const {
  std::size_t count = 0;
  if (which == Residuals::kCorner) {
    for (const SeenView& view : data_.views) {
      for (const SeenCorner& corner : view.corners) {
        Eigen::Vector2d r;
        if (!corner.outlier && residual(view, corner, r)) count += 2;
      }
    }
    return count;
  }
  for (const TimedReading& reading : data_.readings) count += covers(reading.time) ? 3 : 0;
  return count;
}

std::array<double, kResidualKinds> BatchProblem::redundancies() const {
  ArrowSystem system = emptySystem(kResidualKinds);
  assemble(system, false, true);
  const ArrowFactor factor(system, 0);
  std::array<double, kResidualKinds> left{};
  for (int kind = 0; kind < kResidualKinds; ++kind) {
    const Eigen::VectorXd probed = system.gradient(kind);
    left[static_cast<std::size_t>(kind)] =
        static_cast<double>(count(static_cast<Residuals>(kind))) - probed.dot(factor.solve(probed));
  }
  return left;
}

Eigen::MatrixXd BatchProblem::covariance() const {
  ArrowSystem system = emptySystem();
  assemble(system, false);
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(chain_, 6);
  for (std::size_t k = 0; k < state_.bias.size(); ++k) {
    for (int i = 0; i < 6; ++i) mean(biasColumn(k) + i, i) = 1.0 / static_cast<double>(state_.bias.size());
  }
  return ArrowFactor(system, 0).covariance(mean);
}

Eigen::VectorXd BatchProblem::nextStep() const {
  ArrowSystem system = emptySystem();
  assemble(system, false);
  return ArrowFactor(system, 0).solve(-system.gradient()).tail<batch::kColumns>();
}

Eigen::Matrix<double, 6, 1> BatchProblem::meanBias() const {
  Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
  for (const Eigen::Matrix<double, 6, 1>& bias : state_.bias) sum += bias;
  return sum / static_cast<double>(state_.bias.size());
}

}  // namespace swiftlet
