#include "mapping/loop/loop_stage.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/place/vocabulary.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {
namespace {

// A keyframe closer than this to the last node in all three shows nothing new.
constexpr double kNodeDistance = 0.25;  // m
constexpr double kNodeTurn = 0.2;       // rad
constexpr double kNodeSeconds = 2;
// A bridge over missed keyframes: the odometry's variance grows faster than in proportion to time.
constexpr double kBridgeInflation = 2;
// Added to a covariance when it is inverted: no relative pose is known better.
constexpr double kLeastSigma = 1e-5;          // rad, m
constexpr std::uint32_t kCliqueNodes = 2000;  // visited in a search: a few milliseconds

PoseGraphLimits graphLimits(const LoopLimits& limits) {
  PoseGraphLimits out;
  out.max_poses = limits.nodes;
  // Of loops that gave way to others the edges stay, without weight.
  out.max_edges = limits.nodes + 2 * limits.loops;
  return out;
}

LoopSelectionLimits selectionLimits(const LoopLimits& limits) {
  return {static_cast<std::uint32_t>(limits.nodes), static_cast<std::uint32_t>(limits.loops)};
}

PlaceDatabaseSettings databaseSettings(const LoopSettings& settings, const LoopLimits& limits) {
  PlaceDatabaseSettings out;
  out.keyframes = limits.nodes;
  out.min_relative = static_cast<float>(settings.min_similarity);
  return out;
}

LoopSelectionSettings selectionSettings(const LoopSettings& settings) {
  LoopSelectionSettings out = loopSelectionSettings<SE3>();
  if (!settings.consistency) {
    out.gate_chi_squared = std::numeric_limits<double>::max();
    out.pairwise = false;
  }
  return out;
}

Matrix6d informationOf(const Matrix6d& covariance) {
  const Matrix6d floored = covariance + kLeastSigma * kLeastSigma * Matrix6d::Identity();
  const Matrix6d inverse = floored.ldlt().solve(Matrix6d::Identity());
  return 0.5 * (inverse + inverse.transpose());
}

const WindowPose* poseOfFrame(const SmoothedWindow& window, std::uint64_t frame) {
  for (const WindowPose& pose : window.poses) {
    if (pose.frame_index == frame) return &pose;
  }
  return nullptr;
}

}  // namespace

LoopStage::LoopStage(const Rig& rig, const LoopSettings& settings, const LoopLimits& limits)
    : rig_(rig),
      limits_(limits),
      place_(rig.camera[0], Vocabulary::shipped(), {}, databaseSettings(settings, limits)),
      stereo_(rig.camera_count > 1 ? std::make_unique<StereoDepth>(rig) : nullptr),
      verifier_(rig),
      selection_(selectionLimits(limits), selectionSettings(settings)),
      optimizer_(graphLimits(limits)),
      places_(place_.database().capacity()),
      loops_(limits.loops) {
  nodes_.reserve(limits.nodes);
}

MapNode LoopStage::node(std::size_t i) const {
  return {nodes_[i].stamp, nodes_[i].epoch, optimizer_.graph().poses[i]};
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
    status = addNode(pose);
    if (!status.ok()) {
      ++counters_.refused;
    } else if (describePlace(input)) {
      closeLoops(effort, report);
      keepPlace();
    } else {
      ++counters_.without_image;
    }
  }
  optimize(effort, report);
  correct(*input.window);
  report.loops = selection_.held();
  report.selected = static_cast<std::uint32_t>(selection_.selected().size());
  report.correction = correction_;
  return status;
}

// The motion since the last node grows by the newest keyframe's.
void LoopStage::extendPending(const LoopInput& input) {
  const KeyframeLink& link = *input.link;
  if (nodes_.empty() || input.window->epoch != epoch_) pending_ = Pending{};
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
  if (!pending_.linked) return true;
  const double turn = 2 * std::acos(std::min(1.0, std::abs(pending_.T_node_this.rotation.w())));
  return pending_.T_node_this.translation.norm() > kNodeDistance || turn > kNodeTurn ||
         (now - nodes_.back().stamp).seconds() > kNodeSeconds;
}

