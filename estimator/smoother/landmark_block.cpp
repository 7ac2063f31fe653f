#include "estimator/smoother/landmark_block.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

using lanes::kLanes;
using lanes::V;

bool samePlace(const CameraPose& a, const CameraPose& b) {
  return a.center == b.center && a.R_cam_world == b.R_cam_world && a.rows.velocity == b.rows.velocity;
}

// M x + offset, with the same M for all lanes.
void transform(const Eigen::Matrix3d& M, const V (&x)[3], const Eigen::Vector3d& offset, V (&result)[3]) {
  SWIFTLET_UNROLL
  for (std::size_t k = 0; k < 3; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    result[k] = M(i, 0) * x[0] + M(i, 1) * x[1] + M(i, 2) * x[2] + offset[i];
  }
}

// A position as a LandmarkPoint: with a reference one metre behind it, its inverse depth is always 1.
LandmarkPoint pointAt(const Eigen::Vector3d& p) {
  LandmarkPoint point;
  point.triangulated = true;
  point.bearing = Eigen::Vector3d::UnitZ();
  point.reference = p - point.bearing;
  point.inverse_depth = 1;
  return point;
}

}  // namespace

LandmarkBlock::LandmarkBlock(std::size_t max_sightings) {
  const std::size_t groups = (max_sightings + kLanes - 1) / kLanes;
  groups_.reserve(groups);
  states_.reserve(max_sightings);
  cross_groups_.reserve(groups);
  cross_.reserve(max_sightings);
}

void LandmarkBlock::linearize(const LandmarkViews& views, const LandmarkPoint& point) {
  linearizeAll(views, {point, PointBasis::of(point.bearing), false});
}

void LandmarkBlock::linearize(const LandmarkViews& views, const Eigen::Vector3d& position) {
  linearizeAll(views, {pointAt(position), {}, true});
}

void LandmarkBlock::linearizeAll(const LandmarkViews& views, const At& at) {
  layout_ = views.calibration;
  sightings_ = views.sightings;
  sums_ = {};
  valid_states_ = 0;
  groups_.clear();
  cross_groups_.clear();
  const bool calibrated = layout_.dimension() > 0;
  if (calibrated) calibration_sums_.fill(CalibrationSums{});
  Camera cameras[kMaxCameras];
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    cameras[c] = {views.T_body_cam[c].R(), views.T_body_cam[c].translation};
  }
  for (std::size_t first = 0; first < sightings_.size(); first += kLanes) {
    const std::size_t group = groups_.size();
    groups_.emplace_back();
    const auto four = sightings_.subspan(first, std::min(kLanes, sightings_.size() - first));
    if (calibrated) {
      cross_groups_.emplace_back();
      for (std::size_t l = 0; l < kLanes; ++l) {
        const RigPose& rig = views.poses[four[std::min(l, four.size() - 1)].slot];
        for (std::size_t k = 0; k < 3; ++k) {
          rates_[k][l] = rig.omega_body[static_cast<Eigen::Index>(k)];
          rates_[3 + k][l] = rig.v_world[static_cast<Eigen::Index>(k)];
        }
      }
    }
    for (std::size_t c = 0; c < kMaxCameras; ++c) addViews(c, cameras[c], four, views.poses, at, group);
    valid_states_ += lanes::count(groups_[group].valid);
  }
}

// Views of four states by one camera. With a global shutter one reprojection serves for residuals and
// Jacobians.
void LandmarkBlock::addViews(std::size_t c, const Camera& camera, std::span<const Sighting> four,
                             RigPoses poses, const At& at, std::size_t group) {
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
    rows_[l] = static_cast<double>(view.row);
  }
  if (current.empty()) return;
  const lanes::ViewGroup now_views(current);
  const lanes::Residuals now(now_views, at.point);
  if (moved) {
    const lanes::ViewGroup views(linearization);
    addRows(c, camera, views, now, lanes::Residuals(views, at.point), at, group);
  } else {
    addRows(c, camera, now_views, now, now, at, group);
  }
}

