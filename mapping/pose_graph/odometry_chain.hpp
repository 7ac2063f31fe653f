#pragma once
// The odometry as a chain of relative poses, which gives the covariance of any relative pose along it in
// constant time.
//
// Pose k in the frame of the first pose of its component is P_k = T_0_1 T_1_2 ... T_k-1_k. Each step has an
// error xi, T <- T Exp(xi), with covariance Q (rotation, translation; rad, m). In the component's frame it is
// m_k = Ad(P_k) xi_k, and the error of the chain from i to j is the sum of m_k, i < k <= j, with covariance
//   S_j - S_i,   S_k = sum of Ad(P_l) Q_l Ad(P_l)^T, l <= k;
// in pose j's own frame Ad(P_j^-1) (S_j - S_i) Ad(P_j^-1)^T. First order in the errors of the steps, which
// are taken as independent. Cancellation costs less than 1e-6 of the covariance after 20 000 steps and 1 km
// (tested).
//
// An epoch of the odometry is a component; there is no chain between components.
// Memory: pose, sum, box and component, 416 (space) or 144 (plane) bytes a pose, reserved by the constructor.

#include <Eigen/StdVector>
#include <cstdint>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {

template <typename Pose>
class OdometryChain {
 public:
  using Matrix = PoseMatrix<Pose>;
  using Point = decltype(Pose().translation);

  explicit OdometryChain(std::uint32_t max_poses);

  /// The first pose of a new component.
  Status beginComponent();
  /// The next pose. kInvalidInput if the step is not finite or there is no pose before; kCapacityReached if
  /// `max_poses` are held. Nothing changes then.
  Status append(const Pose& T_previous_this, const Matrix& covariance);

  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(nodes_.size()); }
  [[nodiscard]] std::uint32_t components() const { return nodes_.empty() ? 0 : nodes_.back().component + 1; }
  [[nodiscard]] std::uint32_t component(std::uint32_t k) const { return nodes_[k].component; }
  /// In the frame of its component's first pose.
  [[nodiscard]] const Pose& pose(std::uint32_t k) const { return nodes_[k].T_component_this; }
  /// S_k.
  [[nodiscard]] const Matrix& cumulated(std::uint32_t k) const { return nodes_[k].cumulated; }
  /// S_j - S_i, i <= j of one component.
  [[nodiscard]] Matrix between(std::uint32_t i, std::uint32_t j) const {
    return nodes_[j].cumulated - nodes_[i].cumulated;
  }
  /// T_i_j of one component.
  [[nodiscard]] Pose relative(std::uint32_t i, std::uint32_t j) const { return pose(i).inverse() * pose(j); }
  /// Covariance of xi in T_i_j <- T_i_j Exp(xi), i <= j of one component.
  [[nodiscard]] Matrix covariance(std::uint32_t i, std::uint32_t j) const;

  /// Logarithm of the volume [m^3, in the plane m^2] of the box around the component's poses up to k. Sides
  /// are at least kThinnest times the longest.
  [[nodiscard]] double logBox(std::uint32_t k) const;
  /// The same around all poses of k's component.
  [[nodiscard]] double logWholeBox(std::uint32_t k) const;

  /// Removes pose k; those after it move down by one. Relative poses and covariances of the others do not
  /// change. Not for the last pose. Linear in the poses after k.
  void erase(std::uint32_t k) { nodes_.erase(nodes_.begin() + k); }
  void clear() { nodes_.clear(); }

  /// Flights at one height or along a line have thin boxes, but false loops may lead beside them.
  static constexpr double kThinnest = 0.1;

 private:
  struct Node {
    Pose T_component_this;
    Matrix cumulated = Matrix::Zero();
    std::uint32_t component = 0;
    Point low = Point::Zero();  ///< box of the component's poses so far
    Point high = Point::Zero();
  };

  std::vector<Node> nodes_;
  std::uint32_t capacity_;
};

extern template class OdometryChain<SE2>;
extern template class OdometryChain<SE3>;

}  // namespace swiftlet
