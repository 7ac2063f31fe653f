#include "mesher/plane_finder.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Requirements for a plane at every keyframe until it is reported.
constexpr int kNewPoints = 10;
constexpr int kNewKnown = 8;      // of them, known well enough to tell the wall from a shelf in front of it
constexpr float kNewArea = 0.5F;  // m^2: a table; less may be the side of a box
constexpr float kNewNarrow = 0.12F;     // m, 1 sigma: some 40 cm wide at its narrowest
constexpr float kNewShare = 0.6F;       // of the points around it; a cloud gives 0.25, two surfaces 0.5
constexpr float kMaxChiSquared = 2;     // 1 is expected, with sigmas from a linear solve
constexpr float kMaxRms = 0.03F;        // m; points spread evenly in the gate give 0.029
constexpr float kNewTurnSigma = 0.02F;  // rad: a narrow wall's azimuth is dominated by noise
constexpr int kProofKeyframes = 4;      // a second or more of flight: other landmarks, another view
// Requirements to keep a known plane.
constexpr int kKeptPoints = 4;
constexpr float kKeptArea = 0.15F;  // m^2
constexpr float kKeptShare = 0.4F;
constexpr float kKeptTurnSigma = 0.05F;  // rad
constexpr int kKeptSilent = 120;         // keyframes: half a minute of looking elsewhere
constexpr int kUnprovenSilent = 2;       // keyframes, for a plane that is not reported yet
// Filter of a wall's azimuth over keyframes. A point is shared by some five successive keyframes.
constexpr double kSharedKeyframes = 5;
constexpr double kTurnDrift = 0.001;     // rad per keyframe: drift of the estimate's yaw
constexpr double kTurnGate = 3;          // sigmas
constexpr double kMostTurnSigma = 0.02;  // rad, for reported planes
// A plane appears to move by millimetres per keyframe, with the estimate; a larger move is another surface.
constexpr double kSameDistance = 0.08;       // m, at the other's points
constexpr double kSameCosine = 0.985;        // 10 degrees: a narrow wall's azimuth is inaccurate
constexpr double kDuplicateDistance = 0.04;  // m: less than the gate, so both planes have the same points
// Fewer votes are no surface [m^2]: the strongest bin of a new plane holds at least a fifth of its area.
constexpr float kLeastVotes = 0.2F * kNewArea;
constexpr int kMaxTries = 24;  // guesses per keyframe, to bound the work

// Associating a landmark with a plane, and ending the association.
constexpr float kOnSigmas = 2.5F;
constexpr float kOnGate = 0.035F;  // m
constexpr float kOffSigmas = 3.5F;
constexpr int kAgreeKeyframes = 2;
constexpr int kWithoutFaces = 3;  // keyframes: the triangulation changes, the landmark does not
constexpr int kFewestShare = 3;   // at least 1/3 of the faces around it; at an edge it is half
// Spreading from faces with two corners on a plane to the third corner.
constexpr float kSpreadSigmas = 3.5F;
constexpr float kSpreadGate = 0.5F;  // m: what is this far in front of a wall is a separate object
constexpr int kSpreadRounds = 5;     // most faces between a vertex and certain points of the plane
constexpr int kReportedBonus = 10;   // points by which a new plane must lead to replace a reported one

bool proves(const PlaneSupport& s) {
  return s.points >= kNewPoints && s.known >= kNewKnown && s.area >= kNewArea && s.narrow >= kNewNarrow &&
         s.share >= kNewShare && s.turn_sigma <= kNewTurnSigma && s.chi_squared <= kMaxChiSquared &&
         s.rms <= kMaxRms;
}

bool keeps(const PlaneSupport& s) {
  return s.points >= kKeptPoints && s.area >= kKeptArea && s.share >= kKeptShare &&
         s.turn_sigma <= kKeptTurnSigma && s.chi_squared <= kMaxChiSquared && s.rms <= kMaxRms;
}

}  // namespace

void PlaneFinder::reset() {
  followed_.clear();
  associations_.clear();
}

