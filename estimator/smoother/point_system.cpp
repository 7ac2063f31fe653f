#include "estimator/smoother/point_system.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

// Calls `use` with the views of all observations in groups of four; the last group may be smaller.
template <typename F>
void inGroups(RigPoses poses, std::span<const Sighting> sightings, const F& use) {
  lanes::ViewPointers pointers;
  std::size_t lane = 0;
  for (const Sighting& sighting : sightings) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      if (!sighting.camera[c].used) continue;
      pointers.set(lane++, poses[sighting.slot].current[c], sighting.camera[c]);
      if (lane < lanes::kLanes) continue;
      use(pointers);
      pointers = {};
      lane = 0;
    }
  }
  if (lane > 0) use(pointers);
}

// Mean squared residual of a point behind a camera that observed it, above any limit.
constexpr double kBehindCamera = 1e6;

struct Sums {
  lanes::PointSums sums;
  int views = 0;
  bool in_front = true;

  void add(const lanes::ViewGroup& group, const LandmarkPoint& point, const PointBasis& basis) {
    const lanes::Residuals residuals(group, point);
    const lanes::Jacobians J(group, residuals, basis);
    const lanes::Mask counts = group.used & residuals.in_front;
    in_front = in_front && !lanes::any(group.used & ~residuals.in_front);
    views += lanes::count(counts);
    lanes::V weight;
    sums.weigh(residuals, counts, weight);
    for (std::size_t row = 0; row < 2; ++row) sums.add(weight, J.point[row], residuals.r[row]);
  }
  void addCost(const lanes::ViewGroup& group, const LandmarkPoint& point) {
    const lanes::Residuals residuals(group, point);
    lanes::V weight;
    sums.weigh(residuals, group.used & residuals.in_front, weight);
  }
};

}  // namespace

double meanSquaredResidual(RigPoses poses, std::span<const Sighting> sightings, const LandmarkPoint& point) {
  lanes::V squares{};
  int views = 0;
  bool in_front = true;
  inGroups(poses, sightings, [&](const lanes::ViewPointers& p) {
    const lanes::ViewGroup group(p);
    const lanes::Residuals residuals(group, point);
    in_front = in_front && !lanes::any(group.used & ~residuals.in_front);
    // An unused lane contains the numbers of another one.
    squares += group.used ? residuals.r[0] * residuals.r[0] + residuals.r[1] * residuals.r[1] : lanes::V{};
    views += lanes::count(group.used);
  });
  if (!in_front) return kBehindCamera;
  return views > 0 ? lanes::sum(squares) / views : -1.0;
}

PointViews::PointViews(RigPoses poses, std::span<const Sighting> sightings) : poses_(poses) {
  const std::size_t gathered = std::min(sightings.size(), kMaxStates);
  rest_ = sightings.subspan(gathered);
  inGroups(poses, sightings.first(gathered),
           [this](const lanes::ViewPointers& p) { groups_[count_++] = lanes::ViewGroup(p); });
}

PointSystem PointViews::linearize(const LandmarkPoint& point, const PointBasis& basis) const {
  Sums sums;
  for (std::size_t k = 0; k < count_; ++k) sums.add(groups_[k], point, basis);
  inGroups(poses_, rest_, [&](const lanes::ViewPointers& p) { sums.add(lanes::ViewGroup(p), point, basis); });
  return {sums.sums.H(), sums.sums.g(), sums.sums.cost(), sums.views, sums.in_front};
}

double PointViews::cost(const LandmarkPoint& point) const {
  Sums sums;
  for (std::size_t k = 0; k < count_; ++k) sums.addCost(groups_[k], point);
  inGroups(poses_, rest_, [&](const lanes::ViewPointers& p) { sums.addCost(lanes::ViewGroup(p), point); });
  return sums.sums.cost();
}

}  // namespace swiftlet
