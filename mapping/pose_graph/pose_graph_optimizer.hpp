#pragma once
// Minimizes g2o's cost (pose_graph.hpp) over poses in SE(2) or SE(3).
//
// Gauss-Newton in a trust region (Powell's dogleg in the norm of the normal equations' diagonal) with exact
// Jacobians. The normal equations are blocks of poses, factored by BlockCholesky. A rejected step costs an
// evaluation of the cost, not a factorization. start() computes initial poses if the present ones are poor.
//
// In a flight one optimizer is kept: add poses and edges and call optimize() with the effort that time
// allows. It continues from the present poses and keeps ordering and memory until a new pair of poses is
// joined.
//
// Frames: T_map_body. Held poses do not move: those given to hold(), and the first pose of every piece of the
// graph without one (only in heading and position if a pose of the piece knows the vertical). Weights
// multiply an edge's information: 0 leaves an edge out, between 0 and 1 discounts it (graduated
// non-convexity).
//
// Errors: Status. Memory: poses and edges are reserved at construction, and the factor if max_factor_values
// is set; a graph whose factor needs more is then refused. Ordering and analysis of a changed graph take
// scratch memory. Deterministic; no clock. Off the flight path. Sources: Rosen, Kaess, Leonard, "RISE: an
// incremental trust-region method", T-RO 2014 (dogleg on pose graphs); Nocedal and Wright, "Numerical
// Optimization", 2006, chapter 4; docs/pose_graph.md.

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/block_cholesky.hpp"
#include "mapping/pose_graph/graph_layout.hpp"
#include "mapping/pose_graph/pose_error.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

struct PoseGraphLimits {
  std::size_t max_poses = 0;
  std::size_t max_edges = 0;
  std::size_t max_factor_values = 0;  ///< doubles reserved for the factor; 0: allocated as a graph needs them
};

struct OptimizeEffort {
  int iterations = 50;       ///< linearizations and factorizations
  int trials = 10;           ///< steps tried per iteration
  double tolerance = 1e-7;   ///< stops when an iteration lowers the cost by a smaller share
  double cost_floor = 1e-9;  ///< stops below this cost
};

struct OptimizeReport {
  double initial_cost = 0;  ///< g2o's: 1/2 sum e^T Omega e, with the weights
  double final_cost = 0;
  int iterations = 0;
  int rejected = 0;        ///< steps tried and rejected
  bool converged = false;  ///< by the tolerance, the floor, or because no step lowers the cost
};

enum class StartChoice : std::uint8_t { kGiven, kChordal };

struct StartReport {
  StartChoice choice = StartChoice::kGiven;
  double given_cost = 0;    ///< at the given poses
  double chordal_cost = 0;  ///< infinite if not computed or the linear systems have no solution
};

template <typename Pose>
class PoseGraphOptimizer {
 public:
  static constexpr int kDof = PoseSpace<Pose>::kDof;
  using Covariance = Eigen::Matrix<double, kDof, kDof>;

  explicit PoseGraphOptimizer(const PoseGraphLimits& limits);

  /// kCapacityReached if the graph is full (nothing is added). kInvalidInput if a number is not finite, a
  /// pose does not exist, both ends are one pose, or the information is not symmetric.
  Status addPose(const Pose& T_map_body);
  Status addEdge(const RelativePose<Pose>& edge);
  /// Replaces everything by `graph`.
  Status assign(const PoseGraph<Pose>& graph);

  /// kInvalidInput: no such pose or edge, or a weight below 0 or not finite.
  Status hold(std::size_t pose, bool held);
  Status setWeight(std::size_t edge, double weight);
  /// Replaces the gravity factor of the pose. Ignored in the plane.
  Status setGravity(std::size_t pose, const GravityFactor& factor);
  Status setPose(std::size_t pose, const Pose& T_map_body);
  /// Removes all edges from index `edges` on, and all poses from index `poses` on.
  Status truncate(std::size_t poses, std::size_t edges);

  /// Takes the poses of ChordalStart if they cost less than the present ones (docs/pose_graph.md section 3),
  /// or, with `anew`, even if they cost more. Keeps the present ones if these fit, if ChordalStart fails, or
  /// if a piece of the graph is anchored instead of held (GraphLayout). kNotReady and kCapacityReached as for
  /// optimize().
  Status start(StartReport& report, bool anew = false);

  /// kNotReady without poses; kNumerical if the normal equations cannot be factored even with damping;
  /// kCapacityReached if the factor needs more than max_factor_values. The poses are then the best so far.
  Status optimize(const OptimizeEffort& effort, OptimizeReport& report);

  /// At the present poses, relative to the held ones, in the pose's own frame (phi, rho): rad, m. Zero for
  /// held poses. kNumerical if edges do not determine the poses.
  Status covariance(std::size_t pose, Covariance& out);
  /// Covariance of T_from_to, perturbed on the right: in the frame of `to`.
  Status relativeCovariance(std::size_t from, std::size_t to, Covariance& out);

  [[nodiscard]] const PoseGraph<Pose>& graph() const { return graph_; }
  [[nodiscard]] double weight(std::size_t edge) const { return weights_[edge]; }
  [[nodiscard]] double cost() const { return costAt(graph_.poses); }
  [[nodiscard]] const GraphLayout& layout();  ///< of the present graph

 private:
  Status arrange();
  void linearize();
  void linearizeGravity();
  void anchor();
  Status factorNormalEquations();
  Status iterate(const OptimizeEffort& effort, OptimizeReport& report, bool& done);
  void stayAnchored(Eigen::VectorXd& step) const;
  void dogleg(Eigen::VectorXd& step) const;
  [[nodiscard]] double predictedDecrease(const Eigen::VectorXd& step) const;
  [[nodiscard]] Eigen::VectorXd timesH(const Eigen::VectorXd& x) const;
  [[nodiscard]] double costAt(const std::vector<Pose>& poses) const;
  Status factorForCovariance();

  PoseGraphLimits limits_;
  PoseGraph<Pose> graph_;
  std::vector<double> weights_;
  std::vector<bool> held_;
  std::vector<GravityFactor> gravity_;  ///< of each pose
  bool arranged_ = false;
  bool linear_at_poses_ = false;  ///< H and its undamped factor belong to the present poses and weights
  double radius_ = 0;             ///< of the trust region, scaled; 0: not known yet

  GraphLayout layout_;
  BlockMatrix<kDof> H_;
  BlockCholesky<kDof> factor_;
  Eigen::VectorXd gradient_;
  Eigen::VectorXd scale_;  ///< square root of H's diagonal
  Eigen::VectorXd damping_;
  Eigen::VectorXd newton_;
  Eigen::VectorXd cauchy_;
  std::vector<Pose> trial_;
};

}  // namespace swiftlet