void LandmarkBlock::addRows(std::size_t c, const Camera& camera, const lanes::ViewGroup& views,
                            const lanes::Residuals& now, const lanes::Residuals& linearization, const At& at,
                            std::size_t group_index) {
  PoseGroup& group = groups_[group_index];
  const lanes::Mask counts = views.used & now.in_front & linearization.in_front;
  group.valid |= counts;
  Row row;
  sums_.weigh(now, counts, row.weight);
  const lanes::Jacobians J(views, linearization, at.basis);
  const double inverse_depth = at.point.inverse_depth;
  V ray[3];  // body axes
  transform(camera.R_body_cam, linearization.h, inverse_depth * camera.center, ray);
  SWIFTLET_UNROLL
  for (std::size_t r = 0; r < 2; ++r) {
    V K[3];  // d r / d (ray in body axes)
    transform(camera.R_body_cam, J.G[r], Eigen::Vector3d::Zero(), K);
    row.pose[0] = K[1] * ray[2] - K[2] * ray[1];
    row.pose[1] = K[2] * ray[0] - K[0] * ray[2];
    row.pose[2] = K[0] * ray[1] - K[1] * ray[0];
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      row.pose[3 + k] = -inverse_depth * J.M[r][k];
      row.point[k] = at.position ? -row.pose[3 + k] : J.point[r][k];
    }
    row.residual = now.r[r];
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < kPoseDim; ++i) {
      const V weighted = row.weight * row.pose[i];
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < kPoseDim; ++j) group.information[entry++] += weighted * row.pose[j];
      SWIFTLET_UNROLL
      for (std::size_t j = 0; j < 3; ++j) group.point[i][j] += weighted * row.point[j];
      group.gradient[i] += weighted * row.residual;
    }
    sums_.add(row.weight, row.point, row.residual);
    if (layout_.dimension() > 0) {
      addCalibration(c, camera, linearization, inverse_depth, J.G[r], row, group_index);
    }
  }
}

// Columns: d r / d time offset, from the motion of the body; d r / d readout, the same times the row's
// position relative to the middle; d r / d T_body_cam, rotation on the right.
void LandmarkBlock::addCalibration(std::size_t c, const Camera& camera, const lanes::Residuals& at,
                                   double inverse_depth, const V (&G)[3], const Row& row, std::size_t group) {
  V K[3];
  transform(camera.R_body_cam, G, Eigen::Vector3d::Zero(), K);
  V columns[kViewCalibrationDim]{};
  for (std::size_t k = 0; k < kPoseDim; ++k) columns[0] += row.pose[k] * rates_[k];
  columns[1] = rows_ * columns[0];
  columns[2] = G[1] * at.h[2] - G[2] * at.h[1];
  columns[3] = G[2] * at.h[0] - G[0] * at.h[2];
  columns[4] = G[0] * at.h[1] - G[1] * at.h[0];
  for (std::size_t k = 0; k < 3; ++k) columns[5 + k] = -inverse_depth * K[k];
  CalibrationSums& sums = calibration_sums_[c];
  CrossGroup& cross = cross_groups_[group][c];
  for (std::size_t i = 0; i < kViewCalibrationDim; ++i) {
    const V weighted = row.weight * columns[i];
    for (std::size_t j = i; j < kViewCalibrationDim; ++j) sums.information[i][j] += weighted * columns[j];
    for (std::size_t j = 0; j < 3; ++j) sums.point[i][j] += weighted * row.point[j];
    sums.gradient[i] += weighted * row.residual;
    for (std::size_t j = 0; j < kPoseDim; ++j) cross[j][i] += weighted * row.pose[j];
  }
}

