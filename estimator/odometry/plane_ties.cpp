#include "estimator/odometry/plane_ties.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Standard deviation of a plane's direction: how much real walls lean and floors slope, and the remaining
// tilt error in a plane's fit.
constexpr double kDirectionSigma = 0.015;  // rad
// Three points define a plane, but with fewer than this a single wrong point turns it.
constexpr std::size_t kFewestPoints = 5;
// Solve time grows with the cube of the number of columns. More ties improve the states by less than the
// variation between flights.
constexpr std::size_t kMostTies = 48;
constexpr int kFewestSightings = 4;  // states of the window: more than the depth of one stereo pair
// A point close to a tied one adds little information.
constexpr double kApart = 0.25;           // m
constexpr double kMaxResidual = 0.05;     // m, independent of the sigmas: the mesher's gate
constexpr double kMaxNormalSigma = 0.05;  // m: a point with a larger sigma would fit any plane
constexpr double kChiSquared = 6.63;      // 99 % of one degree of freedom
// A plane is tested against only if its direction is more accurate than this (both directions together);
// compare kMaxNormalSigma in extra_table.cpp.
constexpr double kSettledSigma = 0.1;  // rad
// Ties are tested in every frame, so the threshold must be rarely exceeded by chance.
constexpr double kAfterSigmas = 3.5;
constexpr int kUnnamedReports = 3;   // reports: the mesh changes although the landmark does not
constexpr int kRefusedReports = 20;  // reports, about five seconds, after which the point is known better

// Limits the sigma of a plane at a point. A plane's covariance is relative to the world and includes the
// drift of the whole window, which its points share; relative to its points the plane is more accurate.
constexpr double kMaxPlaneSigma = 0.02;  // m

double variance(const WindowPlane& plane, const Eigen::Vector3d& p) {
  const Eigen::Vector4d q(p.x(), p.y(), p.z(), -1);
  return std::clamp(q.dot(plane.covariance * q), 0.0, kMaxPlaneSigma * kMaxPlaneSigma);
}

// The solve balances the tie against the observations. With `own` the variance along the normal from the
// observations and t^2 that of the tie, a point that the observations put at height h ends at h t^2 / (own +
// t^2). So h follows from the height after the solve and is tested against own + t^2.
bool disagrees(double height_after, double own_sigma, double tie_sigma) {
  const double own = own_sigma * own_sigma;
  const double tie = tie_sigma * tie_sigma;
  const double before = height_after * (own + tie) / tie;
  return before * before > kAfterSigmas * kAfterSigmas * (own + tie);
}

}  // namespace

void PlaneTies::take(const PlaneReport& report) {
  report_ = report;
  waiting_ = true;
}

void PlaneTies::reset() {
  waiting_ = false;
  any_applied_ = false;
  held_.clear();
  ties_.clear();
  refusals_.clear();
  estimates_.clear();
}

void PlaneTies::readWindow(const Smoother& smoother) {
  smoother.window(window_);
  by_id_.clear();
  for (std::size_t i = 0; i < window_.landmarks.size(); ++i) {
    by_id_.pushBack(static_cast<std::uint16_t>(i));
  }
  std::sort(by_id_.begin(), by_id_.end(), [this](std::uint16_t a, std::uint16_t b) {
    return window_.landmarks[a].id < window_.landmarks[b].id;
  });
}

const WindowLandmark* PlaneTies::landmark(TrackId id) const {
  const auto* found =
      std::lower_bound(by_id_.begin(), by_id_.end(), id,
                       [this](std::uint16_t a, TrackId wanted) { return window_.landmarks[a].id < wanted; });
  if (found == by_id_.end() || window_.landmarks[*found].id != id) return nullptr;
  return &window_.landmarks[*found];
}

std::uint64_t PlaneTies::planeOf(TrackId id) const {
  for (const Tie& tie : ties_) {
    if (tie.id == id) return tie.plane;
  }
  return 0;
}

PlaneTies::HeldPlane* PlaneTies::held(std::uint64_t report_id) {
  for (HeldPlane& plane : held_) {
    if (plane.report_id == report_id) return &plane;
  }
  return nullptr;
}

