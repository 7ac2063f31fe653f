#include "estimator/smoother/extra_table.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Largest relative depth sigma of a promoted landmark. The observations of a Euclidean point are linear only
// if its depth is accurate: the second-order error is the square of this.
constexpr double kMaxRelativeDepthSigma = 0.1;
// A plane is used once its normal is known to this. With two points, or three nearly on a line, its normal
// would be arbitrary and enter the prior.
constexpr double kMaxNormalSigma = 0.05;  // rad
constexpr int kFitIterations = 5;

constexpr Status kNoPlane{StatusCode::kInvalidInput, "no such plane"};
constexpr Status kNoSigma{StatusCode::kInvalidInput, "a sigma is positive"};
constexpr Status kNoFactor{StatusCode::kCapacityReached, "no factor is free"};

}  // namespace

void ExtraTable::clear() {
  for (ExtraState& extra : extras_) extra = ExtraState{};
  factors_.clear();
}

ExtraState* ExtraTable::findFree(std::size_t first, std::size_t last) {
  for (std::size_t e = first; e < last; ++e) {
    if (extras_[e].kind == ExtraKind::kNone) return &extras_[e];
  }
  return nullptr;
}

const ExtraState* ExtraTable::findPlane(PlaneId id) const {
  for (const ExtraState& extra : extras_) {
    if (extra.isPlane() && extra.id == id) return &extra;
  }
  return nullptr;
}

Status ExtraTable::promote(TrackId id) {
  Landmark* const landmark = landmarks_.find(id);
  if (landmark == nullptr) return {StatusCode::kInvalidInput, "no such landmark in the window"};
  if (landmark->extra != kNoExtra) return okStatus();
  const LandmarkPoint& point = landmark->point;
  if (!point.triangulated || !landmark->in_system) {
    return {StatusCode::kNotReady, "the landmark took no part in the last solve"};
  }
  if (!(point.inverse_depth_sigma < kMaxRelativeDepthSigma * point.inverse_depth)) {
    return {StatusCode::kDegenerate, "the landmark's depth is not known well enough"};
  }
  ExtraState* const extra = findFree(0, kMaxExplicitLandmarks);
  if (extra == nullptr) return {StatusCode::kCapacityReached, "no column is free for another landmark"};
  *extra = ExtraState{};
  extra->kind = ExtraKind::kLandmark;
  extra->landmark = static_cast<std::uint32_t>(landmarks_.indexOf(*landmark));
  extra->x.point = point.position();
  landmark->extra = indexOf(*extra);
  return okStatus();
}

bool ExtraTable::promoted(TrackId id) const {
  const Landmark* const landmark = landmarks_.find(id);
  return landmark != nullptr && landmark->extra != kNoExtra;
}

std::optional<PlaneId> ExtraTable::addPlane(const Plane& plane) {
  ExtraState* const extra = findFree(kMaxExplicitLandmarks, kMaxExtraStates);
  if (extra == nullptr) return std::nullopt;
  *extra = ExtraState{};
  extra->kind = ExtraKind::kPlane;
  extra->id = next_plane_++;
  extra->x.plane = plane;
  return extra->id;
}

Status ExtraTable::addPointOnPlane(TrackId id, PlaneId plane, double sigma) {
  const ExtraState* const extra = findPlane(plane);
  const Landmark* const landmark = landmarks_.find(id);
  if (extra == nullptr) return kNoPlane;
  if (landmark == nullptr || landmark->extra == kNoExtra) {
    return {StatusCode::kInvalidInput, "no such promoted landmark"};
  }
  if (!(sigma > 0)) return kNoSigma;
  const ExtraFactor factor{ExtraFactorKind::kPointOnPlane, indexOf(*extra), landmark->extra, sigma};
  const bool tied = std::ranges::any_of(factors_, [&factor](const ExtraFactor& f) {
    return f.plane == factor.plane && f.landmark == factor.landmark;
  });
  if (tied) return {StatusCode::kInvalidInput, "the landmark is tied to this plane already"};
  return factors_.tryPushBack(factor) ? okStatus() : kNoFactor;
}