Status PlaneFinder::step(const LocalMesh& mesh, const SmoothedWindow& window, PlaneReport& report) {
  ++counters_.keyframes;
  report.epoch = mesh.epoch;
  report.stamp = mesh.stamp;
  report.frame_index = mesh.frame_index;
  report.planes.clear();
  report.points.clear();
  if (window.epoch != mesh.epoch || window.poses.empty() ||
      !window.poses.back().T_world_body.translation.allFinite()) {
    return {StatusCode::kInvalidInput, "the window has no pose, or is not the mesh's window"};
  }
  if (mesh.epoch != epoch_) reset();
  epoch_ = mesh.epoch;
  facts_.read(mesh, window);
  counters_.refused += static_cast<std::uint64_t>(facts_.refused);
  std::fill(owners_.begin(), owners_.end(), Owner{});
  for (Followed& plane : followed_) ++plane.silent;
  followKnown(mesh);
  findNew(mesh);
  mergeDuplicates();
  expire();
  associate(mesh);
  write(mesh, report);
  return okStatus();
}

bool PlaneFinder::isProven(const Followed& plane) {
  return plane.supported >= kProofKeyframes && plane.turn_variance <= kMostTurnSigma * kMostTurnSigma;
}

void PlaneFinder::followKnown(const LocalMesh& mesh) {
  for (std::size_t i = 0; i < followed_.size(); ++i) {
    const Followed& plane = followed_[i];
    PlaneGuess guess{plane.direction, plane.normal.cast<float>(),
                     static_cast<float>(plane.distance - plane.normal.dot(facts_.viewer))};
    if (!fit_.refine(mesh, facts_, guess, true)) continue;
    const PlaneSupport& support = fit_.support();
    if (!(isProven(plane) ? keeps(support) : provesItself())) continue;
    double turn_variance = 0;
    if (!blend(plane, guess, turn_variance)) continue;
    if (slotFor(guess) != i) continue;
    followed_[i].turn_variance = turn_variance;
    accept(mesh, guess, i, false);
  }
}

// For the plane that was fitted last.
bool PlaneFinder::provesItself() {
  return proves(fit_.support()) && fit_.narrowOfLargerPart(facts_) >= kNewNarrow;
}

// Filters the azimuth: at the edge of the view, a wall's direction depends on its last points. False: the
// plane has turned into something else.
bool PlaneFinder::blend(const Followed& plane, PlaneGuess& guess, double& turn_variance) const {
  if (guess.direction == PlaneDirection::kHorizontal) return true;
  const Eigen::Vector3d before = plane.normal;
  const Eigen::Vector3d now = guess.normal.cast<double>();
  const double turn = std::atan2(before.x() * now.y() - before.y() * now.x(), before.dot(now));
  const double sigma = static_cast<double>(fit_.support().turn_sigma);
  const double known = plane.turn_variance + kTurnDrift * kTurnDrift;
  const double measured = kSharedKeyframes * sigma * sigma;
  if (turn * turn > kTurnGate * kTurnGate * (known + measured)) return false;
  const double gain = known / (known + measured);
  turn_variance = (1 - gain) * known;
  const double c = std::cos(gain * turn);
  const double s = std::sin(gain * turn);
  const Eigen::Vector3f normal =
      Eigen::Vector3d(c * before.x() - s * before.y(), s * before.x() + c * before.y(), 0).cast<float>();
  // Rotate about the centre of its points.
  guess.distance += (normal - guess.normal).dot(fit_.support().centre);
  guess.normal = normal;
  return true;
}