void PlaneTies::apply(Smoother& smoother, const TrackedFrame& coming, std::uint32_t epoch) {
  if (!waiting_) return;
  waiting_ = false;
  if (report_.epoch != epoch || !smoother.started() ||
      (any_applied_ && report_.frame_index <= applied_frame_)) {
    ++counters_.reports_ignored;
    return;
  }
  any_applied_ = true;
  applied_frame_ = report_.frame_index;
  ++counters_.reports;
  for (std::size_t r = refusals_.size(); r-- > 0;) {
    if (--refusals_[r].reports <= 0) refusals_.erase(r);
  }
  readWindow(smoother);
  releaseUnnamed(smoother);
  collectCandidates(coming);
  addPlanes(smoother);
  if (held_.empty()) return;
  // First points that are apart, with an equal share for each plane; then more, while there is room.
  const std::size_t share = std::max(kFewestPoints, kMostTies / held_.size());
  tieCandidates(smoother, share, kApart);
  tieCandidates(smoother, kMostTies, kApart);
  tieCandidates(smoother, kMostTies, 0);
}

// Unties points that the mesher no longer reports on the plane, but only after some reports.
void PlaneTies::releaseUnnamed(Smoother& smoother) {
  for (Tie& tie : ties_) ++tie.unnamed;
  for (const ReportedPoint& point : report_.points) {
    for (Tie& tie : ties_) {
      if (tie.id != point.id || !point.firm) continue;
      tie.unnamed = tie.plane == point.plane ? 0 : kUnnamedReports + 1;
    }
  }
  for (std::size_t t = ties_.size(); t-- > 0;) {
    if (ties_[t].unnamed > kUnnamedReports) untie(smoother, t);
  }
}

void PlaneTies::collectCandidates(const TrackedFrame& coming) {
  candidates_.clear();
  for (const ReportedPoint& point : report_.points) {
    if (!point.firm) break;  // firm points come first
    const auto same = [&point](const auto& other) { return other.id == point.id; };
    if (std::any_of(ties_.begin(), ties_.end(), same) || refused(point.id, point.plane)) continue;
    const auto plane = std::find_if(report_.planes.begin(), report_.planes.end(),
                                    [&point](const ReportedPlane& p) { return p.id == point.plane; });
    const WindowLandmark* known = landmark(point.id);
    if (plane == report_.planes.end() || known == nullptr || known->sightings < kFewestSightings) continue;
    if (std::none_of(coming.features.begin(), coming.features.end(), same)) continue;
    const Eigen::Vector3d ray = known->p_world - window_.poses.back().T_world_body.translation;
    const double depth = ray.norm();
    Candidate candidate{point.id, point.plane, 0, known->p_world};
    candidate.normal_sigma = known->inverse_depth_sigma * depth * std::abs(plane->normal.dot(ray));
    if (!(candidate.normal_sigma <= kMaxNormalSigma)) continue;
    candidates_.pushBack(candidate);
  }
}

void PlaneTies::addPlanes(Smoother& smoother) {
  for (const ReportedPlane& reported : report_.planes) {
    if (held(reported.id) != nullptr) continue;
    if (!reported.normal.allFinite() || !std::isfinite(reported.distance)) continue;
    HeldPlane plane;
    plane.report_id = reported.id;
    plane.estimate.id = reported.id;
    plane.estimate.normal = reported.normal;
    plane.estimate.distance = reported.distance;
    const auto fitting = std::count_if(
        candidates_.begin(), candidates_.end(),
        [&](const Candidate& candidate) { return candidate.plane == reported.id && fits(candidate, plane); });
    if (static_cast<std::size_t>(fitting) < kFewestPoints || ties_.size() + kFewestPoints > kMostTies) {
      continue;
    }
    const std::optional<PlaneId> id =
        held_.full() ? std::nullopt : smoother.addPlane(Plane(reported.normal, reported.distance));
    if (!id) continue;  // no room
    plane.id = *id;
    static_cast<void>(smoother.addPlaneDirection(*id, reported.direction, kDirectionSigma));
    held_.pushBack(plane);
    ++counters_.planes_added;
  }
}

bool PlaneTies::fits(const Candidate& candidate, const HeldPlane& plane) const {
  const double height = plane.estimate.normal.dot(candidate.p) - plane.estimate.distance;
  if (!(std::abs(height) <= kMaxResidual)) return false;
  const double expected = candidate.normal_sigma * candidate.normal_sigma + point_sigma_ * point_sigma_ +
                          variance(plane.estimate, candidate.p);
  return height * height <= kChiSquared * expected;
}

