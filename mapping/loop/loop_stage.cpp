#include "mapping/loop/loop_stage.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/messages/camera_scan.hpp"
#include "mapping/place/vocabulary.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {
namespace {

// Factor on the covariance of a bridge over missed keyframes: the odometry's variance grows faster than time.
constexpr double kBridgeInflation = 2;

// Two nodes nearer in time than this are no revisit.
constexpr double kRevisitSeconds = 10;

// Two views of one place. Views farther apart or turned more have little in common.
constexpr double kNearDistance = 2;                 // m
constexpr double kNearTurn = std::numbers::pi / 4;  // rad
constexpr std::size_t kNearSearches = 8;            // in a step, each linear in nodes

// A location predicts that views near kept ones are recognized. At a correct location, 93 % of the views up
// to kSureView are (docs/experiments/accuracy_loops.md). If misses are independent, ten in a row happen there
// once in 1e11 tries, or once in 1e4 if only 60 % are recognized, for example in changed light.
constexpr double kSureView = 0.75;  // as given by view(): up to 1 views are near
constexpr int kMostMissed = 10;     // views

// Views that contradict a location, less those that only agree with it since: as many as locate
// (min_between). What agreed before says little: where two places look alike and only one was known, no view
// could contradict.
constexpr int kMostAgainst = 3;

PlaceDatabaseSettings databaseSettings(const LoopSettings& settings, const LoopLimits& limits) {
  PlaceDatabaseSettings out;
  out.keyframes = limits.nodes;
  out.min_relative = static_cast<float>(settings.min_similarity);
  out.exclude = kRevisitSeconds;
  return out;
}

const WindowPose* poseOfFrame(const SmoothedWindow& window, std::uint64_t frame) {
  for (const WindowPose& pose : window.poses) {
    if (pose.frame_index == frame) return &pose;
  }
  return nullptr;
}

}  // namespace

LoopStage::LoopStage(const Rig& rig, const LoopSettings& settings, const LoopLimits& limits,
                     const Vocabulary& vocabulary)
    : rig_(rig),
      place_(rig.camera[0], vocabulary, {}, databaseSettings(settings, limits)),
      stereo_(rig.camera_count > 1 ? std::make_unique<StereoDepth>(rig) : nullptr),
      verifier_(rig),
      map_(settings, limits),
      places_(place_.database().capacity()),
      comparisons_(place_.database().capacity()),
      inliers_(limits.loops) {}

MapNode LoopStage::node(std::size_t i) const {
  const LoopMap::Node& node = map_.node(i);
  return {node.stamp, node.frame, std::min(node.epoch, kKeptEpochs), map_.pose(i), node.T_world_body};
}

Status LoopStage::step(const LoopInput& input, const LoopEffort& effort, LoopReport& report) {
  ++counters_.keyframes;
  report = LoopReport{};
  report.correction = correction_;
  if (input.tracks == nullptr || input.window == nullptr || input.link == nullptr ||
      input.window->poses.empty() || input.window->poses.back().frame_index != input.tracks->index ||
      !allFinite(input.window->poses.back().T_world_body)) {
    return {StatusCode::kInvalidInput, "the keyframe has no pose in its window"};
  }
  const WindowPose& pose = input.window->poses.back();
  report.stamp = input.tracks->stamp;
  report.frame = input.tracks->index;
  extendPending(input);
  Status status;
  if (movedEnough(pose.stamp)) {
    status = addNode(*input.window);
    if (!status.ok()) {
      ++counters_.refused;
    } else if (describePlace(input)) {
      keepPlace();
      closeLoops(effort, report);
      weighLocation();
    } else {
      ++counters_.without_image;
    }
  }
  closeNearLoops(effort, report);
  static_cast<void>(map_.settle(effort.iterations, report.moved));
  correct(*input.window);
  report.loops = map_.loops();
  report.selected = map_.selected();
  report.correction = correction_;
  return status;
}

// Extends the motion since the last node to the newest keyframe.
void LoopStage::extendPending(const LoopInput& input) {
  const KeyframeLink& link = *input.link;
  if (map_.size() == 0 || input.window->epoch != epoch_) pending_ = Pending{};
  epoch_ = input.window->epoch;
  if (pending_.linked) {
    if (link.linked && link.previous == pending_.frame) {
      appendLink(link.T_previous_this, link.covariance);
    } else {
      bridge(input);
    }
  }
  pending_.frame = input.tracks->index;
}

