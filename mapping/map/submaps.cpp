#include "mapping/map/submaps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// Loops spread a correction over the flight since: 30 cm over a minute is 1 cm within this time.
constexpr double kSubmapSeconds = 2;
/// A block not seen for this long is seen again with the drift of the flight between. Looking away briefly
/// takes less time.
constexpr double kStaleSeconds = 10;
/// Displacement of the observed surface by a rotation [m/rad].
constexpr double kSubmapArm = 3;

/// How far apart the two transforms put what a body's images show [m].
double shiftOf(const SE3& T_map_world_a, const SE3& T_map_world_b, const SE3& T_world_body) {
  const SE3 a = T_map_world_a * T_world_body, b = T_map_world_b * T_world_body;
  return (a.translation - b.translation).norm() + kSubmapArm * a.rotation.angularDistance(b.rotation);
}

static_assert(Submaps::kMost <= std::size_t{std::numeric_limits<SubmapId>::max()} + 1);

/// T_map_world at the submap's anchor, from the keyframes before and after it. False if neither is of its
/// epoch.
bool worldOf(const Submap& submap, std::span<const WorldInMap> worlds, SE3& T_map_world) {
  const auto after = std::ranges::lower_bound(worlds, submap.frame, {}, &WorldInMap::frame);
  const bool has_after = after != worlds.end() && after->epoch == submap.epoch;
  const bool has_before = after != worlds.begin() && std::prev(after)->epoch == submap.epoch;
  if (!has_after && !has_before) return false;
  if (has_after && after->frame == submap.frame) {
    // Images were fused with the odometry's first estimate; the smoother has moved the keyframe since.
    T_map_world = after->T_map_body * submap.T_world_body.inverse();
    return true;
  }
  T_map_world = (has_before ? *std::prev(after) : *after).T_map_world();
  if (!has_before || !has_after) return true;
  const WorldInMap& before = *std::prev(after);
  const double part =
      static_cast<double>(submap.frame - before.frame) / static_cast<double>(after->frame - before.frame);
  // Interpolate the body's pose, not that of the world: its origin is far away, and a rotation about it would
  // appear as a shift.
  const SE3 a = before.T_map_world() * submap.T_world_body, b = after->T_map_world() * submap.T_world_body;
  SE3 body;
  body.rotation = a.rotation.slerp(part, b.rotation);
  body.translation = (1 - part) * a.translation + part * b.translation;
  T_map_world = body * submap.T_world_body.inverse();
  return true;
}

}  // namespace

Submaps::Submaps(MapPoses poses, double tolerance) : poses_(poses), tolerance_(tolerance) {
  submaps_.reserve(kMost);
  outdated_.resize(kMost);
}

std::size_t Submaps::bytes() const {
  return sizeof(*this) + submaps_.capacity() * sizeof(Submap) + outdated_.size();
}

double Submaps::shift(const Submap& submap, const SE3& T_map_world) {
  return shiftOf(submap.T_map_world, T_map_world, submap.T_world_body);
}

bool Submaps::isDue(const Submap& image) const {
  if (submaps_.empty()) return true;
  const Submap& last = submaps_.back();
  if (last.epoch != image.epoch) return true;
  if (poses_ == MapPoses::kGiven) return false;
  return outdated_[newest()] != 0 || (image.stamp - last.stamp).seconds() >= kSubmapSeconds ||
         shiftOf(image.T_map_world, last.T_map_world_fused, image.T_world_body) > tolerance_;
}

bool Submaps::addKept(const Submap& submap) {
  if (submaps_.size() == kMost / 2) return false;
  submaps_.push_back(submap);
  epoch_ = submap.epoch;
  return true;
}

bool Submaps::follow(const Submap& image) {
  if (epoch_ != image.epoch) {
    for (Submap& submap : submaps_) submap.tied = false;
  }
  epoch_ = image.epoch;
  if (!isDue(image) || submaps_.size() == kMost) return false;
  submaps_.push_back(image);
  while (poses_ == MapPoses::kEstimated && stale_before_ < newest() &&
         (image.stamp - submaps_[stale_before_].stamp).seconds() > kStaleSeconds) {
    ++stale_before_;
  }
  return true;
}

Submaps::Correction Submaps::correct(std::span<const WorldInMap> worlds) {
  Correction correction;
  // `worlds` may still be those of an earlier epoch.
  const bool of_newest =
      std::ranges::any_of(worlds, [&](const WorldInMap& world) { return world.epoch == epoch_; });
  for (std::size_t i = 0; i < submaps_.size(); ++i) {
    Submap& submap = submaps_[i];
    SE3 T_map_world;
    const bool listed = worldOf(submap, worlds, T_map_world);
    const bool was_in_map = isInMap(i);
    if (of_newest) submap.tied = listed;
    correction.tied = correction.tied || isInMap(i) != was_in_map;
    if (!listed) continue;
    correction.moved = correction.moved || shift(submap, T_map_world) > 0;
    submap.T_map_world = T_map_world;
    // The last of kMost submaps takes all further images, so it never becomes outdated.
    outdated_[i] = i + 1 < kMost && shift(submap, submap.T_map_world_fused) > tolerance_ ? 1 : 0;
  }
  return correction;
}

}  // namespace swiftlet