void PlaneFinder::findNew(const LocalMesh& mesh) {
  votes_.clear();
  for (std::size_t f = 0; f < facts_.faces.size(); ++f) {
    if (!facts_.faces[f].taken) votes_.vote(mesh.faces[f], facts_.faces[f], facts_, 1);
  }
  for (int k = 0; k < kMaxTries; ++k) {
    const std::optional<PlaneGuess> strongest = votes_.strongest(kLeastVotes);
    if (!strongest) return;
    PlaneGuess guess = *strongest;
    if (!fit_.refine(mesh, facts_, guess, false) || !provesItself()) {
      votes_.suppress(*strongest);
      continue;
    }
    std::size_t slot = slotFor(guess);
    if (slot == followed_.size()) {
      Followed fresh;
      fresh.id = next_id_;
      fresh.direction = guess.direction;
      const double sigma = static_cast<double>(fit_.support().turn_sigma);
      fresh.turn_variance = kSharedKeyframes * sigma * sigma;
      if (followed_.full() && !forgetOne()) {
        votes_.suppress(*strongest);
        continue;
      }
      slot = followed_.size();
      static_cast<void>(followed_.tryPushBack(fresh));
      ++next_id_;
    }
    accept(mesh, guess, slot, true);
    votes_.suppress(*strongest);
  }
}

// Index of the followed plane that matches the fitted one (possibly the one it came from); the number of
// followed planes if it is new.
std::size_t PlaneFinder::slotFor(const PlaneGuess& guess) {
  const Eigen::Vector3d normal = guess.normal.cast<double>();
  const Eigen::Vector3d centre = facts_.viewer + fit_.support().centre.cast<double>();
  const double distance = static_cast<double>(guess.distance) + normal.dot(facts_.viewer);
  std::size_t best = followed_.size();
  double nearest = kSameDistance;
  for (std::size_t i = 0; i < followed_.size(); ++i) {
    const Followed& plane = followed_[i];
    if (plane.direction != guess.direction || plane.normal.dot(normal) < kSameCosine) continue;
    // Compared at the points of both planes, because a small turn about one moves the other's far end.
    const double here = std::abs(plane.normal.dot(centre) - plane.distance);
    const double there = std::abs(normal.dot(plane.centre) - distance);
    if (std::max(here, 0.5 * there) >= nearest) continue;
    nearest = std::max(here, 0.5 * there);
    best = i;
  }
  return best;
}

void PlaneFinder::accept(const LocalMesh& mesh, const PlaneGuess& guess, std::size_t index, bool voted) {
  Followed& plane = followed_[index];
  if (plane.silent > 0 || plane.supported == 0) {
    plane.normal = guess.normal.cast<double>();
    plane.distance = static_cast<double>(guess.distance) + plane.normal.dot(facts_.viewer);
    plane.centre = facts_.viewer + fit_.support().centre.cast<double>();
    plane.silent = 0;
    ++plane.supported;
  }
  const auto owner = static_cast<std::uint8_t>(index);
  for (std::size_t f = 0; f < facts_.faces.size(); ++f) {
    if (!fit_.holds(f)) continue;
    facts_.faces[f].taken = true;
    if (voted) votes_.vote(mesh.faces[f], facts_.faces[f], facts_, -1);
    for (const std::uint32_t v : mesh.faces[f].vertex) {
      Owner& o = owners_[v];
      if (o.plane_faces < 255) ++o.plane_faces;
      if (o.plane == owner) continue;
      // Where two planes meet, the nearer one.
      if (o.plane == kNone || std::abs(heightOf(plane, facts_.vertices[v])) <
                                  std::abs(heightOf(followed_[o.plane], facts_.vertices[v]))) {
        o.plane = owner;
      }
    }
  }
}

float PlaneFinder::heightOf(const Followed& plane, const VertexFacts& vertex) const {
  return static_cast<float>(plane.normal.dot(facts_.viewer + vertex.p.cast<double>()) - plane.distance);
}

PlaneFinder::Followed* PlaneFinder::find(std::uint64_t id) {
  for (Followed& plane : followed_) {
    if (plane.id == id) return &plane;
  }
  return nullptr;
}

