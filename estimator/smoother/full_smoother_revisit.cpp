// Revisits of full smoothing: adds loops, joins worlds, selects matches.

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/smoother/full_smoother.hpp"
#include "estimator/smoother/full_smoother_system.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kLeastMatches = 6;  // fitting matches per loop; four can fit by chance
constexpr std::size_t kLeastTies = 3;     // points needed to fix one keyframe relative to another
constexpr int kTriangulationIterations = 5;

bool usable(const SE3& T) { return T.rotation.coeffs().allFinite() && T.translation.allFinite(); }

std::uint32_t rootOf(const std::map<std::uint32_t, std::uint32_t>& worlds, std::uint32_t epoch) {
  while (worlds.at(epoch) != epoch) epoch = worlds.at(epoch);
  return epoch;
}

/// The rotation about z nearest to R: roll and pitch of a world are known from gravity.
Eigen::Quaterniond yawPart(const Eigen::Matrix3d& R) {
  const double yaw = std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1));
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

}  // namespace

bool FullSmoother::findKeyframe(Stamp stamp, std::size_t& k) const {
  const auto found = std::ranges::lower_bound(keyframes_, stamp, {}, &Keyframe::stamp);
  k = static_cast<std::size_t>(found - keyframes_.begin());
  return found != keyframes_.end() && found->stamp == stamp;
}

Status FullSmoother::addRevisit(const LoopRevisit& loop) {
  Revisit revisit;
  if (!findKeyframe(loop.old_stamp, revisit.old_keyframe) ||
      !findKeyframe(loop.new_stamp, revisit.new_keyframe) || revisit.old_keyframe >= revisit.new_keyframe) {
    return {StatusCode::kInvalidInput, "a loop must join a keyframe to an older one, by their stamps"};
  }
  const Eigen::LLT<Matrix6d> llt(loop.information);
  if (!usable(loop.T_old_new) || !loop.information.allFinite() || llt.info() != Eigen::Success) {
    return {StatusCode::kInvalidInput, "a loop's pose must be finite and its information positive definite"};
  }
  revisit.T_old_new = loop.T_old_new;
  revisit.root_information = llt.matrixU();
  revisit.first_match = matches_.size();
  for (const RevisitMatch& match : loop.matches) {
    addMatch(match, revisit);
  }
  revisits_.push_back(revisit);
  return okStatus();
}

Status FullSmoother::setPoses(std::span<const SE3> T_world_body) {
  if (T_world_body.size() != keyframes_.size() || !std::ranges::all_of(T_world_body, usable)) {
    return {StatusCode::kInvalidInput, "full smoothing needs a finite pose for each of its keyframes"};
  }
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    BodyState& x = keyframes_[k].x;
    const Eigen::Vector3d v_body = x.T_world_body.rotation.conjugate() * x.v_world_body;
    x.T_world_body = T_world_body[k];
    x.v_world_body = x.T_world_body.rotation * v_body;
  }
  poses_given_ = true;
  forgetPoints();
  return okStatus();
}

void FullSmoother::forgetPoints() {
  for (auto& [key, track] : tracks_) track.point.triangulated = false;
}

// Finds the old landmark: the named track, or a new one made from the old keyframe's observation.
bool FullSmoother::findOldTrack(std::size_t keyframe, const RevisitFeature& feature, TrackKey& key) {
  const std::uint32_t epoch = keyframes_[keyframe].epoch;
  if (feature.has_track) {
    key = {epoch, feature.track};
    if (tracks_.contains(key)) return true;
  }
  const Sighting sighting = makeSighting(rig_, feature.seen, feature.pixel, settings_.match_sigma,
                                         static_cast<std::uint32_t>(keyframe));
  if (!sighting.any()) return false;
  // Ids of the odometry count up from zero, these count down from the maximum.
  key = {epoch, next_revisit_track_--};
  tracks_[key].sightings.push_back(sighting);
  return true;
}

