// Explicit landmarks and planes: how they enter, take part in a solve, and leave.

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/smoother/smoother.hpp"

namespace swiftlet {
namespace {

// A Euclidean point is linear in its sightings while its depth is known well: the error of second order is
// the square of this.
constexpr double kMaxRelativeDepthSigma = 0.1;
// Keeps columns that nothing determines (a plane without points, a landmark that one camera sees once) from
// being singular; only in the solve, not in what goes into the prior. A kilometre and a thousand radian: ten
// orders below a sighting.
constexpr double kWeakInformation = 1e-6;  // 1/m^2, 1/rad^2

// A plane takes part once its normal is known to this: with two points, or three nearly on a line, it would
// turn as it likes and be frozen there.
constexpr double kMaxNormalSigma = 0.05;  // rad
constexpr int kFitIterations = 5;

bool sees(const Landmark& landmark, std::uint8_t slot) {
  return std::any_of(landmark.sightings.begin(), landmark.sightings.end(),
                     [slot](const Sighting& s) { return s.slot == slot; });
}

}  // namespace

ExtraState* Smoother::findExtra(ExtraKind kind, std::size_t first, std::size_t last) {
  for (std::size_t e = first; e < last; ++e) {
    if (extras_[e].kind == kind) return &extras_[e];
  }
  return nullptr;
}

ExtraState* Smoother::findPlane(PlaneId id) {
  for (ExtraState& extra : extras_) {
    if (extra.isPlane() && extra.id == id) return &extra;
  }
  return nullptr;
}

std::uint8_t Smoother::indexOf(const ExtraState& extra) const {
  return static_cast<std::uint8_t>(&extra - extras_.data());
}

Status Smoother::promote(TrackId id) {
  Landmark* landmark = findLandmark(id + 1);
  if (landmark == nullptr) return {StatusCode::kInvalidInput, "no such landmark in the window"};
  if (landmark->extra != kNoExtra) return okStatus();
  const auto index = static_cast<std::uint32_t>(landmark - landmarks_.data());
  const LandmarkPoint& point = landmark->point;
  if (!point.triangulated || in_system_[index] == 0) {
    return {StatusCode::kNotReady, "the landmark took no part in the last solve"};
  }
  if (!(point.inverse_depth_sigma < kMaxRelativeDepthSigma * point.inverse_depth)) {
    return {StatusCode::kDegenerate, "the landmark's depth is not known well enough"};
  }
  ExtraState* extra = findExtra(ExtraKind::kNone, 0, kMaxExplicitLandmarks);
  if (extra == nullptr) return {StatusCode::kCapacityReached, "no column is free for another landmark"};
  *extra = ExtraState{};
  extra->kind = ExtraKind::kLandmark;
  extra->landmark = index;
  extra->x.point = point.position();
  landmark->extra = indexOf(*extra);
  return okStatus();
}

bool Smoother::promoted(TrackId id) const {
  const auto found = std::find(landmark_ids_.begin(), landmark_ids_.end(), id + 1);
  return found != landmark_ids_.end() &&
         landmarks_[static_cast<std::size_t>(found - landmark_ids_.begin())].extra != kNoExtra;
}

std::optional<PlaneId> Smoother::addPlane(const Plane& plane) {
  ExtraState* extra = findExtra(ExtraKind::kNone, kMaxExplicitLandmarks, kMaxExtraStates);
  if (extra == nullptr) return std::nullopt;
  *extra = ExtraState{};
  extra->kind = ExtraKind::kPlane;
  extra->id = next_plane_++;
  extra->x.plane = plane;
  return extra->id;
}

Status Smoother::addPointOnPlane(TrackId id, PlaneId plane, double sigma) {
  const ExtraState* extra = findPlane(plane);
  const Landmark* landmark = findLandmark(id + 1);
  if (extra == nullptr) return {StatusCode::kInvalidInput, "no such plane"};
  if (landmark == nullptr || landmark->extra == kNoExtra) {
    return {StatusCode::kInvalidInput, "no such promoted landmark"};
  }
  if (!(sigma > 0)) return {StatusCode::kInvalidInput, "a sigma is positive"};
  const ExtraFactor factor{ExtraFactorKind::kPointOnPlane, indexOf(*extra), landmark->extra, sigma};
  const bool tied = std::any_of(
      extra_factors_.begin(), extra_factors_.end(),
      [&factor](const ExtraFactor& f) { return f.plane == factor.plane && f.landmark == factor.landmark; });
  if (tied) return {StatusCode::kInvalidInput, "the landmark is tied to this plane already"};
  if (!extra_factors_.tryPushBack(factor)) return {StatusCode::kCapacityReached, "no factor is free"};
  return okStatus();
}

Status Smoother::addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma) {
  const ExtraState* extra = findPlane(plane);
  if (extra == nullptr) return {StatusCode::kInvalidInput, "no such plane"};
  if (!(sigma > 0)) return {StatusCode::kInvalidInput, "a sigma is positive"};
  const ExtraFactorKind kind = direction == PlaneDirection::kHorizontal ? ExtraFactorKind::kHorizontalPlane
                                                                        : ExtraFactorKind::kVerticalPlane;
  const ExtraFactor factor{kind, indexOf(*extra), kNoExtra, sigma};
  for (ExtraFactor& f : extra_factors_) {
    if (f.plane != factor.plane || f.tiesPoint()) continue;
    f = factor;
    return okStatus();
  }
  if (!extra_factors_.tryPushBack(factor)) return {StatusCode::kCapacityReached, "no factor is free"};
  return okStatus();
}