// Keyframes were missed: the window may still hold the one that was taken last.
void LoopStage::bridge(const LoopInput& input) {
  const SmoothedWindow& window = *input.window;
  const WindowPose& newest = window.poses.back();
  const WindowPose* taken = poseOfFrame(window, pending_.frame);
  const WindowPose* before = input.link->linked ? poseOfFrame(window, input.link->previous) : nullptr;
  if (taken == nullptr || before == nullptr || before->stamp >= newest.stamp) {
    pending_ = Pending{};
    return;
  }
  const double steps = (newest.stamp - taken->stamp).seconds() / (newest.stamp - before->stamp).seconds();
  appendLink(taken->T_world_body.inverse() * newest.T_world_body,
             kBridgeInflation * steps * steps * input.link->covariance);
  ++counters_.gaps;
}

void LoopStage::appendLink(const SE3& T_previous_this, const Matrix6d& covariance) {
  const Matrix6d carry = poseAdjoint(T_previous_this.inverse());
  pending_.T_node_this = pending_.T_node_this * T_previous_this;
  pending_.covariance = carry * pending_.covariance * carry.transpose() + covariance;
}

bool LoopStage::movedEnough(Stamp now) const {
  return !pending_.linked || viewsDiffer(SE3(), pending_.T_node_this) ||
         (now - map_.node(map_.size() - 1).stamp).seconds() > kNodeSeconds;
}

Status LoopStage::addNode(const SmoothedWindow& window) {
  const WindowPose& pose = window.poses.back();
  // A link that is not finite would spoil all poses composed with it.
  pending_.linked = pending_.linked && allFinite(pending_.T_node_this) && pending_.covariance.allFinite();
  LoopMap::Node left;
  if (map_.full() && map_.makeRoom(left) && place_.database().holds(left.place, left.frame, left.epoch)) {
    place_.forget(left.place);
  }
  LoopMap::Node node;
  node.stamp = pose.stamp;
  node.frame = pose.frame_index;
  node.epoch = epoch_;
  node.place = PlaceDatabase::kNoSlot;
  node.T_world_body = pose.T_world_body;
  if (window.started) {
    node.tilt.up_body = pose.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    node.tilt.covariance = window.newest.covariance.topLeftCorner<3, 3>();
  }
  const LoopMap::Link link{pending_.T_node_this, pending_.covariance};
  const bool linked = pending_.linked;
  if (const Status status = map_.add(node, linked ? &link : nullptr); !status.ok()) return status;
  counters_.components += linked ? 0 : 1;
  ++counters_.nodes;
  pending_ = Pending{};
  pending_.linked = true;
  pending_.frame = pose.frame_index;
  return okStatus();
}

bool LoopStage::describePlace(const LoopInput& input) {
  if (input.image[0].empty()) return false;
  if (!place_.step(input.image[0], *input.tracks, epoch_, newest_, place_step_).ok()) return false;
  std::size_t found = 0;
  if (stereo_ && !input.image[1].empty()) {
    static_cast<void>(stereo_->fill(input.image[0], input.image[1], newest_, found));
  }
  static_cast<void>(landmarks_.fill(*input.window, rig_.T_body_cam[0], newest_, found));
  if (const WindowPose* const pose = poseOfFrame(*input.window, input.tracks->index);
      pose != nullptr && rig_.rolls()) {
    moveToMiddleRow(pose->scan);
  }
  return true;
}

// Converts the features of a rolling shutter to the time of the middle row, which is that of the pose.
void LoopStage::moveToMiddleRow(const ScanMotion& motion) {
  const CameraScan scan(rig_.T_body_cam[0], motion);
  constexpr double kFar = 1e3;  // m, for features without depth: only their direction matters
  for (PlaceFeature& feature : newest_.features) {
    const bool known = feature.inverse_depth > 0;
    const double distance = known ? 1.0 / static_cast<double>(feature.inverse_depth) : kFar;
    const Eigen::Vector3d p = scan.fromRow(distance * feature.bearing.cast<double>(),
                                           rig_.rowTime(0, static_cast<double>(feature.pixel.y())));
    feature.bearing = p.normalized().cast<float>();
    if (known) feature.inverse_depth = static_cast<float>(1.0 / p.norm());
  }
}

void LoopStage::keepPlace() {
  if (place_step_.slot == PlaceDatabase::kNoSlot) return;
  places_[place_step_.slot] = newest_;
  comparisons_[place_step_.slot] = Comparisons{};
  map_.setPlace(place_step_.slot);
}