void FullSmoother::addMatch(const RevisitMatch& match, Revisit& revisit) {
  const std::size_t new_keyframe = revisit.new_keyframe;
  Match made;
  const RevisitFeature& seen = match.new_feature;
  const TrackKey new_key{keyframes_[new_keyframe].epoch, seen.track};
  made.sighting = makeSighting(rig_, seen.seen, seen.pixel, settings_.match_sigma,
                               static_cast<std::uint32_t>(new_keyframe));
  if (!made.sighting.any()) {
    const auto track = seen.has_track ? tracks_.find(new_key) : tracks_.end();
    if (track == tracks_.end()) return;
    const auto at = std::ranges::find(track->second.sightings, new_keyframe, &Sighting::slot);
    if (at == track->second.sightings.end()) return;
    made.sighting = *at;
    for (CameraSighting& view : made.sighting.camera) {
      if (view.used)
        view.weight *= static_cast<float>(keyframes_[new_keyframe].noise.pixel_sigma / settings_.match_sigma);
    }
  }
  if (!findOldTrack(revisit.old_keyframe, match.old_feature, made.track)) return;
  const std::vector<Sighting>& own = tracks_[made.track].sightings;
  if (std::ranges::find(own, new_keyframe, &Sighting::slot) != own.end() ||
      matched_slots_.contains({made.track, new_keyframe}) ||
      (seen.has_track && !matched_tracks_.emplace(made.track, new_key).second)) {
    ++revisit.repeated;
    return;
  }
  matched_slots_.emplace(made.track, new_keyframe);
  matches_.push_back(made);
  ++revisit.match_count;
}

void FullSmoother::moveWorld(std::uint32_t world, const SE3& T_to_from) {
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    if (rootOf(worlds_, keyframes_[k].epoch) != world) continue;
    BodyState& x = keyframes_[k].x;
    x.T_world_body = T_to_from * x.T_world_body;
    x.v_world_body = T_to_from.rotation * x.v_world_body;
  }
}

// Transforms worlds that are connected by loops into one, each by the loop with the most matches.
void FullSmoother::joinWorlds() {
  for (auto& [epoch, world] : worlds_) world = epoch;
  std::vector<std::size_t> order(revisits_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, std::greater<>(),
                           [this](std::size_t r) { return revisits_[r].match_count; });
  for (const std::size_t r : order) {
    const Revisit& revisit = revisits_[r];
    const Keyframe& old_keyframe = keyframes_[revisit.old_keyframe];
    const Keyframe& new_keyframe = keyframes_[revisit.new_keyframe];
    const std::uint32_t old_world = rootOf(worlds_, old_keyframe.epoch);
    const std::uint32_t new_world = rootOf(worlds_, new_keyframe.epoch);
    if (old_world == new_world) continue;
    if (!poses_given_) {
      const SE3 measured = old_keyframe.x.T_world_body * revisit.T_old_new;
      const SE3& given = new_keyframe.x.T_world_body;
      const Eigen::Quaterniond turn = yawPart((measured * given.inverse()).R());
      const SE3 T_old_new(turn, measured.translation - turn * given.translation);
      if (old_world < new_world) {
        moveWorld(new_world, T_old_new);
      } else {
        moveWorld(old_world, T_old_new.inverse());
      }
    }
    worlds_[std::max(old_world, new_world)] = std::min(old_world, new_world);
  }
  forgetPoints();
}

std::size_t FullSmoother::matchesInSystem(const Revisit& revisit) const {
  std::size_t count = 0;
  for (std::size_t m = 0; m < revisit.match_count; ++m) {
    const Match& match = matches_[revisit.first_match + m];
    if (!match.used) continue;
    const Track& track = tracks_.at(match.track);
    // It may have been removed as an outlier since.
    const auto at = std::ranges::find(track.sightings, match.sighting.slot, &Sighting::slot);
    if (track.in_system && at != track.sightings.end()) ++count;
  }
  return count;
}