// The plane followed for longer stays.
void PlaneFinder::mergeDuplicates() {
  for (std::size_t i = 0; i < followed_.size(); ++i) {
    for (std::size_t k = followed_.size(); k-- > i + 1;) {
      const Followed& a = followed_[i];
      const Followed& b = followed_[k];
      if (a.direction != b.direction || a.normal.dot(b.normal) < kSameCosine) continue;
      if (std::abs(a.normal.dot(b.centre) - a.distance) > kDuplicateDistance ||
          std::abs(b.normal.dot(a.centre) - b.distance) > kDuplicateDistance) {
        continue;
      }
      for (Association& association : associations_) {
        if (association.plane == b.id) association.plane = a.id;
      }
      for (Owner& owner : owners_) {
        if (owner.plane == k) owner.plane = static_cast<std::uint8_t>(i);
      }
      followed_[i].supported = std::max(a.supported, b.supported);
      followed_[i].silent = std::min(a.silent, b.silent);
      followed_[i].reported = a.reported || b.reported;
      remove(k);
      ++counters_.merged;
    }
  }
}

void PlaneFinder::remove(std::size_t index) {
  for (Owner& owner : owners_) {
    if (owner.plane == kNone || owner.plane < index) continue;
    owner.plane = owner.plane == index ? kNone : static_cast<std::uint8_t>(owner.plane - 1);
  }
  followed_.erase(index);
}

// Makes room for a new plane by removing the one not seen for longest. False if all are in sight.
bool PlaneFinder::forgetOne() {
  const auto* oldest =
      std::max_element(followed_.begin(), followed_.end(),
                       [](const Followed& a, const Followed& b) { return a.silent < b.silent; });
  if (oldest->silent == 0) return false;
  remove(static_cast<std::size_t>(oldest - followed_.begin()));
  ++counters_.expired;
  return true;
}

void PlaneFinder::expire() {
  for (std::size_t i = followed_.size(); i-- > 0;) {
    const Followed& plane = followed_[i];
    if (plane.silent <= (isProven(plane) ? kKeptSilent : kUnprovenSilent)) continue;
    remove(i);
    ++counters_.expired;
  }
}

void PlaneFinder::associate(const LocalMesh& mesh) {
  for (const MeshFace& face : mesh.faces) {
    for (const std::uint32_t v : face.vertex) {
      if (v < facts_.vertices.size() && owners_[v].faces < 255) ++owners_[v].faces;
    }
  }
  associations_before_ = associations_;
  associations_.clear();
  for (Followed& plane : followed_) plane.points = 0;
  const auto by_id = [](const Association& a, const Association& b) { return a.id < b.id; };
  for (std::size_t v = 0; v < facts_.vertices.size(); ++v) {
    Association association;
    association.id = mesh.vertices[v].id;
    const Association* before =
        std::lower_bound(associations_before_.begin(), associations_before_.end(), association, by_id);
    if (before != associations_before_.end() && before->id == association.id) association = *before;
    if (!associateVertex(v, association)) continue;
    static_cast<void>(associations_.tryPushBack(association));
  }
  std::sort(associations_.begin(), associations_.end(), by_id);
  // A mesh may contain a landmark twice.
  const auto end = std::unique(associations_.begin(), associations_.end(),
                               [](const Association& a, const Association& b) { return a.id == b.id; });
  associations_.resize(static_cast<std::size_t>(end - associations_.begin()));
}

bool PlaneFinder::associateVertex(std::size_t vertex, Association& association) {
  const VertexFacts& facts = facts_.vertices[vertex];
  if (!facts.finite || !facts.measured) return false;
  association.sigma = facts.depth_sigma;
  const Owner& owner = owners_[vertex];
  const bool on_faces = owner.plane != kNone && kFewestShare * owner.plane_faces >= owner.faces;
  Followed* plane = association.plane != 0 ? find(association.plane) : nullptr;
  if (plane != nullptr) {
    const float sigma = normalSigma(facts, plane->normal.cast<float>());
    const bool near = std::abs(heightOf(*plane, facts)) <= std::min(kPlaneGate, kOffSigmas * sigma);
    const bool held = on_faces && &followed_[owner.plane] == plane;
    association.without = held || plane->silent > 0 ? 0 : association.without + 1;
    association.agreed += held ? 1 : 0;
    if (near && association.without <= kWithoutFaces) {
      plane->points += association.agreed >= kAgreeKeyframes ? 1 : 0;
      return true;
    }
    counters_.points_dropped += association.agreed >= kAgreeKeyframes ? 1 : 0;
    return false;
  }
  if (!on_faces) return false;
  plane = &followed_[owner.plane];
  const float sigma = normalSigma(facts, plane->normal.cast<float>());
  if (std::abs(heightOf(*plane, facts)) > std::min(kOnGate, kOnSigmas * sigma)) return false;
  association = {association.id, plane->id, 1, 0, facts.depth_sigma, true};
  return true;
}

