#include "tests/benchmark/pose_graph_ceres.hpp"

#include <ceres/iteration_callback.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include <Eigen/Eigenvalues>
#include <array>

#include "mapping/pose_graph/pose_error.hpp"
#include "tests/support/cpu_time.hpp"

namespace swiftlet::test {
namespace {

constexpr int kMaxIterations = 200;
constexpr double kTightTolerance = 1e-9;  // the goal ends a run, or no progress at all

template <typename Pose>
constexpr int kSize = 0;
template <>
constexpr int kSize<SE2> = 3;  // angle, position: no manifold, the error wraps
template <>
constexpr int kSize<SE3> = 7;  // quaternion x, y, z, w; position

SE2 poseOf(const SE2&, const double* x) { return {x[0], {x[1], x[2]}}; }
SE3 poseOf(const SE3&, const double* x) {
  SE3 T;
  T.rotation = Eigen::Map<const Eigen::Quaterniond>(x);
  T.translation = Eigen::Map<const Eigen::Vector3d>(x + 4);
  return T;
}
void put(const SE2& T, double* x) {
  x[0] = T.angle;
  x[1] = T.translation.x();
  x[2] = T.translation.y();
}
void put(const SE3& T, double* x) {
  Eigen::Map<Eigen::Quaterniond>{x} = T.rotation;
  Eigen::Map<Eigen::Vector3d>{x + 4} = T.translation;
}

/// R <- R Exp(phi), p <- p + R rho; the cost function's Jacobians stand in the first six columns.
class SpaceManifold : public ceres::Manifold {
 public:
  [[nodiscard]] int AmbientSize() const override { return 7; }
  [[nodiscard]] int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* moved) const override {
    put(retracted(poseOf(SE3(), x), Eigen::Map<const Eigen::Matrix<double, 6, 1>>(delta)), moved);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    const SE3 relative = poseOf(SE3(), x).inverse() * poseOf(SE3(), y);
    Eigen::Map<Eigen::Vector3d>{delta} = logSo3(relative.rotation);
    Eigen::Map<Eigen::Vector3d>{delta + 3} = relative.translation;
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
};

/// Derivative by the parameters from that by the tangent of the right perturbation.
template <typename Jacobian>
void store(const SE2& T, const PoseBlock<SE2>& by_tangent, Jacobian&& out) {
  out.template leftCols<1>() = by_tangent.leftCols<1>();
  out.template rightCols<2>() = by_tangent.rightCols<2>() * T.R().transpose();
}
template <typename Jacobian>
void store(const SE3&, const PoseBlock<SE3>& by_tangent, Jacobian&& out) {
  out.template leftCols<6>() = by_tangent;
  out.template rightCols<1>().setZero();
}

template <typename Pose>
class EdgeCost : public ceres::SizedCostFunction<PoseSpace<Pose>::kDof, kSize<Pose>, kSize<Pose>> {
 public:
  explicit EdgeCost(const RelativePose<Pose>& edge) : measured_(edge.T_from_to) {
    const Eigen::SelfAdjointEigenSolver<PoseBlock<Pose>> eigen(edge.information);
    root_ = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    constexpr int kDof = PoseSpace<Pose>::kDof;
    using RowMajor = Eigen::Matrix<double, kDof, kSize<Pose>, Eigen::RowMajor>;
    const Pose from = poseOf(Pose(), parameters[0]);
    const Pose to = poseOf(Pose(), parameters[1]);
    Eigen::Map<PoseTangent<Pose>> whitened(residuals);
    if (jacobians == nullptr) {
      whitened = root_ * relativeError(measured_, from, to);
      return true;
    }
    const EdgeLinearization<Pose> lin = linearized(measured_, from, to);
    whitened = root_ * lin.error;
    const PoseBlock<Pose> by_to = root_ * lin.jacobian_to;
    if (jacobians[1] != nullptr) store(to, by_to, Eigen::Map<RowMajor>(jacobians[1]));
    if (jacobians[0] != nullptr) store(from, -by_to * lin.adjoint, Eigen::Map<RowMajor>(jacobians[0]));
    return true;
  }

 private:
  Pose measured_;
  PoseBlock<Pose> root_;
};

class Watch : public ceres::IterationCallback {
 public:
  Watch(double goal, CeresRun& run)
      : goal_(goal), run_(run), start_(cpuMilliseconds(CLOCK_PROCESS_CPUTIME_ID)) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    run_.iterations = summary.iteration;
    run_.final_cost = summary.cost;
    run_.cpu_ms = cpuMilliseconds(CLOCK_PROCESS_CPUTIME_ID) - start_;
    run_.reached = summary.cost <= goal_;
    return run_.reached ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double goal_;
  CeresRun& run_;
  double start_;
};

}  // namespace

template <typename Pose>
CeresRun solveWithCeres(const PoseGraph<Pose>& graph, double goal, CeresSteps steps) {
  std::vector<std::array<double, static_cast<std::size_t>(kSize<Pose>)>> values(graph.poses.size());
  SpaceManifold manifold;
  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (std::size_t k = 0; k < values.size(); ++k) {
    put(graph.poses[k], values[k].data());
    problem.AddParameterBlock(values[k].data(), kSize<Pose>, kSize<Pose> == 7 ? &manifold : nullptr);
  }
  for (const RelativePose<Pose>& edge : graph.edges) {
    problem.AddResidualBlock(new EdgeCost<Pose>(edge), nullptr, values[edge.from].data(),
                             values[edge.to].data());
  }
  problem.SetParameterBlockConstant(values[0].data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.trust_region_strategy_type =
      steps == CeresSteps::kLevenberg ? ceres::LEVENBERG_MARQUARDT : ceres::DOGLEG;
  options.num_threads = 1;
  options.max_num_iterations = kMaxIterations;
  options.function_tolerance = kTightTolerance;
  options.gradient_tolerance = kTightTolerance;
  options.parameter_tolerance = kTightTolerance;
  options.logging_type = ceres::SILENT;
  CeresRun run;
  Watch watch(goal, run);
  options.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return run;
}

template CeresRun solveWithCeres(const PoseGraph<SE2>&, double, CeresSteps);
template CeresRun solveWithCeres(const PoseGraph<SE3>&, double, CeresSteps);

}  // namespace swiftlet::test