Status LoopStage::addNode(const WindowPose& pose) {
  if (nodes_.size() >= limits_.nodes) {
    return {StatusCode::kCapacityReached, "the map has no room for more keyframes"};
  }
  Status status;
  if (pending_.linked) {
    RelativePose<SE3> edge;
    edge.from = static_cast<std::uint32_t>(nodes_.size() - 1);
    edge.to = edge.from + 1;
    edge.T_from_to = pending_.T_node_this;
    edge.information = informationOf(pending_.covariance);
    status = selection_.odometry().append(edge.T_from_to, pending_.covariance);
    if (status.ok()) status = optimizer_.addPose(optimizer_.graph().poses.back() * edge.T_from_to);
    if (status.ok()) status = optimizer_.addEdge(edge);
  } else {
    status = selection_.odometry().beginComponent();
    if (status.ok()) status = optimizer_.addPose(pose.T_world_body);
    ++counters_.components;
  }
  if (!status.ok()) return status;
  nodes_.push_back({pose.stamp, pose.frame_index, epoch_, pose.T_world_body, PlaceDatabase::kNoSlot});
  ++counters_.nodes;
  pending_ = Pending{};
  pending_.linked = true;
  pending_.frame = pose.frame_index;
  return status;
}

bool LoopStage::describePlace(const LoopInput& input) {
  if (input.image[0].empty()) return false;
  if (!place_.step(input.image[0], *input.tracks, epoch_, newest_, place_step_).ok()) return false;
  std::size_t found = 0;
  if (stereo_ && !input.image[1].empty()) {
    static_cast<void>(stereo_->fill(input.image[0], input.image[1], newest_, found));
  }
  static_cast<void>(landmarks_.fill(*input.window, rig_.T_body_cam[0], newest_, found));
  return true;
}

void LoopStage::closeLoops(const LoopEffort& effort, LoopReport& report) {
  const auto& candidates = place_step_.query.candidates;
  const std::size_t most = std::min({effort.candidates, kMaxLoopCandidates, candidates.size()});
  for (std::size_t i = 0; i < most; ++i) {
    // A second loop to the same place says little more.
    if (verify(candidates[i], effort, report)) return;
  }
}

bool LoopStage::verify(const PlaceCandidate& candidate, const LoopEffort& effort, LoopReport& report) {
  std::uint32_t from = 0;
  if (!findNode(candidate.index, candidate.epoch, from)) return false;
  static_cast<void>(
      verifier_.verify(places_[candidate.slot], newest_, {}, effort.verification, verification_));
  ++counters_.fates[static_cast<std::size_t>(verification_.fate)];
  LoopCandidate told;
  told.old_frame = candidate.index;
  told.old_stamp = candidate.stamp;
  told.fate = verification_.fate;
  told.matches = verification_.matches;
  told.inliers = verification_.inliers.size();
  told.similarity = static_cast<double>(candidate.relative);
  static_cast<void>(report.candidates.tryPushBack(told));
  return verification_.accepted() && addLoop(from);
}

bool LoopStage::addLoop(std::uint32_t from) {
  RelativePose<SE3> edge;
  edge.from = from;
  edge.to = static_cast<std::uint32_t>(nodes_.size() - 1);
  edge.T_from_to = verification_.T_old_new;
  edge.information = informationOf(verification_.covariance);
  if (optimizer_.graph().edges.size() >= limits_.nodes + 2 * limits_.loops) return false;
  std::uint32_t id = 0;
  if (!selection_.addLoop(edge, kCliqueNodes, id).ok()) return false;
  Loop& loop = loops_[id];
  if (loop.selected) static_cast<void>(optimizer_.setWeight(loop.number, 0));  // it has given way
  loop = Loop{edge, optimizer_.graph().edges.size(), false, nodes_[from].frame, verification_.inliers};
  static_cast<void>(optimizer_.addEdge(edge));
  static_cast<void>(optimizer_.setWeight(loop.number, 0));
  ++counters_.loops;
  weigh();
  return true;
}