// Compares the newest node with the nearest node in the map, then with similar places.
void LoopStage::closeLoops(const LoopEffort& effort, LoopReport& report) {
  const auto newest = static_cast<std::uint32_t>(map_.size() - 1);
  evidence_ = Evidence{};
  if (!hasPlace(newest) || effort.candidates == 0) return;
  Comparisons& made = comparisons_[map_.node(newest).place];
  bool tied = compareNearest(newest, effort, report);
  // The place that the first verified candidate shows.
  std::uint32_t shown = newest;
  for (const PlaceCandidate& candidate : place_step_.query.candidates) {
    if (report.candidates.size() >= std::min(effort.candidates, kMaxLoopCandidates)) return;
    std::uint32_t from = 0;
    if (!map_.find(candidate.index, candidate.epoch, from) || !hasPlace(from)) continue;
    if (std::find(made.frames.begin(), made.frames.end(), candidate.index) != made.frames.end()) continue;
    // A second loop to the same place adds little. A loop to another place may contradict the first, so that
    // a wrong map does not confirm itself.
    if (tied && view(from, shown) <= 1) continue;
    if (isSkipped(from, newest)) {
      evidence_.repeats = true;
      continue;
    }
    static_cast<void>(made.frames.tryPushBack(candidate.index));
    LoopCandidate told;
    told.similarity = static_cast<double>(candidate.relative);
    if (!verify(from, newest, told, effort, report)) continue;
    made.near_left = 0;
    if (map_.kept() == 0 || located(newest)) return;
    tied = true;
    shown = from;
  }
}

// Compares nodes without a loop with near nodes, the newest first.
void LoopStage::closeNearLoops(const LoopEffort& effort, LoopReport& report) {
  std::size_t searches = 0;
  for (auto to = static_cast<std::uint32_t>(map_.size()); to-- > 0 && map_.selected() > 0;) {
    if (!hasPlace(to)) continue;
    const Comparisons& made = comparisons_[map_.node(to).place];
    while (made.near_left > 0) {
      if (report.candidates.size() >= std::min(effort.candidates, kMaxLoopCandidates)) return;
      if (searches++ >= kNearSearches) return;
      static_cast<void>(compareNearest(to, effort, report));
    }
  }
}

/// Compares `to` with the nearest node that it was not compared with. True if that gave a loop.
bool LoopStage::compareNearest(std::uint32_t to, const LoopEffort& effort, LoopReport& report) {
  Comparisons& made = comparisons_[map_.node(to).place];
  if (map_.selected() == 0 || made.near_left == 0) return false;
  std::uint32_t from = 0;
  if (!nearestNode(to, from)) {
    made.near_left = 0;
    return false;
  }
  --made.near_left;
  static_cast<void>(made.frames.tryPushBack(map_.node(from).frame));
  LoopCandidate told;
  told.near = true;
  const bool tied = !isSkipped(from, to) && verify(from, to, told, effort, report);
  if (tied) made.near_left = 0;
  if (from < map_.kept() && map_.component(to) == map_.component(static_cast<std::uint32_t>(map_.size() - 1)))
    checkLocation(to, view(from, to), tied && agrees(newest_loop_));
  return tied;
}

/// Counts predicted views that are not recognized, and withdraws the location after kMostMissed in a row.
/// `view`: distance of `to` from the kept node that it was compared with; `seen`: it was recognized there.
void LoopStage::checkLocation(std::uint32_t to, double view, bool seen) {
  if (seen) {
    missed_ = 0;
    return;
  }
  // A view that is hidden from a hovering vehicle counts as one miss.
  const SE3& here = map_.node(to).T_world_body;
  if (view > kSureView || (missed_ > 0 && !viewsDiffer(missed_at_, here))) return;
  missed_at_ = here;
  if (++missed_ < kMostMissed) return;
  missed_ = 0;
  map_.releaseTies(map_.component(to));
}

/// Counts views that contradict the location. One that fits another place of the map as well contradicts too.
void LoopStage::weighLocation() {
  if (evidence_.contradicts) {
    against_ = std::min(against_ + 1, kMostAgainst);
  } else if (evidence_.agrees && !evidence_.repeats) {
    against_ = std::max(against_ - 1, 0);
  }
}