// Determines which epochs share a world: those connected by any loop, or only by loops whose matches are in
// the system.
void FullSmoother::tieWorlds(bool by_matches) {
  for (auto& [epoch, world] : worlds_) world = epoch;
  for (const Revisit& revisit : revisits_) {
    const std::uint32_t a = rootOf(worlds_, keyframes_[revisit.old_keyframe].epoch);
    const std::uint32_t b = rootOf(worlds_, keyframes_[revisit.new_keyframe].epoch);
    if (a == b || (by_matches && matchesInSystem(revisit) < kLeastTies)) continue;
    worlds_[std::max(a, b)] = std::min(a, b);
  }
  for (auto& [epoch, world] : worlds_) world = rootOf(worlds_, epoch);
}

void FullSmoother::linearizeRevisits(System& system) const {
  for (const Revisit& revisit : revisits_) {
    const RelativePoseFactor factor = relativePoseFactor(revisit.T_old_new, revisit.root_information,
                                                         keyframes_[revisit.old_keyframe].x.T_world_body,
                                                         keyframes_[revisit.new_keyframe].x.T_world_body);
    const double weight = RobustWeight::cauchy(factor.residual.squaredNorm(), 1.0).weight;
    const Eigen::Index i = kStateDim * static_cast<Eigen::Index>(revisit.old_keyframe);
    const Eigen::Index j = kStateDim * static_cast<Eigen::Index>(revisit.new_keyframe);
    const Matrix6d& J_i = factor.jacobian_old;
    const Matrix6d& J_j = factor.jacobian_new;
    system.addPoses(revisit.old_keyframe, revisit.old_keyframe, weight * J_i.transpose() * J_i);
    system.addPoses(revisit.new_keyframe, revisit.old_keyframe, weight * J_j.transpose() * J_i);
    system.addPoses(revisit.new_keyframe, revisit.new_keyframe, weight * J_j.transpose() * J_j);
    system.g.segment<kPoseDim>(i) += weight * J_i.transpose() * factor.residual;
    system.g.segment<kPoseDim>(j) += weight * J_j.transpose() * factor.residual;
  }
}

void FullSmoother::withdraw(Match& match) {
  if (!match.used) return;
  match.used = false;
  Track& track = tracks_.at(match.track);
  std::erase_if(track.sightings, [&](const Sighting& s) { return s.slot == match.sighting.slot; });
}

// Uses a match if it fits the landmark triangulated from it and the track's other observations.
void FullSmoother::tryMatch(Match& match, double gate_sigmas) {
  Track& track = tracks_.at(match.track);
  const LandmarkPoint point = track.point;
  const auto at = std::ranges::upper_bound(track.sightings, match.sighting.slot, {}, &Sighting::slot);
  const Sighting& sighting = *track.sightings.insert(at, match.sighting);
  track.in_system = track.sightings.size() >= 2 &&
                    triangulate(poses_, track.sightings, kTriangulationIterations, track.point);
  bool fits = track.in_system;
  for (std::size_t c = 0; c < kMaxCameras && fits; ++c) {
    const CameraSighting& view = sighting.camera[c];
    Eigen::Vector2d r;
    fits = !view.used || (reprojectionResidual(view, poses_[sighting.slot].current[c], track.point, r) &&
                          r.squaredNorm() < gate_sigmas * gate_sigmas);
  }
  match.used = true;
  if (fits) return;
  withdraw(match);
  track.point = point;
  track.in_system = track.sightings.size() >= 2 &&
                    triangulate(poses_, track.sightings, kTriangulationIterations, track.point);
}

// Tries all matches again at the current poses, where more of them may fit.
void FullSmoother::chooseMatches(double gate_sigmas) {
  for (Match& match : matches_) withdraw(match);
  triangulateAll();
  for (Revisit& revisit : revisits_) {
    for (std::size_t m = 0; m < revisit.match_count; ++m) {
      tryMatch(matches_[revisit.first_match + m], gate_sigmas);
    }
    if (matchesInSystem(revisit) + revisit.repeated >= kLeastMatches) continue;
    for (std::size_t m = 0; m < revisit.match_count; ++m) {
      Match& match = matches_[revisit.first_match + m];
      if (!match.used) continue;
      withdraw(match);
      Track& track = tracks_.at(match.track);
      track.in_system = track.sightings.size() >= 2 &&
                        triangulate(poses_, track.sightings, kTriangulationIterations, track.point);
    }
  }
}

}  // namespace swiftlet