// The selection's loops have their weight, the others none.
void LoopStage::weigh() {
  const auto selected = selection_.selected();
  auto next = selected.begin();
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    const bool chosen = next != selected.end() && *next == id;
    if (chosen) ++next;
    if (loops_[id].selected == chosen) continue;
    loops_[id].selected = chosen;
    static_cast<void>(optimizer_.setWeight(loops_[id].number, chosen ? 1 : 0));
    unsettled_ = true;
  }
  counters_.selected = selected.size();
}

// After the candidates have been looked at: the slot may have been one of theirs.
void LoopStage::keepPlace() {
  if (place_step_.slot == PlaceDatabase::kNoSlot) return;
  places_[place_step_.slot] = newest_;
  nodes_.back().slot = place_step_.slot;
}

void LoopStage::optimize(const LoopEffort& effort, LoopReport& report) {
  if (!unsettled_) return;
  OptimizeEffort work;
  work.iterations = effort.iterations;
  OptimizeReport result;
  const Status status = optimizer_.optimize(work, result);
  ++counters_.optimizations;
  unsettled_ = status.ok() && !result.converged;
  report.moved = status.ok();
}

void LoopStage::correct(const SmoothedWindow& window) {
  if (nodes_.empty()) return;
  const Node& node = nodes_.back();
  const WindowPose* now = poseOfFrame(window, node.frame);
  const SE3 T_world_node = now != nullptr ? now->T_world_body : node.T_world_body;
  correction_.epoch = node.epoch;
  correction_.T_map_world = optimizer_.graph().poses.back() * T_world_node.inverse();
  ++correction_.version;
}

bool LoopStage::findNode(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& node) const {
  const auto found = std::find_if(nodes_.begin(), nodes_.end(),
                                  [&](const Node& n) { return n.frame == frame && n.epoch == epoch; });
  node = static_cast<std::uint32_t>(found - nodes_.begin());
  return found != nodes_.end();
}

MapLoop LoopStage::loop(std::uint32_t i) const {
  const Loop& loop = loops_[i];
  const Matrix6d covariance = loop.edge.information.ldlt().solve(Matrix6d::Identity());
  MapLoop out;
  out.old_stamp = nodes_[loop.edge.from].stamp;
  out.new_stamp = nodes_[loop.edge.to].stamp;
  out.T_old_new = loop.edge.T_from_to;
  out.rotation_sigma = std::sqrt(covariance.diagonal().head<3>().maxCoeff());
  out.translation_sigma = std::sqrt(covariance.diagonal().tail<3>().maxCoeff());
  out.inliers = loop.inliers.size();
  out.verdict = selection_.verdict(i);
  return out;
}

bool LoopStage::revisit(std::uint32_t i, LoopRevisit& out) const {
  const Loop& loop = loops_[i];
  const Node& from = nodes_[loop.edge.from];
  const Node& to = nodes_[loop.edge.to];
  const bool kept = from.slot != PlaceDatabase::kNoSlot && to.slot != PlaceDatabase::kNoSlot &&
                    place_.database().holds(from.slot, from.frame, from.epoch) &&
                    place_.database().holds(to.slot, to.frame, to.epoch);
  if (!loop.selected || !kept) return false;
  out.old_stamp = from.stamp;
  out.new_stamp = to.stamp;
  out.T_old_new = loop.edge.T_from_to;
  out.information = loop.edge.information;
  out.matches.clear();
  const auto featureOf = [](const PlaceFeature& feature) {
    RevisitFeature result;
    result.has_track = feature.has_landmark;
    result.track = feature.landmark;
    result.seen[0] = true;
    result.pixel[0] = feature.pixel;
    return result;
  };
  for (const DescriptorMatch& match : loop.inliers) {
    out.matches.push_back({featureOf(places_[from.slot].features[match.old_feature]),
                           featureOf(places_[to.slot].features[match.new_feature])});
  }
  return true;
}

}  // namespace swiftlet
