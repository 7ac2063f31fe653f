#include "mapping/pose_graph/odometry_chain.hpp"

#include <algorithm>

namespace swiftlet {

template <typename Pose>
OdometryChain<Pose>::OdometryChain(std::uint32_t max_poses) : capacity_(max_poses) {
  nodes_.reserve(max_poses);
}

template <typename Pose>
Status OdometryChain<Pose>::beginComponent() {
  if (size() == capacity_) {
    return {StatusCode::kCapacityReached, "odometry chain is full"};
  }
  const std::uint32_t component = components();
  nodes_.push_back({Pose(), Matrix::Zero(), component, Point::Zero(), Point::Zero()});
  return okStatus();
}

template <typename Pose>
Status OdometryChain<Pose>::append(const Pose& T_previous_this, const Matrix& covariance) {
  if (nodes_.empty() || !allFinite(T_previous_this) || !covariance.allFinite()) {
    return {StatusCode::kInvalidInput, "an odometry step is not finite or has no pose before it"};
  }
  if (size() == capacity_) {
    return {StatusCode::kCapacityReached, "odometry chain is full"};
  }
  const Node& last = nodes_.back();
  const Pose T = last.T_component_this * T_previous_this;
  const Matrix adjoint = poseAdjoint(T);
  const Matrix sum = last.cumulated + adjoint * covariance * adjoint.transpose();
  nodes_.push_back(
      {T, sum, last.component, last.low.cwiseMin(T.translation), last.high.cwiseMax(T.translation)});
  return okStatus();
}

template <typename Pose>
typename OdometryChain<Pose>::Matrix OdometryChain<Pose>::covariance(std::uint32_t i, std::uint32_t j) const {
  const Matrix adjoint = poseAdjoint(pose(j).inverse());
  return adjoint * between(i, j) * adjoint.transpose();
}

template <typename Pose>
double OdometryChain<Pose>::logBox(std::uint32_t k) const {
  const Point sides = nodes_[k].high - nodes_[k].low;
  return sides.cwiseMax(kThinnest * sides.maxCoeff()).array().log().sum();
}

template <typename Pose>
double OdometryChain<Pose>::logWholeBox(std::uint32_t k) const {
  const auto end = std::upper_bound(nodes_.begin(), nodes_.end(), component(k),
                                    [](std::uint32_t of, const Node& node) { return of < node.component; });
  return logBox(static_cast<std::uint32_t>(end - nodes_.begin()) - 1);
}

template class OdometryChain<SE2>;
template class OdometryChain<SE3>;

}  // namespace swiftlet
