#include "tests/smoother/revisit_flight.hpp"

#include <array>
#include <cmath>
#include <map>

#include "estimator/geometry/so3.hpp"

namespace swiftlet::test {
namespace {

using LandmarkKey = std::array<double, 3>;  // landmarks are told apart by where they are

struct Seen {
  SE3 T_world_body;
  std::map<LandmarkKey, TrackId> tracks;
};

std::vector<Seen> seenBy(const TrackFlight& flight, const std::vector<std::size_t>& keyframes) {
  std::vector<Seen> all;
  for (const std::size_t k : keyframes) {
    Seen seen;
    seen.T_world_body = flight.truth(k).T_world_body;
    for (const TrackedFeature& feature : flight.frames()[k].features) {
      const Eigen::Vector3d& p = flight.landmark(feature.id);
      seen.tracks[{p.x(), p.y(), p.z()}] = feature.id;
    }
    all.push_back(std::move(seen));
  }
  return all;
}

std::vector<RevisitMatch> matchesOf(const Seen& old_seen, const Seen& new_seen) {
  std::vector<RevisitMatch> matches;
  for (const auto& [landmark, track] : new_seen.tracks) {
    const auto found = old_seen.tracks.find(landmark);
    if (found == old_seen.tracks.end() || found->second == track) continue;
    RevisitMatch match;
    match.old_feature.has_track = match.new_feature.has_track = true;
    match.old_feature.track = found->second;
    match.new_feature.track = track;
    matches.push_back(match);
  }
  return matches;
}

// A share of the matches is given the old landmark of another.
void shuffle(std::vector<RevisitMatch>& matches, double share, Random& random) {
  for (RevisitMatch& match : matches) {
    if (random.uniform() >= share) continue;
    const auto other = random.below(static_cast<std::uint32_t>(matches.size()));
    std::swap(match.old_feature.track, matches[other].old_feature.track);
  }
}

}  // namespace

std::vector<LoopRevisit> trueLoops(const TrackFlight& flight, const std::vector<std::size_t>& keyframes,
                                   const RevisitSettings& settings) {
  Random random(flight.flight().settings().seed, 91);
  const auto normal = [&random](double sigma) {
    return Eigen::Vector3d(sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
  };
  const std::vector<Seen> seen = seenBy(flight, keyframes);
  std::vector<LoopRevisit> loops;
  for (std::size_t j = 0; j < keyframes.size(); j += settings.spacing) {
    std::vector<RevisitMatch> best;
    std::size_t best_old = 0;
    for (std::size_t i = 0; i < j; ++i) {
      if (flight.seconds(keyframes[j]) - flight.seconds(keyframes[i]) < settings.min_apart) break;
      const SE3 T_i_j = seen[i].T_world_body.inverse() * seen[j].T_world_body;
      if (T_i_j.translation.norm() > settings.max_distance ||
          logSo3(T_i_j.rotation).norm() > settings.max_turn) {
        continue;
      }
      std::vector<RevisitMatch> matches = matchesOf(seen[i], seen[j]);
      if (matches.size() <= best.size()) continue;
      best = std::move(matches);
      best_old = i;
    }
    if (best.size() < settings.min_matches) continue;
    LoopRevisit loop;
    loop.old_stamp = flight.frames()[keyframes[best_old]].stamp;
    loop.new_stamp = flight.frames()[keyframes[j]].stamp;
    const SE3 error(expSo3(normal(settings.rotation_sigma)), normal(settings.position_sigma));
    loop.T_old_new = seen[best_old].T_world_body.inverse() * seen[j].T_world_body * error;
    loop.information.setZero();
    loop.information.diagonal().head<3>().setConstant(std::pow(settings.rotation_sigma, -2));
    loop.information.diagonal().tail<3>().setConstant(std::pow(settings.position_sigma, -2));
    shuffle(best, settings.wrong_share, random);
    loop.matches = std::move(best);
    loops.push_back(std::move(loop));
  }
  return loops;
}

}  // namespace swiftlet::test
