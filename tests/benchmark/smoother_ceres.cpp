#include "tests/benchmark/smoother_ceres.hpp"

#include <ceres/cost_function.h>
#include <ceres/evaluation_callback.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <array>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet::test {
namespace {

constexpr int kPoseSize = 7;    // quaternion x, y, z, w; position
constexpr int kMotionSize = 9;  // velocity, gyro bias, accel bias
constexpr int kPointSize = 3;   // tangent coordinates of the bearing, inverse depth

using Pose = std::array<double, kPoseSize>;
using Motion = std::array<double, kMotionSize>;
using Point = std::array<double, kPointSize>;
template <int Rows, int Columns>
using RowMajor = Eigen::Matrix<double, Rows, Columns, Eigen::RowMajor>;

SE3 poseOf(const double* block) {
  SE3 T;
  T.rotation = Eigen::Map<const Eigen::Quaterniond>(block);
  T.translation = Eigen::Map<const Eigen::Vector3d>(block + 4);
  return T;
}

BodyState stateOf(const double* pose, const double* motion) {
  return {poseOf(pose), Eigen::Map<const Eigen::Vector3d>(motion),
          Eigen::Map<const Eigen::Vector3d>(motion + 3), Eigen::Map<const Eigen::Vector3d>(motion + 6)};
}

/// R <- R Exp(phi), p <- p + dp. Cost functions put Jacobians by (phi, p) into the first six columns, so
/// that PlusJacobian is [I; 0].
class PoseManifold : public ceres::Manifold {
 public:
  [[nodiscard]] int AmbientSize() const override { return kPoseSize; }
  [[nodiscard]] int TangentSize() const override { return kPoseDim; }
  bool Plus(const double* x, const double* delta, double* moved) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(x);
    Eigen::Map<Eigen::Quaterniond> q_moved(moved);
    q_moved = (q * expSo3(Eigen::Map<const Eigen::Vector3d>(delta))).normalized();
    for (int i = 0; i < 3; ++i) moved[4 + i] = x[4 + i] + delta[3 + i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<RowMajor<kPoseSize, kPoseDim>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    const Eigen::Map<const Eigen::Quaterniond> q_x(x);
    const Eigen::Map<const Eigen::Quaterniond> q_y(y);
    Eigen::Map<Eigen::Vector3d>{delta} = logSo3(q_x.conjugate() * q_y);
    for (int i = 0; i < 3; ++i) delta[3 + i] = y[4 + i] - x[4 + i];
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<RowMajor<kPoseDim, kPoseSize>>(jacobian).setIdentity();
    return true;
  }
};

/// A landmark's constant frame: its three parameters move it from there.
struct PointFrame {
  LandmarkPoint point;
  PointBasis basis;
  [[nodiscard]] LandmarkPoint at(const double* p) const {
    LandmarkPoint moved = point;
    moved.bearing += p[0] * basis.b1 + p[1] * basis.b2;  // its length cancels in the residual
    moved.inverse_depth = p[2];
    return moved;
  }
};

class SightingCost : public ceres::SizedCostFunction<2, kPoseSize, kPointSize> {
 public:
  SightingCost(const CameraSighting& sighting, const CameraPose& camera, const SE3& T_body_cam,
               const PointFrame& frame)
      : sighting_(sighting), camera_(camera), T_body_cam_(T_body_cam), frame_(frame) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const LandmarkPoint point = frame_.at(parameters[1]);
    Eigen::Vector2d r;
    if (!reprojectionResidual(sighting_, camera_, point, r)) return false;
    Eigen::Map<Eigen::Vector2d>{residuals} = r;
    if (jacobians == nullptr) return true;
    SightingJacobians J;
    if (!reprojectionJacobians(sighting_, camera_, T_body_cam_, point, frame_.basis, false, J)) return false;
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor<2, kPoseSize>> pose(jacobians[0]);
      pose.leftCols<kPoseDim>() = J.pose;
      pose.col(kPoseDim).setZero();
    }
    if (jacobians[1] != nullptr) Eigen::Map<RowMajor<2, kPointSize>>{jacobians[1]} = J.point;
    return true;
  }

 private:
  const CameraSighting& sighting_;
  const CameraPose& camera_;  // placed by the callback
  const SE3& T_body_cam_;
  const PointFrame& frame_;
};