void PlaneFinder::write(const LocalMesh& mesh, PlaneReport& report) {
  std::array<bool, kMaxFollowed> out{};
  for (std::size_t n = 0; n < kMaxPlanes; ++n) {
    std::size_t best = kMaxFollowed;
    int most = 0;
    for (std::size_t i = 0; i < followed_.size(); ++i) {
      const Followed& plane = followed_[i];
      if (out[i] || !isProven(plane) || plane.points < kKeptPoints) continue;
      const int weight = plane.points + (plane.reported ? kReportedBonus : 0);
      if (weight <= most) continue;
      most = weight;
      best = i;
    }
    if (best == kMaxFollowed) break;
    out[best] = true;
    Followed& plane = followed_[best];
    counters_.confirmed += plane.reported ? 0 : 1;
    plane.reported = true;
    static_cast<void>(report.planes.tryPushBack({plane.id, plane.direction, plane.normal, plane.distance}));
  }
  // Associations with reported planes, in a buffer that is free here.
  associations_before_.clear();
  for (std::size_t v = 0; v < facts_.vertices.size(); ++v) owners_[v].plane = kNone;
  for (const Association& association : associations_) {
    const bool reported =
        std::any_of(report.planes.begin(), report.planes.end(),
                    [&association](const ReportedPlane& p) { return p.id == association.plane; });
    if (!reported || association.agreed < kAgreeKeyframes) continue;
    static_cast<void>(associations_before_.tryPushBack(association));
  }
  spreadOver(mesh);
  std::sort(associations_before_.begin(), associations_before_.end(),
            [](const Association& a, const Association& b) {
              if (a.firm != b.firm) return a.firm;
              return a.sigma != b.sigma ? a.sigma < b.sigma : a.id < b.id;
            });
  for (const Association& association : associations_before_) {
    if (!report.points.tryPushBack({association.id, association.plane, association.firm})) break;
  }
}

// Adds inaccurate vertices of faces that have two corners on a plane.
void PlaneFinder::spreadOver(const LocalMesh& mesh) {
  const auto by_id = [](const Association& a, TrackId id) { return a.id < id; };
  const Association* begin = associations_before_.begin();
  const Association* end = associations_before_.end();
  for (std::size_t v = 0; v < facts_.vertices.size(); ++v) {
    const TrackId id = mesh.vertices[v].id;
    const Association* found = std::lower_bound(begin, end, id, by_id);
    if (found == end || found->id != id) continue;
    owners_[v].plane = static_cast<std::uint8_t>(find(found->plane) - followed_.begin());
  }
  for (int round = 0; round < kSpreadRounds; ++round) {
    for (std::size_t f = 0; f < facts_.faces.size(); ++f) {
      if (facts_.faces[f].area <= 0) continue;
      const auto& corner = mesh.faces[f].vertex;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = corner[k];
        const std::uint8_t plane = owners_[corner[(k + 1) % 3]].plane;
        if (owners_[v].plane != kNone || plane == kNone || plane != owners_[corner[(k + 2) % 3]].plane) {
          continue;
        }
        const VertexFacts& vertex = facts_.vertices[v];
        if (!vertex.measured) continue;
        const Followed& on = followed_[plane];
        const float sigma = normalSigma(vertex, on.normal.cast<float>());
        if (std::abs(heightOf(on, vertex)) > std::min(kSpreadGate, kSpreadSigmas * sigma)) continue;
        owners_[v].plane = plane;
        static_cast<void>(
            associations_before_.tryPushBack({mesh.vertices[v].id, on.id, 0, 0, vertex.depth_sigma, false}));
      }
    }
  }
}

}  // namespace swiftlet
