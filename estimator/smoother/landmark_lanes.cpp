#include "estimator/smoother/landmark_lanes.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

using lanes::kLanes;
using lanes::V;

bool samePlace(const CameraPose& a, const CameraPose& b) {
  return a.center == b.center && a.R_cam_world == b.R_cam_world;
}

// M x + offset, M the same for all lanes.
void transform(const Eigen::Matrix3d& M, const V (&x)[3], const Eigen::Vector3d& offset, V (&result)[3]) {
  SWIFTLET_UNROLL
  for (std::size_t k = 0; k < 3; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    result[k] = M(i, 0) * x[0] + M(i, 1) * x[1] + M(i, 2) * x[2] + offset[i];
  }
}

}  // namespace

LandmarkLanes::LandmarkLanes(const Landmark& landmark, RigPoses poses,
                             const std::array<SE3, kMaxCameras>& T_body_cam)
    : point_(landmark.point), basis_(PointBasis::of(landmark.point.bearing)) {
  Camera cameras[kMaxCameras];
  for (std::size_t c = 0; c < kMaxCameras; ++c) cameras[c] = {T_body_cam[c].R(), T_body_cam[c].translation};
  const std::span<const Sighting> views = landmark.views();
  for (std::size_t first = 0; first < views.size(); first += kLanes) {
    PoseGroup& group = groups_[count_++];
    group = PoseGroup{};
    const std::span<const Sighting> four = views.subspan(first, std::min(kLanes, views.size() - first));
    for (std::size_t c = 0; c < kMaxCameras; ++c) addViews(c, cameras[c], four, poses, group);
    valid_states_ += lanes::count(group.valid);
  }
}

// One camera of four states. Residuals and weights are taken at the current poses, Jacobians at the
// linearization's: the same for states that the prior does not touch, and then one reprojection is enough.
void LandmarkLanes::addViews(std::size_t c, const Camera& camera, std::span<const Sighting> four,
                             RigPoses poses, PoseGroup& group) {
  lanes::ViewPointers current;
  lanes::ViewPointers linearization;
  bool moved = false;
  for (std::size_t l = 0; l < four.size(); ++l) {
    const CameraSighting& view = four[l].camera[c];
    if (!view.used) continue;
    const RigPose& rig = poses[four[l].slot];
    current.set(l, rig.current[c], view);
    linearization.set(l, rig.linearization[c], view);
    moved = moved || !samePlace(rig.current[c], rig.linearization[c]);
  }
  if (current.empty()) return;
  const lanes::ViewGroup now_views(current);
  const lanes::Residuals now(now_views, point_);
  if (moved) {
    const lanes::ViewGroup views(linearization);
    addRows(camera, views, now, lanes::Residuals(views, point_), group);
  } else {
    addRows(camera, now_views, now, now, group);
  }
}

void LandmarkLanes::addRows(const Camera& camera, const lanes::ViewGroup& views, const lanes::Residuals& now,
                            const lanes::Residuals& at, PoseGroup& group) {
  const lanes::Mask counts = views.used & now.in_front & at.in_front;
  group.valid |= counts;
  V weight;
  sums_.weigh(now, counts, weight);
  const lanes::Jacobians J(views, at, basis_);
  const double inverse_depth = point_.inverse_depth;
  V ray[3];  // body axes
  transform(camera.R_body_cam, at.h, inverse_depth * camera.center, ray);
  SWIFTLET_UNROLL
  for (std::size_t row = 0; row < 2; ++row) {
    V K[3];  // d r / d (ray in body axes)
    transform(camera.R_body_cam, J.G[row], Eigen::Vector3d::Zero(), K);
    const V pose[PoseGroup::kDim] = {K[1] * ray[2] - K[2] * ray[1], K[2] * ray[0] - K[0] * ray[2],
                                     K[0] * ray[1] - K[1] * ray[0], -inverse_depth * J.M[row][0],
                                     -inverse_depth * J.M[row][1],  -inverse_depth * J.M[row][2]};
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < PoseGroup::kDim; ++i) {
      const V weighted = weight * pose[i];
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < PoseGroup::kDim; ++j) group.information[entry++] += weighted * pose[j];
      SWIFTLET_UNROLL
      for (std::size_t j = 0; j < 3; ++j) group.point[i][j] += weighted * J.point[row][j];
      group.gradient[i] += weighted * now.r[row];
    }
    sums_.add(weight, J.point[row], now.r[row]);
  }
}

bool LandmarkLanes::eliminate() {
  if (valid_states_ < 2) return false;
  // A copy: stores to the groups cannot change it, as far as the compiler sees.
  PointFactor L;
  if (!L.compute(sums_.H())) return false;
  const Eigen::Vector3d c = sums_.g();
  double z[3] = {c[0], c[1], c[2]};
  L.solve(z);
  L_ = L;
  z_ << z[0], z[1], z[2];
  for (std::size_t k = 0; k < count_; ++k) {
    PoseGroup& group = groups_[k];
    // Y_i = B_i L^-T: each row is solved for by itself.
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < PoseGroup::kDim; ++i) {
      V(&y)[3] = group.point[i];
      L.solve(y);
      group.gradient[i] -= y[0] * z[0] + y[1] * z[1] + y[2] * z[2];
    }
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < PoseGroup::kDim; ++i) {
      const V* const yi = group.point[i];
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < PoseGroup::kDim; ++j) {
        const V* const yj = group.point[j];
        group.information[entry++] -= yi[0] * yj[0] + yi[1] * yj[1] + yi[2] * yj[2];
      }
    }
  }
  return true;
}

}  // namespace swiftlet