class ImuCost : public ceres::SizedCostFunction<kStateDim, kPoseSize, kMotionSize, kPoseSize, kMotionSize> {
 public:
  ImuCost(const Preintegration& imu, const ImuNoise& noise) : imu_(imu), noise_(noise) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const BodyState i = stateOf(parameters[0], parameters[1]);
    const BodyState j = stateOf(parameters[2], parameters[3]);
    MotionFactor factor;
    if (!imuFactor(imu_, noise_, i, j, factor)) return false;
    Eigen::Map<Vector15d>{residuals} = factor.residual;
    if (jacobians == nullptr) return true;
    for (std::size_t block = 0; block < 4; ++block) {
      if (jacobians[block] == nullptr) continue;
      const auto& J = block < 2 ? factor.jacobian_i : factor.jacobian_j;
      if (block % 2 == 0) {
        Eigen::Map<RowMajor<kStateDim, kPoseSize>> pose(jacobians[block]);
        pose.leftCols<kPoseDim>() = J.leftCols<kPoseDim>();
        pose.col(kPoseDim).setZero();
      } else {
        Eigen::Map<RowMajor<kStateDim, kMotionSize>>{jacobians[block]} = J.rightCols<kMotionSize>();
      }
    }
    return true;
  }

 private:
  const Preintegration& imu_;
  const ImuNoise& noise_;
};

/// U d + r0, with d's Jacobian taken as the identity, as the smoother does.
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(const BenchmarkWindow& window) : window_(window) {
    set_num_residuals(window.prior.dimension());
    for (const PriorBlock& block : window.prior.blocks()) {
      mutable_parameter_block_sizes()->push_back(kPoseSize);
      if (block.dimension > kPoseDim) mutable_parameter_block_sizes()->push_back(kMotionSize);
    }
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::MatrixXd& U = window_.prior_root;
    Eigen::VectorXd d(U.cols());
    std::size_t at = 0;
    for (const PriorBlock& block : window_.prior.blocks()) {
      const bool whole = block.dimension > kPoseDim;
      static constexpr Motion kNone{};
      const BodyState x = stateOf(parameters[at], whole ? parameters[at + 1] : kNone.data());
      d.segment(block.offset, block.dimension) = x.minus(block.reference).head(block.dimension);
      if (jacobians != nullptr && jacobians[at] != nullptr) {
        Eigen::Map<RowMajor<Eigen::Dynamic, kPoseSize>> pose(jacobians[at], U.rows(), kPoseSize);
        pose.leftCols<kPoseDim>() = U.middleCols<kPoseDim>(block.offset);
        pose.col(kPoseDim).setZero();
      }
      if (whole && jacobians != nullptr && jacobians[at + 1] != nullptr) {
        Eigen::Map<RowMajor<Eigen::Dynamic, kMotionSize>>(jacobians[at + 1], U.rows(), kMotionSize) =
            U.middleCols<kMotionSize>(block.offset + kPoseDim);
      }
      at += whole ? 2 : 1;
    }
    Eigen::Map<Eigen::VectorXd>(residuals, U.rows()) =
        U.triangularView<Eigen::Upper>() * d + window_.prior_residual;
    return true;
  }

 private:
  const BenchmarkWindow& window_;
};

/// The smoother's Cauchy weight as a loss of Ceres: rho = 2 cost, rho' = weight.
class CauchyWeight : public ceres::LossFunction {
 public:
  void Evaluate(double squared_norm, double rho[3]) const override {
    const RobustWeight robust = RobustWeight::cauchy(squared_norm);
    rho[0] = 2 * robust.cost;
    rho[1] = robust.weight;
    rho[2] = -1;  // concave: Ceres then uses rho' alone, the iteratively reweighted step
  }
};

}  // namespace

struct CeresWindow::Parts : public ceres::EvaluationCallback {
  explicit Parts(const BenchmarkWindow& from) : window(from) {}

  void PrepareForEvaluation(bool, bool new_point) override {
    if (!new_point) return;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const SE3 T = poseOf(poses[k].data());
      for (std::size_t c = 0; c < window.rig.camera_count; ++c) {
        cameras[k][c] = CameraPose::of(T, window.rig.T_body_cam[c]);
      }
    }
  }

  const BenchmarkWindow& window;
  WindowValues initial;
  std::vector<Pose> poses;
  std::vector<Motion> motions;
  std::vector<Point> points;
  std::vector<PointFrame> frames;
  std::vector<std::array<CameraPose, kMaxCameras>> cameras;
  PoseManifold manifold;
  CauchyWeight loss;
  std::unique_ptr<ceres::Problem> problem;
};