Status ExtraTable::addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma) {
  const ExtraState* const extra = findPlane(plane);
  if (extra == nullptr) return kNoPlane;
  if (!(sigma > 0)) return kNoSigma;
  const ExtraFactorKind kind = direction == PlaneDirection::kHorizontal ? ExtraFactorKind::kHorizontalPlane
                                                                        : ExtraFactorKind::kVerticalPlane;
  const ExtraFactor factor{kind, indexOf(*extra), kNoExtra, sigma};
  for (ExtraFactor& f : factors_) {
    if (f.plane != factor.plane || f.tiesPoint()) continue;
    f = factor;
    return okStatus();
  }
  return factors_.tryPushBack(factor) ? okStatus() : kNoFactor;
}

void ExtraTable::removePointOnPlane(TrackId id, PlaneId plane) {
  const ExtraState* const extra = findPlane(plane);
  const Landmark* const landmark = landmarks_.find(id);
  if (extra == nullptr || landmark == nullptr || landmark->extra == kNoExtra) return;
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const ExtraFactor& factor = factors_[f];
    if (!factor.tiesPoint() || factor.plane != indexOf(*extra) || factor.landmark != landmark->extra) {
      continue;
    }
    factors_.erase(f);
    return;
  }
}

bool ExtraTable::removePlane(PlaneId plane) {
  ExtraState* const extra = findPlaneToChange(plane);
  if (extra == nullptr) return false;
  dropFactorsOf(indexOf(*extra));
  if (extra->in_prior) {
    extra->leaving = true;
    return true;
  }
  vacate(*extra);
  return false;
}

int ExtraTable::pointsOn(const ExtraState& plane) const {
  const std::uint8_t index = indexOf(plane);
  return static_cast<int>(std::ranges::count_if(
      factors_, [index](const ExtraFactor& f) { return f.tiesPoint() && f.plane == index; }));
}

std::size_t ExtraTable::count(ExtraKind kind) const {
  return static_cast<std::size_t>(std::ranges::count(extras_, kind, &ExtraState::kind));
}

int ExtraTable::assignOffsets(int first) {
  columns_ = 0;
  for (ExtraState& extra : extras_) {
    if (extra.kind == ExtraKind::kNone) continue;
    extra.offset = first + columns_;
    columns_ += kExtraDim;
  }
  return first + columns_;
}

void ExtraTable::linearize(const ExtraFactor& factor, LinearFactor& linear) const {
  const ExtraState& plane = extras_[factor.plane];
  swiftlet::linearize(factor, plane, factor.tiesPoint() ? extras_[factor.landmark] : plane, linear);
}

// The system of one plane with its points held fixed. The whitened rows also account for the uncertainty of
// the points' depths. Returns the largest sigma of the normal [rad].
double ExtraTable::linearizePlane(const ExtraState& plane, Eigen::Matrix3d& H, Eigen::Vector3d& g) const {
  H = kWeakInformation * Eigen::Matrix3d::Identity();
  g.setZero();
  const std::uint8_t index = indexOf(plane);
  LinearFactor linear;
  for (const ExtraFactor& factor : factors_) {
    if (factor.plane != index) continue;
    ExtraFactor widened = factor;
    if (factor.tiesPoint()) {
      const LandmarkPoint& point = landmarks_[extras_[factor.landmark].landmark].point;
      const double depth_sigma = point.inverse_depth_sigma / (point.inverse_depth * point.inverse_depth);
      widened.sigma = std::hypot(factor.sigma, depth_sigma * plane.x.plane.normal().dot(point.bearing));
    }
    linearize(widened, linear);
    Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
    for (int c = 0; c < linear.columns; ++c) {
      const int column = linear.column[static_cast<std::size_t>(c)] - plane.offset;
      if (column >= 0 && column < kExtraDim) J.col(column) = linear.jacobian.col(c);
    }
    H.noalias() += J.transpose() * J;
    g.noalias() += J.transpose() * linear.residual;
  }
  const Eigen::Matrix3d covariance = H.inverse();
  const double mean = 0.5 * (covariance(0, 0) + covariance(1, 1));
  const double half = 0.5 * (covariance(0, 0) - covariance(1, 1));
  return std::sqrt(mean + std::hypot(half, covariance(0, 1)));
}