void Smoother::removePointOnPlane(TrackId id, PlaneId plane) {
  const ExtraState* extra = findPlane(plane);
  const Landmark* landmark = findLandmark(id + 1);
  if (extra == nullptr || landmark == nullptr || landmark->extra == kNoExtra) return;
  for (std::size_t f = 0; f < extra_factors_.size(); ++f) {
    const ExtraFactor& factor = extra_factors_[f];
    if (!factor.tiesPoint() || factor.plane != indexOf(*extra) || factor.landmark != landmark->extra)
      continue;
    extra_factors_.erase(f);
    return;
  }
}

void Smoother::removePlane(PlaneId plane) {
  ExtraState* extra = findPlane(plane);
  if (extra == nullptr) return;
  dropFactorsOf(indexOf(*extra));
  if (!extra->frozen) {
    freeExtra(*extra);
    return;
  }
  extra->leaving = true;
  marginalize(Departure{});
}

std::optional<PlaneEstimate> Smoother::plane(PlaneId plane) {
  const ExtraState* extra = findPlane(plane);
  if (extra == nullptr) return std::nullopt;
  PlaneEstimate estimate;
  estimate.plane = extra->x.plane;
  const std::uint8_t index = indexOf(*extra);
  for (const ExtraFactor& f : extra_factors_) estimate.points += f.tiesPoint() && f.plane == index ? 1 : 0;
  if (extra->factor_offset >= 0) {
    solveFactorColumns(extra->factor_offset, kExtraDim, columns_i_);
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, kExtraDim>> Y(columns_i_.data(),
                                                                               factor_dimension_, kExtraDim);
    estimate.covariance.noalias() = Y.transpose() * Y;
  }
  return estimate;
}

std::size_t Smoother::explicitLandmarks() const {
  return static_cast<std::size_t>(
      std::count_if(extras_.begin(), extras_.end(), [](const ExtraState& e) { return e.isLandmark(); }));
}

std::size_t Smoother::planes() const {
  return static_cast<std::size_t>(
      std::count_if(extras_.begin(), extras_.end(), [](const ExtraState& e) { return e.isPlane(); }));
}

// The landmark's point follows its state: residuals and the window are read from there.
void Smoother::syncLandmark(const ExtraState& extra) {
  LandmarkPoint& point = landmarks_[extra.landmark].point;
  const Eigen::Vector3d ray = extra.x.point - point.reference;
  const double distance = ray.norm();
  if (!(distance > 0)) return;
  point.bearing = ray / distance;
  point.inverse_depth = 1.0 / distance;
}