/// Whether the loop belongs to the set of loops that agree.
bool LoopStage::agrees(std::uint32_t id) const {
  const LoopVerdict verdict = map_.graph().verdict(id);
  return verdict == LoopVerdict::kSelected || verdict == LoopVerdict::kUnsupported;
}

/// Whether the node's features are still held.
bool LoopStage::hasPlace(std::uint32_t k) const {
  const LoopMap::Node& node = map_.node(k);
  return place_.database().holds(node.place, node.frame, node.epoch);
}

/// Distance of two views in the map; up to 1 they are near. Infinite if nothing joins their nodes.
double LoopStage::view(std::uint32_t a, std::uint32_t b) const {
  if (!map_.joined(a, b)) return std::numeric_limits<double>::infinity();
  const double distance = (map_.pose(a).translation - map_.pose(b).translation).norm() / kNearDistance;
  if (distance > 1) return distance;
  return std::max(distance, map_.pose(a).rotation.angularDistance(map_.pose(b).rotation) / kNearTurn);
}

/// Whether a loop between these nodes would join the same two views as a loop that is held and not accepted.
/// Verification repeats its error for the same views, so a vehicle that hovers in front of a look-alike would
/// collect any number of wrong loops.
bool LoopStage::isRepeated(std::uint32_t from, std::uint32_t to) const {
  for (std::uint32_t id = 0; id < map_.loops(); ++id) {
    const RelativePose<SE3>& held = map_.loopEdge(id);
    if (!map_.selected(id) && map_.component(held.to) == map_.component(to) && map_.joined(held.from, from) &&
        !viewsDiffer(map_.pose(held.from), map_.pose(from)) &&
        !viewsDiffer(map_.pose(held.to), map_.pose(to))) {
      return true;
    }
  }
  return false;
}

/// Whether a candidate is not verified: repeated, and between two pieces. Within one the odometry tells which
/// loops are wrong.
bool LoopStage::isSkipped(std::uint32_t from, std::uint32_t to) const {
  return map_.component(from) != map_.component(to) && isRepeated(from, to);
}

/// Finds the nearest of the nodes near `to` that it was not compared with. False if there is none.
bool LoopStage::nearestNode(std::uint32_t to, std::uint32_t& from) const {
  const auto& compared = comparisons_[map_.node(to).place].frames;
  const LoopMap::Node& now = map_.node(to);
  double least = 1;
  bool found = false;
  for (std::uint32_t k = 0; k < to; ++k) {
    const LoopMap::Node& before = map_.node(k);
    if (before.epoch == now.epoch && (now.stamp - before.stamp).seconds() < kRevisitSeconds) break;
    const double apart = view(k, to);
    if (apart >= least || !hasPlace(k)) continue;
    if (std::find(compared.begin(), compared.end(), map_.node(k).frame) != compared.end()) continue;
    least = apart;
    from = k;
    found = true;
  }
  return found;
}

/// Verifies a candidate by geometry and offers it to the map. True if it became a loop.
bool LoopStage::verify(std::uint32_t from, std::uint32_t to, LoopCandidate& told, const LoopEffort& effort,
                       LoopReport& report) {
  const LoopMap::Node& old_node = map_.node(from);
  const LoopMap::Node& new_node = map_.node(to);
  static_cast<void>(verifier_.verify(places_[old_node.place], places_[new_node.place], {},
                                     effort.verification, verification_));
  ++counters_.fates[static_cast<std::size_t>(verification_.fate)];
  counters_.near += told.near ? 1 : 0;
  told.kept = from < map_.kept();
  told.old_frame = old_node.frame;
  told.old_stamp = old_node.stamp;
  told.new_frame = new_node.frame;
  told.new_stamp = new_node.stamp;
  told.fate = verification_.fate;
  told.matches = verification_.matches;
  told.inliers = verification_.inliers.size();
  static_cast<void>(report.candidates.tryPushBack(told));
  std::uint32_t id = 0;
  const bool again = verification_.accepted() && isRepeated(from, to);
  if (!verification_.accepted() ||
      !map_.addLoop(from, to, verification_.T_old_new, verification_.covariance, id).ok()) {
    return false;
  }
  newest_loop_ = id;
  inliers_[id] = verification_.inliers;
  ++counters_.loops;
  if (to + 1 == map_.size()) {
    // A loop that misfits by less than a view, for example because the odometry is too sure, is no other
    // place.
    const SE3 shown = map_.pose(from) * verification_.T_old_new;
    const bool elsewhere = !agrees(id) && viewsDiffer(shown, map_.pose(to));
    bool& said = elsewhere ? evidence_.contradicts : evidence_.agrees;
    (again ? evidence_.repeats : said) = true;
  }
  counters_.kept_loops += told.kept ? 1 : 0;
  counters_.near_loops += told.near ? 1 : 0;
  return true;
}