bool PlaneTies::isApart(const Candidate& candidate, double distance) const {
  return std::none_of(ties_.begin(), ties_.end(), [&](const Tie& tie) {
    return tie.plane == candidate.plane && (tie.p - candidate.p).squaredNorm() < distance * distance;
  });
}

void PlaneTies::tieCandidates(Smoother& smoother, std::size_t most_per_plane, double apart) {
  for (Candidate& candidate : candidates_) {
    if (ties_.size() >= kMostTies) return;
    HeldPlane* plane = held(candidate.plane);
    if (plane == nullptr || static_cast<std::size_t>(plane->ties) >= most_per_plane) continue;
    if (!isApart(candidate, apart)) continue;
    if (!fits(candidate, *plane)) {
      ++counters_.points_refused;
      refuse(candidate.id, candidate.plane);
      candidate.plane = 0;
      continue;
    }
    const Status promoted = smoother.promote(candidate.id);
    if (promoted.code == StatusCode::kCapacityReached) return;
    if (promoted.ok() && smoother.addPointOnPlane(candidate.id, plane->id, point_sigma_).ok()) {
      static_cast<void>(
          ties_.tryPushBack({candidate.id, candidate.plane, candidate.normal_sigma, candidate.p, 0}));
      ++plane->ties;
      ++counters_.points_tied;
    }
    candidate.plane = 0;
  }
}

void PlaneTies::review(Smoother& smoother) {
  estimates_.clear();
  if (held_.empty()) return;
  readWindow(smoother);
  for (std::size_t k = held_.size(); k-- > 0;) {
    HeldPlane& plane = held_[k];
    const std::optional<PlaneEstimate> estimate = smoother.plane(plane.id);
    if (!estimate) {  // it left the window with its last point
      dropPlane(k);
      continue;
    }
    plane.estimate.normal = estimate->plane.normal();
    plane.estimate.distance = estimate->plane.distance();
    plane.estimate.points = estimate->points;
    const double turn = estimate->covariance.topLeftCorner<2, 2>().trace();
    plane.solved = turn > 0 && turn < kSettledSigma * kSettledSigma;
    Eigen::Matrix<double, 4, 3> G = Eigen::Matrix<double, 4, 3>::Zero();
    G.topLeftCorner<3, 2>() = estimate->plane.basis();
    G(3, 2) = 1;
    plane.estimate.covariance = G * estimate->covariance * G.transpose();
  }
  for (std::size_t t = ties_.size(); t-- > 0;) {
    Tie& tie = ties_[t];
    HeldPlane* plane = held(tie.plane);
    const WindowLandmark* known = landmark(tie.id);
    if (plane == nullptr || known == nullptr || !smoother.promoted(tie.id)) {
      if (plane != nullptr) --plane->ties;  // the landmark left the window
      ties_.erase(t);
      continue;
    }
    tie.p = known->p_world;
    const double height = plane->estimate.normal.dot(tie.p) - plane->estimate.distance;
    if (plane->solved && disagrees(height, tie.normal_sigma, point_sigma_)) untie(smoother, t);
  }
  for (const HeldPlane& plane : held_) {
    if (plane.solved && plane.ties > 0) estimates_.pushBack(plane.estimate);
  }
}

void PlaneTies::untie(Smoother& smoother, std::size_t tie) {
  const Tie gone = ties_[tie];
  HeldPlane* plane = held(gone.plane);
  if (plane != nullptr) {
    smoother.removePointOnPlane(gone.id, plane->id);
    --plane->ties;
  }
  refuse(gone.id, gone.plane);
  ++counters_.points_untied;
  ties_.erase(tie);
}

void PlaneTies::refuse(TrackId id, std::uint64_t plane) {
  if (refusals_.full()) refusals_.erase(0);
  refusals_.pushBack({id, plane, kRefusedReports});
}

bool PlaneTies::refused(TrackId id, std::uint64_t plane) const {
  return std::any_of(refusals_.begin(), refusals_.end(),
                     [&](const Refusal& r) { return r.id == id && r.plane == plane; });
}

void PlaneTies::dropPlane(std::size_t plane) {
  const std::uint64_t id = held_[plane].report_id;
  for (std::size_t t = ties_.size(); t-- > 0;) {
    if (ties_[t].plane == id) ties_.erase(t);
  }
  held_.erase(plane);
}

}  // namespace swiftlet