CeresWindow::CeresWindow(const BenchmarkWindow& window) : parts_(std::make_unique<Parts>(window)) {
  Parts& p = *parts_;
  p.initial = window.values();
  p.poses.resize(window.order.size());
  p.motions.resize(window.order.size());
  p.points.resize(window.landmarks.size());
  p.cameras.resize(window.order.size());
  for (const LandmarkPoint& point : p.initial.points) {
    p.frames.push_back({point, PointBasis::of(point.bearing)});
  }
  reset();

  ceres::Problem::Options options;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.evaluation_callback = &p;
  options.disable_all_safety_checks = true;
  p.problem = std::make_unique<ceres::Problem>(options);
  for (Pose& pose : p.poses) p.problem->AddParameterBlock(pose.data(), kPoseSize, &p.manifold);
  for (std::size_t k = 1; k < window.order.size(); ++k) {
    const WindowState& j = window.states[window.order[k]];
    if (!window.states[window.order[k - 1]].has_motion) continue;
    p.problem->AddResidualBlock(new ImuCost(j.imu, window.noise), nullptr, p.poses[k - 1].data(),
                                p.motions[k - 1].data(), p.poses[k].data(), p.motions[k].data());
  }
  std::vector<double*> blocks;
  for (const PriorBlock& block : window.prior.blocks()) {
    blocks.push_back(p.poses[block.slot].data());
    if (block.dimension > kPoseDim) blocks.push_back(p.motions[block.slot].data());
  }
  p.problem->AddResidualBlock(new PriorCost(window), nullptr, blocks);
  for (std::size_t i = 0; i < window.landmarks.size(); ++i) {
    for (const Sighting& sighting : window.landmarks[i].sightings) {
      for (std::size_t c = 0; c < window.rig.camera_count; ++c) {
        if (!sighting.camera[c].used) continue;
        p.problem->AddResidualBlock(new SightingCost(sighting.camera[c], p.cameras[sighting.slot][c],
                                                     window.rig.T_body_cam[c], p.frames[i]),
                                    &p.loss, p.poses[sighting.slot].data(), p.points[i].data());
      }
    }
  }
}

CeresWindow::~CeresWindow() = default;

void CeresWindow::reset() {
  Parts& p = *parts_;
  for (std::size_t k = 0; k < p.poses.size(); ++k) {
    const BodyState& x = p.initial.states[k];
    Eigen::Map<Eigen::Quaterniond>{p.poses[k].data()} = x.T_world_body.rotation;
    Eigen::Map<Eigen::Vector3d>{p.poses[k].data() + 4} = x.T_world_body.translation;
    Eigen::Map<Eigen::Vector3d>{p.motions[k].data()} = x.v_world_body;
    Eigen::Map<Eigen::Vector3d>{p.motions[k].data() + 3} = x.bias_gyro;
    Eigen::Map<Eigen::Vector3d>{p.motions[k].data() + 6} = x.bias_accel;
  }
  for (std::size_t i = 0; i < p.points.size(); ++i) {
    p.points[i] = {0, 0, p.initial.points[i].inverse_depth};
  }
}

ceres::Solver::Summary CeresWindow::solve(const CeresSolver& solver, int iterations) {
  Parts& p = *parts_;
  ceres::Solver::Options options;
  options.linear_solver_type = solver.linear;
  options.dense_linear_algebra_library_type = solver.dense;
  options.sparse_linear_algebra_library_type = solver.sparse;
  options.num_threads = 1;
  options.max_num_iterations = iterations;
  options.logging_type = ceres::SILENT;
  // Gauss-Newton: a trust region without an end.
  options.initial_trust_region_radius = 1e16;
  options.max_trust_region_radius = 1e32;
  options.function_tolerance = 0;
  options.gradient_tolerance = 0;
  options.parameter_tolerance = 0;
  options.jacobi_scaling = false;  // Cholesky does not need it here, and Ceres is faster without
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (Point& point : p.points) ordering->AddElementToGroup(point.data(), 0);
  for (Pose& pose : p.poses) ordering->AddElementToGroup(pose.data(), 1);
  for (Motion& motion : p.motions) {
    if (p.problem->HasParameterBlock(motion.data())) ordering->AddElementToGroup(motion.data(), 1);
  }
  options.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(options, p.problem.get(), &summary);
  return summary;
}

WindowValues CeresWindow::values() const {
  const Parts& p = *parts_;
  WindowValues result = p.initial;
  for (std::size_t k = 0; k < p.poses.size(); ++k) {
    result.states[k] = stateOf(p.poses[k].data(), p.motions[k].data());
  }
  for (std::size_t i = 0; i < p.points.size(); ++i) {
    LandmarkPoint point = p.frames[i].at(p.points[i].data());
    const double scale = 1.0 / point.bearing.norm();
    point.bearing *= scale;
    point.inverse_depth *= scale;
    result.points[i] = point;
  }
  return result;
}

}  // namespace swiftlet::test