void LoopStage::correct(const SmoothedWindow& window) {
  if (map_.size() == map_.kept()) return;
  const LoopMap::Node& node = map_.node(map_.size() - 1);
  const WindowPose* now = poseOfFrame(window, node.frame);
  const SE3 T_world_node = now != nullptr ? now->T_world_body : node.T_world_body;
  correction_.epoch = node.epoch;
  correction_.kept_map = map_.kept() > 0;
  const bool tied = located(static_cast<std::uint32_t>(map_.size() - 1));
  if (!tied) missed_ = against_ = 0;
  correction_.located = tied && against_ < kMostAgainst;
  correction_.T_map_world = map_.pose(map_.size() - 1) * T_world_node.inverse();
  ++correction_.version;
}

LoopCounters LoopStage::counters() const {
  LoopCounters out = counters_;
  out.selected = map_.selected();
  out.map = map_.counters();
  return out;
}

void LoopStage::tiedEpochs(std::uint32_t epoch, FixedVector<std::uint32_t, kTiedEpochs>& out) const {
  out.clear();
  const auto is_tied = [&](std::uint32_t e) {
    return e == epoch || std::find(out.begin(), out.end(), e) != out.end();
  };
  // A pass may reach one epoch from another that it has just added.
  for (std::size_t before = 0, pass = 0; pass == 0 || out.size() > before; ++pass) {
    before = out.size();
    for (std::uint32_t i = 0; i < map_.loops(); ++i) {
      if (!map_.selected(i)) continue;
      const RelativePose<SE3>& edge = map_.loopEdge(i);
      // All pieces of a kept map count as one epoch.
      const std::uint32_t a = std::min(map_.node(edge.from).epoch, kKeptEpochs);
      const std::uint32_t b = std::min(map_.node(edge.to).epoch, kKeptEpochs);
      if (is_tied(a) != is_tied(b)) static_cast<void>(out.tryPushBack(is_tied(a) ? b : a));
    }
  }
  std::sort(out.begin(), out.end());
}

MapLoop LoopStage::loop(std::uint32_t i) const {
  const RelativePose<SE3>& edge = map_.loopEdge(i);
  const Matrix6d covariance = edge.information.ldlt().solve(Matrix6d::Identity());
  MapLoop out;
  out.old_stamp = map_.node(edge.from).stamp;
  out.new_stamp = map_.node(edge.to).stamp;
  out.kept = edge.from < map_.kept();
  out.T_old_new = edge.T_from_to;
  out.rotation_sigma = std::sqrt(covariance.diagonal().head<3>().maxCoeff());
  out.translation_sigma = std::sqrt(covariance.diagonal().tail<3>().maxCoeff());
  out.inliers = inliers_[i].size();
  out.verdict = map_.graph().verdict(i);
  return out;
}

bool LoopStage::revisit(std::uint32_t i, LoopRevisit& out) const {
  const LoopMap::Loop& loop = map_.loop(i);
  if (!map_.selected(i) || loop.carried) return false;
  const RelativePose<SE3>& edge = map_.loopEdge(i);
  const LoopMap::Node& from = map_.node(edge.from);
  const LoopMap::Node& to = map_.node(edge.to);
  if (edge.from < map_.kept() || !place_.database().holds(from.place, from.frame, from.epoch) ||
      !place_.database().holds(to.place, to.frame, to.epoch)) {
    return false;
  }
  out.old_stamp = from.stamp;
  out.new_stamp = to.stamp;
  out.T_old_new = edge.T_from_to;
  out.information = edge.information;
  out.matches.clear();
  const auto feature_of = [](const PlaceFeature& feature) {
    RevisitFeature result;
    result.has_track = feature.has_landmark;
    result.track = feature.landmark;
    result.seen[0] = true;
    result.pixel[0] = feature.pixel;
    return result;
  };
  for (const DescriptorMatch& match : inliers_[i]) {
    out.matches.push_back({feature_of(places_[from.place].features[match.old_feature]),
                           feature_of(places_[to.place].features[match.new_feature])});
  }
  return true;
}

}  // namespace swiftlet
