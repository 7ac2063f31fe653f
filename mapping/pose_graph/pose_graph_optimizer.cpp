#include "mapping/pose_graph/pose_graph_optimizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/pose_graph/chordal_start.hpp"

namespace swiftlet {
namespace {

constexpr double kNothingToGain = 1e-9;  // cost below which the given poses fit and are kept
constexpr double kFirstDamping = 1e-9;   // share of the diagonal, if undamped equations have no factor
constexpr double kDampingUp = 100;
constexpr int kDampingTries = 6;
constexpr double kAccepted = 1e-4;  // these three: share of the predicted decrease
constexpr double kPoor = 0.25;
constexpr double kGood = 0.75;
constexpr double kShrink = 0.5;                 // radius over the length of a rejected or poor step
constexpr double kGrow = 3;                     // radius over the length of a good step, at least
constexpr double kInformationAsymmetry = 1e-9;  // of the largest entry

/// Stiffness of an anchor relative to its own diagonal: large enough to hold against all edges.
constexpr double kAnchorStiffness = 1e6;

/// The map's vertical in the body's axes.
Eigen::Vector3d upOf(const SE3& pose) { return pose.rotation.conjugate() * Eigen::Vector3d::UnitZ(); }
Eigen::Vector3d upOf(const SE2& /*pose*/) { return Eigen::Vector3d::UnitZ(); }

bool finite(const SE2& pose) { return std::isfinite(pose.angle) && pose.translation.allFinite(); }
bool finite(const SE3& pose) { return pose.rotation.coeffs().allFinite() && pose.translation.allFinite(); }

}  // namespace

template <typename Pose>
PoseGraphOptimizer<Pose>::PoseGraphOptimizer(const PoseGraphLimits& limits) : limits_(limits) {
  graph_.poses.reserve(limits.max_poses);
  graph_.edges.reserve(limits.max_edges);
  weights_.reserve(limits.max_edges);
  held_.reserve(limits.max_poses);
  gravity_.reserve(limits.max_poses);
  trial_.reserve(limits.max_poses);
  factor_.reserve(limits.max_factor_values);
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::addPose(const Pose& T_map_body) {
  if (graph_.poses.size() >= limits_.max_poses)
    return {StatusCode::kCapacityReached, "the graph is full: no more poses"};
  if (!finite(T_map_body)) return {StatusCode::kInvalidInput, "a pose is not finite"};
  graph_.poses.push_back(T_map_body);
  held_.push_back(false);
  gravity_.emplace_back();
  arranged_ = linear_at_poses_ = false;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::addEdge(const RelativePose<Pose>& edge) {
  if (graph_.edges.size() >= limits_.max_edges)
    return {StatusCode::kCapacityReached, "the graph is full: no more edges"};
  if (edge.from >= graph_.poses.size() || edge.to >= graph_.poses.size()) {
    return {StatusCode::kInvalidInput, "an edge's pose does not exist"};
  }
  if (edge.from == edge.to) return {StatusCode::kInvalidInput, "an edge connects a pose to itself"};
  if (!finite(edge.T_from_to) || !edge.information.allFinite()) {
    return {StatusCode::kInvalidInput, "an edge is not finite"};
  }
  const double largest = edge.information.cwiseAbs().maxCoeff();
  if ((edge.information - edge.information.transpose()).cwiseAbs().maxCoeff() >
      kInformationAsymmetry * largest) {
    return {StatusCode::kInvalidInput, "an edge's information is not symmetric"};
  }
  graph_.edges.push_back(edge);
  weights_.push_back(1.0);
  linear_at_poses_ = false;
  arranged_ = arranged_ && layout_.append({edge.from, edge.to});
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::assign(const PoseGraph<Pose>& graph) {
  graph_.poses.clear();
  graph_.edges.clear();
  weights_.clear();
  held_.clear();
  gravity_.clear();
  radius_ = 0;
  for (const Pose& pose : graph.poses) {
    if (const Status status = addPose(pose); !status.ok()) return status;
  }
  for (const RelativePose<Pose>& edge : graph.edges) {
    if (const Status status = addEdge(edge); !status.ok()) return status;
  }
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::hold(std::size_t pose, bool held) {
  if (pose >= graph_.poses.size()) return {StatusCode::kInvalidInput, "no such pose to hold"};
  if (held_[pose] != held) arranged_ = linear_at_poses_ = false;
  held_[pose] = held;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::setWeight(std::size_t edge, double weight) {
  if (edge >= graph_.edges.size() || !(weight >= 0) || !std::isfinite(weight)) {
    return {StatusCode::kInvalidInput, "no such edge, or not a weight"};
  }
  linear_at_poses_ = linear_at_poses_ && weights_[edge] == weight;
  weights_[edge] = weight;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::setGravity(std::size_t pose, const GravityFactor& factor) {
  if (pose >= graph_.poses.size() || !factor.information.allFinite() || !factor.up_body.allFinite()) {
    return {StatusCode::kInvalidInput, "no such pose, or a gravity factor that is not finite"};
  }
  if (kDof == 3) return okStatus();
  const bool known = gravity_[pose].information.trace() > 0;
  if (known != (factor.information.trace() > 0)) arranged_ = false;
  linear_at_poses_ = false;
  gravity_[pose] = factor;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::setPose(std::size_t pose, const Pose& T_map_body) {
  if (pose >= graph_.poses.size() || !finite(T_map_body)) {
    return {StatusCode::kInvalidInput, "no such pose, or one that is not finite"};
  }
  graph_.poses[pose] = T_map_body;
  linear_at_poses_ = false;
  radius_ = 0;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::truncate(std::size_t poses, std::size_t edges) {
  if (poses > graph_.poses.size() || edges > graph_.edges.size()) {
    return {StatusCode::kInvalidInput, "the graph is smaller already"};
  }
  for (std::size_t e = 0; e < edges; ++e) {
    if (graph_.edges[e].from >= poses || graph_.edges[e].to >= poses) {
      return {StatusCode::kInvalidInput, "an edge that stays needs a pose that goes"};
    }
  }
  graph_.poses.resize(poses);
  graph_.edges.resize(edges);
  weights_.resize(edges);
  held_.resize(poses);
  gravity_.resize(poses);
  arranged_ = linear_at_poses_ = false;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::arrange() {
  if (graph_.poses.empty()) return {StatusCode::kNotReady, "the graph has no poses"};
  if (arranged_) return okStatus();
  std::vector<BlockPair> ends;
  ends.reserve(graph_.edges.size());
  for (const RelativePose<Pose>& edge : graph_.edges) ends.emplace_back(edge.from, edge.to);
  std::vector<bool> knows_vertical;
  for (const GravityFactor& factor : gravity_) knows_vertical.push_back(factor.information.trace() > 0);
  layout_.arrange(graph_.poses.size(), ends, held_, knows_vertical);
  const std::size_t needed = BlockCholesky<kDof>::values(layout_.structure);
  if (limits_.max_factor_values > 0 && needed > limits_.max_factor_values) {
    return {StatusCode::kCapacityReached, "the graph's factor needs more memory than was reserved"};
  }
  factor_.prepare(layout_.structure);
  arranged_ = true;
  return okStatus();
}

template <typename Pose>
const GraphLayout& PoseGraphOptimizer<Pose>::layout() {
  static_cast<void>(arrange());
  return layout_;
}

template <typename Pose>
double PoseGraphOptimizer<Pose>::costAt(const std::vector<Pose>& poses) const {
  double cost = 0;
  for (std::size_t e = 0; e < graph_.edges.size(); ++e) {
    if (weights_[e] == 0) continue;
    const RelativePose<Pose>& edge = graph_.edges[e];
    cost += weights_[e] * edgeCost(edge, poses[edge.from], poses[edge.to]);
  }
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (!(gravity_[k].information.trace() > 0)) continue;
    const Eigen::Vector3d e = upOf(poses[k]).cross(gravity_[k].up_body);
    cost += 0.5 * e.dot(gravity_[k].information * e);
  }
  return cost;
}

template <typename Pose>
void PoseGraphOptimizer<Pose>::linearize() {
  H_.reset(layout_.unknowns, layout_.pairs.size());
  gradient_.setZero(static_cast<Eigen::Index>(layout_.unknowns) * kDof);
  for (std::size_t e = 0; e < graph_.edges.size(); ++e) {
    const double weight = weights_[e];
    if (weight == 0) continue;
    const RelativePose<Pose>& edge = graph_.edges[e];
    const std::uint32_t from = layout_.unknown[edge.from];
    const std::uint32_t to = layout_.unknown[edge.to];
    const EdgeLinearization<Pose> lin =
        linearized(edge.T_from_to, graph_.poses[edge.from], graph_.poses[edge.to]);
    const PoseBlock<Pose> weighted = weight * lin.jacobian_to.transpose() * edge.information;
    const PoseTangent<Pose> g = weighted * lin.error;
    const PoseBlock<Pose> W = weighted * lin.jacobian_to;
    if (to != GraphLayout::kHeld) {
      H_.diagonal[to] += W;
      gradient_.segment<kDof>(static_cast<Eigen::Index>(to) * kDof) += g;
    }
    if (from == GraphLayout::kHeld) continue;
    const PoseBlock<Pose> WA = W * lin.adjoint;
    H_.diagonal[from].noalias() += lin.adjoint.transpose() * WA;
    gradient_.segment<kDof>(static_cast<Eigen::Index>(from) * kDof).noalias() -= lin.adjoint.transpose() * g;
    const std::uint32_t pair = layout_.edge_pair[e];
    if (pair == GraphLayout::kNoPair) continue;
    if (layout_.edge_reversed[e]) {
      H_.pairs[pair] -= WA;
    } else {
      H_.pairs[pair] -= WA.transpose();
    }
  }
  linearizeGravity();
  anchor();
  scale_.resize(gradient_.size());
  double largest = 0;
  for (std::size_t k = 0; k < H_.diagonal.size(); ++k) {
    scale_.segment<kDof>(static_cast<Eigen::Index>(k) * kDof) = H_.diagonal[k].diagonal();
    largest = std::max(largest, H_.diagonal[k].diagonal().maxCoeff());
  }
  // Unknowns that no edge determines get a small scale, to avoid divisions by zero.
  constexpr double kLeastScale = 1e-12;
  const double least = largest > 0 ? kLeastScale * largest : 1.0;
  scale_ = scale_.cwiseMax(least).cwiseSqrt();
}

template <typename Pose>
void PoseGraphOptimizer<Pose>::linearizeGravity() {
  for (std::size_t k = 0; k < graph_.poses.size(); ++k) {
    const GravityFactor& factor = gravity_[k];
    if (!(factor.information.trace() > 0)) continue;
    const Eigen::Vector3d e = upOf(graph_.poses[k]).cross(factor.up_body);
    if (layout_.unknown[k] == GraphLayout::kHeld) continue;
    const Eigen::Matrix3d J = -hat(factor.up_body) * hat(upOf(graph_.poses[k]));
    const Eigen::Matrix3d weighted = J.transpose() * factor.information;
    H_.diagonal[layout_.unknown[k]].template topLeftCorner<3, 3>() += weighted * J;
    gradient_.segment<3>(static_cast<Eigen::Index>(layout_.unknown[k]) * kDof) += weighted * e;
  }
}

/// Holds heading and position of the anchors. The cost does not depend on those of a whole piece, so holding
/// them does not change the solution's shape.
template <typename Pose>
void PoseGraphOptimizer<Pose>::anchor() {
  for (const std::uint32_t k : layout_.anchors) {
    auto& block = H_.diagonal[layout_.unknown[k]];
    const Eigen::Vector3d up = upOf(graph_.poses[k]);
    const double turn = kAnchorStiffness * block.template topLeftCorner<3, 3>().trace();
    const double move = kAnchorStiffness * block.template bottomRightCorner<3, 3>().trace();
    block.template topLeftCorner<3, 3>() += turn * up * up.transpose();
    block.template bottomRightCorner<3, 3>().diagonal().array() += move;
  }
}

/// Removes heading and position of the anchors from a step. Not needed for Gauss-Newton steps: H holds them.
template <typename Pose>
void PoseGraphOptimizer<Pose>::stayAnchored(Eigen::VectorXd& step) const {
  for (const std::uint32_t k : layout_.anchors) {
    const Eigen::Vector3d up = upOf(graph_.poses[k]);
    auto at = step.segment<kDof>(static_cast<Eigen::Index>(layout_.unknown[k]) * kDof);
    at.template head<3>() -= up * up.dot(at.template head<3>());
    at.template tail<3>().setZero();
  }
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::factorNormalEquations() {
  double damping = 0;
  for (int k = 0; k < kDampingTries; ++k) {
    if (damping > 0) {
      damping_ = damping * scale_.cwiseAbs2();
    } else {
      damping_.resize(0);
    }
    if (factor_.factor(H_, damping_)) return okStatus();
    damping = std::max(kDampingUp * damping, kFirstDamping);
  }
  return {StatusCode::kNumerical, "the normal equations cannot be factored"};
}

template <typename Pose>
Eigen::VectorXd PoseGraphOptimizer<Pose>::timesH(const Eigen::VectorXd& x) const {
  Eigen::VectorXd y(x.size());
  const auto at = [](std::uint32_t k) { return static_cast<Eigen::Index>(k) * kDof; };
  for (std::uint32_t k = 0; k < H_.diagonal.size(); ++k) {
    y.segment<kDof>(at(k)).noalias() = H_.diagonal[k] * x.segment<kDof>(at(k));
  }
  for (std::size_t k = 0; k < H_.pairs.size(); ++k) {
    const auto [a, b] = layout_.pairs[k];
    y.segment<kDof>(at(a)).noalias() += H_.pairs[k] * x.segment<kDof>(at(b));
    y.segment<kDof>(at(b)).noalias() += H_.pairs[k].transpose() * x.segment<kDof>(at(a));
  }
  return y;
}

template <typename Pose>
double PoseGraphOptimizer<Pose>::predictedDecrease(const Eigen::VectorXd& step) const {
  return -gradient_.dot(step) - 0.5 * step.dot(timesH(step));
}

/// The step of least predicted cost on the path from here over the Cauchy point to the Gauss-Newton step, no
/// longer than the radius. Lengths are |scale .* step|.
template <typename Pose>
void PoseGraphOptimizer<Pose>::dogleg(Eigen::VectorXd& step) const {
  const Eigen::VectorXd newton = scale_.cwiseProduct(newton_);
  const Eigen::VectorXd cauchy = scale_.cwiseProduct(cauchy_);
  const double newton_length = newton.norm();
  const double cauchy_length = cauchy.norm();
  if (newton_length <= radius_) {
    step = newton_;
    return;
  }
  if (cauchy_length >= radius_) {
    step = radius_ / cauchy_length * cauchy_;
    return;
  }
  // |cauchy + t (newton - cauchy)| = radius, the root in [0, 1].
  const Eigen::VectorXd leg = newton - cauchy;
  const double a = leg.squaredNorm();
  const double b = cauchy.dot(leg);
  const double c = cauchy_length * cauchy_length - radius_ * radius_;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  const double t = b > 0 ? -c / (b + root) : (root - b) / a;
  step = cauchy_ + t * (newton_ - cauchy_);
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::iterate(const OptimizeEffort& effort, OptimizeReport& report, bool& done) {
  done = false;
  linearize();
  linear_at_poses_ = false;
  if (const Status status = factorNormalEquations(); !status.ok()) return status;
  newton_ = -gradient_;
  factor_.solve(newton_);
  if (!newton_.allFinite()) return {StatusCode::kNumerical, "the normal equations' solution is not finite"};
  Eigen::VectorXd downhill = -gradient_.cwiseQuotient(scale_.cwiseAbs2());
  stayAnchored(downhill);
  const double slope = -gradient_.dot(downhill);
  const double curvature = downhill.dot(timesH(downhill));
  cauchy_ = curvature > 0 ? Eigen::VectorXd(slope / curvature * downhill) : newton_;
  const double newton_length = scale_.cwiseProduct(newton_).norm();
  if (radius_ == 0) radius_ = newton_length;
  Eigen::VectorXd step;
  for (int trial = 0; trial < effort.trials; ++trial) {
    dogleg(step);
    const double predicted = predictedDecrease(step);
    trial_ = graph_.poses;
    for (std::size_t k = 0; k < trial_.size(); ++k) {
      if (layout_.unknown[k] == GraphLayout::kHeld) continue;
      trial_[k] =
          retracted(trial_[k], step.segment<kDof>(static_cast<Eigen::Index>(layout_.unknown[k]) * kDof));
    }
    const double cost = costAt(trial_);
    const double gain = report.final_cost - cost;
    const double length = scale_.cwiseProduct(step).norm();
    if (gain > kAccepted * predicted && gain > 0) {
      if (gain > kGood * predicted) radius_ = std::max(radius_, kGrow * length);
      if (gain < kPoor * predicted) radius_ = kShrink * length;
      graph_.poses.swap(trial_);
      done = gain <= effort.tolerance * report.final_cost || cost <= effort.cost_floor;
      report.final_cost = cost;
      return okStatus();
    }
    ++report.rejected;
    // The predicted decrease is below the tolerance: a shorter step cannot gain more.
    if (predicted <= effort.tolerance * report.final_cost || !(predicted > 0)) break;
    radius_ = kShrink * std::min(length, radius_);
  }
  done = true;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::optimize(const OptimizeEffort& effort, OptimizeReport& report) {
  report = {};
  if (graph_.poses.empty()) return {StatusCode::kNotReady, "the graph has no poses"};
  report.initial_cost = report.final_cost = cost();
  report.converged = report.initial_cost <= effort.cost_floor;
  if (report.converged) return okStatus();
  if (const Status status = arrange(); !status.ok()) return status;
  report.converged = layout_.unknowns == 0;
  while (!report.converged && report.iterations < effort.iterations) {
    ++report.iterations;
    if (const Status status = iterate(effort, report, report.converged); !status.ok()) return status;
  }
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::start(StartReport& report, bool anew) {
  report = {};
  report.given_cost = cost();
  report.chordal_cost = std::numeric_limits<double>::infinity();
  if (report.given_cost <= kNothingToGain) return okStatus();
  if (const Status status = arrange(); !status.ok()) return status;
  std::vector<Pose> poses = graph_.poses;
  if (!layout_.anchors.empty()) return okStatus();  // ChordalStart needs a held pose in each piece
  ChordalStart<Pose> chordal;
  if (!chordal.run(graph_.edges, weights_, layout_, poses).ok()) return okStatus();
  report.chordal_cost = costAt(poses);
  if (!(report.chordal_cost < report.given_cost) && !anew) return okStatus();
  report.choice = StartChoice::kChordal;
  graph_.poses.swap(poses);
  linear_at_poses_ = false;
  radius_ = 0;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::factorForCovariance() {
  if (const Status status = arrange(); !status.ok()) return status;
  if (linear_at_poses_) return okStatus();
  linearize();
  damping_.resize(0);
  if (!factor_.factor(H_, damping_)) {
    return {StatusCode::kNumerical, "the edges do not determine all poses: no covariance"};
  }
  linear_at_poses_ = true;
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::covariance(std::size_t pose, Covariance& out) {
  if (pose >= graph_.poses.size()) return {StatusCode::kInvalidInput, "no such pose"};
  if (const Status status = factorForCovariance(); !status.ok()) return status;
  out.setZero();
  const std::uint32_t unknown = layout_.unknown[pose];
  if (unknown == GraphLayout::kHeld) return okStatus();
  const Eigen::Index at = static_cast<Eigen::Index>(unknown) * kDof;
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(gradient_.size(), kDof);
  columns.template middleRows<kDof>(at).setIdentity();
  factor_.solve(columns);
  out = columns.template middleRows<kDof>(at);
  return okStatus();
}

template <typename Pose>
Status PoseGraphOptimizer<Pose>::relativeCovariance(std::size_t from, std::size_t to, Covariance& out) {
  if (from >= graph_.poses.size() || to >= graph_.poses.size()) {
    return {StatusCode::kInvalidInput, "no such pose"};
  }
  if (const Status status = factorForCovariance(); !status.ok()) return status;
  // d(T_from_to) = d(to) - Ad(T_from_to^-1) d(from): the columns of this Jacobian, transposed, as right
  // sides.
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(gradient_.size(), kDof);
  const auto rows = [&](std::size_t pose) {
    return columns.template middleRows<kDof>(static_cast<Eigen::Index>(layout_.unknown[pose]) * kDof);
  };
  const PoseBlock<Pose> adjoint = inverseAdjoint(graph_.poses[from].inverse() * graph_.poses[to]);
  out.setZero();
  if (from == to) return okStatus();
  if (layout_.unknown[to] != GraphLayout::kHeld) rows(to).setIdentity();
  if (layout_.unknown[from] != GraphLayout::kHeld) rows(from) = -adjoint.transpose();
  factor_.solve(columns);
  if (layout_.unknown[to] != GraphLayout::kHeld) out += rows(to);
  if (layout_.unknown[from] != GraphLayout::kHeld) out -= adjoint * rows(from);
  out = (0.5 * (out + out.transpose())).eval();
  return okStatus();
}

template class PoseGraphOptimizer<SE2>;
template class PoseGraphOptimizer<SE3>;

}  // namespace swiftlet