// Fits new planes to their points. A plane from the mesh has errors of degrees and centimetres, many sigmas
// of a point on a plane, so the robust weight would treat its points as outliers.
void ExtraTable::settlePlanes() {
  Eigen::Matrix3d H;
  Eigen::Vector3d g;
  for (ExtraState& extra : extras_) {
    if (!extra.isPlane() || extra.settled) continue;
    if (linearizePlane(extra, H, g) > kMaxNormalSigma) continue;
    const Plane start = extra.x.plane;
    for (int k = 0; k < kFitIterations; ++k) {
      extra.x.plane.retract(-H.llt().solve(g));
      extra.settled = linearizePlane(extra, H, g) <= kMaxNormalSigma;
      if (!extra.settled) break;
    }
    if (!extra.settled) extra.x.plane = start;
  }
}

// Updates the landmark's point, from which residuals and the window are computed.
void ExtraTable::follow(const ExtraState& extra) {
  LandmarkPoint& point = landmarks_[extra.landmark].point;
  const Eigen::Vector3d ray = extra.x.point - point.reference;
  const double distance = ray.norm();
  if (!(distance > 0)) return;
  point.bearing = ray / distance;
  point.inverse_depth = 1.0 / distance;
}

void ExtraTable::retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
  for (ExtraState& extra : extras_) {
    if (extra.kind == ExtraKind::kNone) continue;
    extra.retract(step.segment<kExtraDim>(extra.offset));
    if (extra.isLandmark()) follow(extra);
  }
}

void ExtraTable::backup() {
  for (ExtraState& extra : extras_) extra.backup = extra.x;
}

void ExtraTable::restore() {
  for (ExtraState& extra : extras_) {
    extra.x = extra.backup;
    if (extra.isLandmark()) follow(extra);
  }
}

void ExtraTable::discard(Landmark& landmark) {
  if (landmark.extra == kNoExtra) {
    landmarks_.remove(landmark);
    return;
  }
  landmark.sightings.clear();
  dropFactorsOf(landmark.extra);
  extras_[landmark.extra].leaving = true;
}

void ExtraTable::dropFactorsOf(std::uint8_t extra) {
  for (std::size_t f = factors_.size(); f-- > 0;) {
    if (factors_[f].touches(extra)) factors_.erase(f);
  }
}

void ExtraTable::vacate(ExtraState& extra) {
  dropFactorsOf(indexOf(extra));
  if (extra.isLandmark()) {
    Landmark& landmark = landmarks_[extra.landmark];
    landmark.extra = kNoExtra;
    landmarks_.remove(landmark);
  }
  extra = ExtraState{};
}

void ExtraTable::markDepartures(std::uint8_t slot, std::uint64_t oldest_recent) {
  for (ExtraState& extra : extras_) {
    if (!extra.isLandmark()) continue;
    const Landmark& landmark = landmarks_[extra.landmark];
    if (landmark.last_frame < oldest_recent && landmark.seenFrom(slot)) extra.leaving = true;
  }
  markBarePlanes();
}

// Marks planes without tied landmarks.
void ExtraTable::markBarePlanes() {
  for (ExtraState& extra : extras_) {
    if (!extra.isPlane()) continue;
    const std::uint8_t index = indexOf(extra);
    extra.leaving = std::ranges::none_of(factors_, [this, index](const ExtraFactor& factor) {
      return factor.tiesPoint() && factor.plane == index && !extras_[factor.landmark].leaving;
    });
  }
}

bool ExtraTable::departs(const ExtraFactor& factor) const {
  return extras_[factor.plane].leaving || (factor.tiesPoint() && extras_[factor.landmark].leaving);
}

bool ExtraTable::release() {
  for (ExtraState& extra : extras_) {
    if (!extra.isLandmark()) continue;
    extra.leaving = landmarks_[extra.landmark].sightings.empty();
    if (extra.leaving && !extra.in_prior) vacate(extra);
  }
  markBarePlanes();
  bool any = false;
  for (ExtraState& extra : extras_) {
    if (extra.leaving && !extra.in_prior) vacate(extra);
    any = any || extra.leaving;
  }
  return any;
}

}  // namespace swiftlet