void Smoother::linearizeFactor(const ExtraFactor& factor, LinearFactor& linear) const {
  const ExtraState& plane = extras_[factor.plane];
  linearize(factor, plane, factor.tiesPoint() ? extras_[factor.landmark] : plane, linear);
}

// Of one state, or with kNoSlot of all.
void Smoother::addSightingsOf(const ExtraState& extra, std::uint8_t slot) {
  std::span<const Sighting> sightings = landmarks_[extra.landmark].views();
  if (slot != kNoSlot) {
    const auto at = std::ranges::find(sightings, slot, &Sighting::slot);
    sightings = {at, at == sightings.end() ? at : at + 1};
  }
  system_.addExplicitLandmark(viewsOf(sightings), extra.x.point, extra.linearization().point, extra.offset,
                              states_);
}

// The system of one plane with its points held, by whitened rows that allow for the points' own depths too;
// the largest sigma of its normal, rad.
double Smoother::linearizePlane(const ExtraState& plane, Eigen::Matrix3d& H, Eigen::Vector3d& g) const {
  H = kWeakInformation * Eigen::Matrix3d::Identity();
  g.setZero();
  const std::uint8_t index = indexOf(plane);
  LinearFactor linear;
  for (const ExtraFactor& factor : extra_factors_) {
    if (factor.plane != index) continue;
    ExtraFactor widened = factor;
    if (factor.tiesPoint()) {
      const LandmarkPoint& point = landmarks_[extras_[factor.landmark].landmark].point;
      const double depth_sigma = point.inverse_depth_sigma / (point.inverse_depth * point.inverse_depth);
      widened.sigma = std::hypot(factor.sigma, depth_sigma * plane.x.plane.normal().dot(point.bearing));
    }
    linearizeFactor(widened, linear);
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

// New planes are fitted to their points before they count: what a mesh gives is some degrees and centimetres
// off, many sigmas of a point on a plane, and the robust weight would take them for outliers.
void Smoother::settlePlanes() {
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

void Smoother::addExtras() {
  for (const ExtraState& extra : extras_) {
    if (extra.isLandmark()) addSightingsOf(extra, kNoSlot);
  }
  LinearFactor linear;
  for (const ExtraFactor& factor : extra_factors_) {
    if (!counts(factor)) continue;
    linearizeFactor(factor, linear);
    system_.addFactor(linear);
  }
}

// After all factors. The sigma of a landmark's inverse depth is that along its first ray with everything else
// held, as triangulation gives it.
void Smoother::finishExtras() {
  MatrixMap H = system_.H();
  for (const ExtraState& extra : extras_) {
    if (extra.kind == ExtraKind::kNone) continue;
    for (int k = 0; k < kExtraDim; ++k) H(extra.offset + k, extra.offset + k) += kWeakInformation;
    if (!extra.isLandmark()) continue;
    LandmarkPoint& point = landmarks_[extra.landmark].point;
    const Eigen::Matrix3d lower = H.block<kExtraDim, kExtraDim>(extra.offset, extra.offset);
    const Eigen::Matrix3d information = lower.selfadjointView<Eigen::Lower>();
    const double variance = point.bearing.dot(information.llt().solve(point.bearing));
    point.inverse_depth_sigma =
        point.inverse_depth * point.inverse_depth * std::sqrt(std::max(variance, 0.0));
  }
}

void Smoother::retractExtras(const Eigen::Ref<const Eigen::VectorXd>& step) {
  for (ExtraState& extra : extras_) {
    if (extra.kind == ExtraKind::kNone) continue;
    extra.retract(step.segment<kExtraDim>(extra.offset));
    if (extra.isLandmark()) syncLandmark(extra);
  }
}

void Smoother::restoreExtras() {
  for (ExtraState& extra : extras_) {
    extra.x = extra.backup;
    if (extra.isLandmark()) syncLandmark(extra);
  }
}

// It fits nowhere: what is in the prior cannot be taken back, the rest goes at once.
void Smoother::discardLandmark(Landmark& landmark) {
  if (landmark.extra == kNoExtra) {
    removeLandmark(landmark);
    return;
  }
  landmark.sightings.clear();
  dropFactorsOf(landmark.extra);
  extras_[landmark.extra].leaving = true;
}

void Smoother::dropFactorsOf(std::uint8_t extra) {
  for (std::size_t f = extra_factors_.size(); f-- > 0;) {
    if (extra_factors_[f].touches(extra)) extra_factors_.erase(f);
  }
}

void Smoother::freeExtra(ExtraState& extra) {
  dropFactorsOf(indexOf(extra));
  if (extra.isLandmark()) {
    Landmark& landmark = landmarks_[extra.landmark];
    landmark.extra = kNoExtra;
    in_system_[extra.landmark] = 0;
    removeLandmark(landmark);
  }
  extra = ExtraState{};
}

// Explicit landmarks leave as structureless ones do: with a keyframe, once no recent frame sees them.
void Smoother::markDepartures(std::uint8_t slot) {
  for (ExtraState& extra : extras_) {
    if (!extra.isLandmark()) continue;
    const Landmark& landmark = landmarks_[extra.landmark];
    if (landmark.last_frame < oldest_recent_frame_ && sees(landmark, slot)) extra.leaving = true;
  }
  markBarePlanes();
}

// Planes to which no landmark stays tied.
void Smoother::markBarePlanes() {
  for (ExtraState& extra : extras_) {
    if (!extra.isPlane()) continue;
    const std::uint8_t index = indexOf(extra);
    extra.leaving =
        std::none_of(extra_factors_.begin(), extra_factors_.end(), [this, index](const ExtraFactor& factor) {
          return factor.tiesPoint() && factor.plane == index && !extras_[factor.landmark].leaving;
        });
  }
}

bool Smoother::departs(const ExtraFactor& factor) const {
  return extras_[factor.plane].leaving || (factor.tiesPoint() && extras_[factor.landmark].leaving);
}

// `slot`: of the keyframe that leaves, or kNoSlot.
void Smoother::involveExtras(std::uint8_t slot) {
  for (std::size_t e = 0; e < extras_.size(); ++e) {
    const ExtraState& extra = extras_[e];
    if (extra.leaving) involved_[kMaxStates + e] = 1;
    if (!extra.isLandmark()) continue;
    const Landmark& landmark = landmarks_[extra.landmark];
    if (extra.leaving) {
      for (const Sighting& s : landmark.sightings) involved_[s.slot] = 1;
    } else if (slot != kNoSlot && sees(landmark, slot)) {
      involved_[kMaxStates + e] = 1;
    }
  }
  for (const ExtraFactor& factor : extra_factors_) {
    if (!departs(factor) || !counts(factor)) continue;
    involved_[kMaxStates + factor.plane] = 1;
    if (factor.tiesPoint()) involved_[kMaxStates + factor.landmark] = 1;
  }
}

// All that the leaving extra states take part in, and what the keyframe that leaves saw of the others.
void Smoother::addDepartingFactors(std::uint8_t slot) {
  for (const ExtraState& extra : extras_) {
    if (!extra.isLandmark()) continue;
    if (extra.leaving) {
      addSightingsOf(extra, kNoSlot);
    } else if (slot != kNoSlot) {
      addSightingsOf(extra, slot);
    }
  }
  LinearFactor linear;
  for (const ExtraFactor& factor : extra_factors_) {
    if (!departs(factor) || !counts(factor)) continue;
    linearizeFactor(factor, linear);
    system_.addFactor(linear);
  }
}

// What is left without a sighting or a point. Without a part in the prior it goes at once.
void Smoother::releaseExtras() {
  for (ExtraState& extra : extras_) {
    if (!extra.isLandmark()) continue;
    extra.leaving = landmarks_[extra.landmark].sightings.empty();
    if (extra.leaving && !extra.frozen) freeExtra(extra);
  }
  markBarePlanes();
  bool any = false;
  for (ExtraState& extra : extras_) {
    if (extra.leaving && !extra.frozen) freeExtra(extra);
    any = any || extra.leaving;
  }
  if (any) marginalize(Departure{});
}

}  // namespace swiftlet