bool LandmarkBlock::eliminate() {
  states_.clear();
  if (valid_states_ < 2) return false;
  // A local copy, so that the compiler knows that stores to the groups do not change it.
  PointFactor L;
  if (!L.compute(sums_.H())) return false;
  const Eigen::Vector3d c = sums_.g();
  double z[3] = {c[0], c[1], c[2]};
  L.solve(z);
  L_ = L;
  z_ << z[0], z[1], z[2];
  for (PoseGroup& group : groups_) {
    // Y_i = B_i L^-T, solved separately for each row.
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < kPoseDim; ++i) {
      V(&y)[3] = group.point[i];
      L.solve(y);
      group.gradient[i] -= y[0] * z[0] + y[1] * z[1] + y[2] * z[2];
    }
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < kPoseDim; ++i) {
      const V* const yi = group.point[i];
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < kPoseDim; ++j) {
        const V* const yj = group.point[j];
        group.information[entry++] -= yi[0] * yj[0] + yi[1] * yj[1] + yi[2] * yj[2];
      }
    }
  }
  writeStates();
  if (layout_.dimension() > 0) eliminateCalibration();
  return true;
}

void LandmarkBlock::keepPoint() {
  writeStates();
  if (layout_.dimension() > 0) gatherCalibration();
}

// Writes the lanes of states that have the point in front of a camera.
void LandmarkBlock::writeStates() {
  states_.clear();
  for (std::size_t s = 0; s < sightings_.size(); ++s) {
    const PoseGroup& group = groups_[s / kLanes];
    const std::size_t lane = s % kLanes;
    if (group.valid[lane] == 0) continue;
    State& state = states_.emplace_back();
    state.slot = sightings_[s].slot;
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < kPoseDim; ++i) {
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < kPoseDim; ++j) {
        state.information.column[i][j] = group.information[entry++][lane];
      }
      state.gradient[i] = group.gradient[i][lane];
    }
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      SWIFTLET_UNROLL
      for (std::size_t i = 0; i < kPoseDim; ++i) state.point[k][i] = group.point[i][k][lane];
    }
  }
}

// From the columns of each camera to those of the layout.
void LandmarkBlock::gatherCalibration() {
  calibration_ = {};
  cross_.assign(states_.size(), PoseCalibration::Zero());
  for (std::size_t c = 0; c < layout_.cameras; ++c) {
    const CalibrationSums& sums = calibration_sums_[c];
    const std::array<int, kViewCalibrationDim> columns = layout_.columnsOf(c);
    for (std::size_t i = 0; i < kViewCalibrationDim; ++i) {
      const int column = columns[i];
      if (column < 0) continue;
      for (std::size_t j = i; j < kViewCalibrationDim; ++j) {
        if (columns[j] < 0) continue;
        const double value = lanes::sum(sums.information[i][j]);
        calibration_.information(columns[j], column) += value;
        if (j != i) calibration_.information(column, columns[j]) += value;
      }
      for (std::size_t j = 0; j < 3; ++j) {
        calibration_.point(column, static_cast<Eigen::Index>(j)) += lanes::sum(sums.point[i][j]);
      }
      calibration_.gradient[column] += lanes::sum(sums.gradient[i]);
      std::size_t k = 0;
      for (std::size_t s = 0; s < sightings_.size(); ++s) {
        const std::size_t lane = s % kLanes;
        if (groups_[s / kLanes].valid[lane] == 0) continue;
        const CrossGroup& cross = cross_groups_[s / kLanes][c];
        for (std::size_t row = 0; row < kPoseDim; ++row) {
          cross_[k](static_cast<Eigen::Index>(row), column) += cross[row][i][lane];
        }
        ++k;
      }
    }
  }
}

void LandmarkBlock::eliminateCalibration() {
  gatherCalibration();
  for (Eigen::Index row = 0; row < layout_.dimension(); ++row) {
    double y[3] = {calibration_.point(row, 0), calibration_.point(row, 1), calibration_.point(row, 2)};
    L_.solve(y);
    calibration_.point.row(row) << y[0], y[1], y[2];
  }
  calibration_.information -= calibration_.point * calibration_.point.transpose();
  calibration_.gradient -= calibration_.point * z_;
  for (std::size_t k = 0; k < states_.size(); ++k) {
    using Y = Eigen::Matrix<double, kPaddedRows, 3>;
    cross_[k].noalias() -=
        Eigen::Map<const Y>(states_[k].point[0]).topRows<kPoseDim>() * calibration_.point.transpose();
  }
}

}  // namespace swiftlet
