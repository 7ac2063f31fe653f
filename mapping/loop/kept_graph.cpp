#include "mapping/loop/kept_graph.hpp"

#include <algorithm>

#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {
namespace {

constexpr int kIterations = 100;  // per call of settle(), when a graph is extended

/// Converts data of another vehicle's body to this vehicle's body at the same camera pose.
struct OwnBody {
  SE3 T_theirs_ours;

  [[nodiscard]] SE3 relative(const SE3& T) const { return T_theirs_ours.inverse() * T * T_theirs_ours; }
  [[nodiscard]] PoseMatrix<SE3> covariance(const PoseMatrix<SE3>& theirs) const {
    const PoseMatrix<SE3> turn = poseAdjoint(T_theirs_ours.inverse());
    return turn * theirs * turn.transpose();
  }
  [[nodiscard]] LoopMap::Node node(const KeptNode& theirs) const {
    LoopMap::Node out;
    out.stamp = theirs.stamp;
    out.place = PlaceDatabase::kNoSlot;
    out.T_world_body = theirs.T_map_body * T_theirs_ours;
    out.tilt = tilt(theirs.tilt);
    return out;
  }
  [[nodiscard]] LoopMap::Link link(const KeptNode& theirs) const {
    return {relative(theirs.T_previous_this), covariance(theirs.covariance)};
  }
  [[nodiscard]] Tilt tilt(const Tilt& theirs) const {
    const Eigen::Matrix3d R = T_theirs_ours.R().transpose();
    return {R * theirs.up_body, R * theirs.covariance * R.transpose()};
  }
};

}  // namespace

Status LoopStage::takeIn(const KeptGraph& kept, KeptUse use) {
  const OwnBody own{kept.T_body_cam * rig_.T_body_cam[0].inverse()};
  const bool held = use == KeptUse::kLocalize;
  std::uint32_t piece = 0;
  for (const KeptNode& from : kept.nodes) {
    LoopMap::Node node = own.node(from);
    // A held map is one piece, even if only loops joined its parts when it was made.
    const bool first = map_.kept() == 0;
    const bool linked = !first && (held || from.linked);
    piece += !first && !from.linked ? 1 : 0;
    node.frame = kKeptFrames + map_.kept();
    node.epoch = kKeptEpochs + piece;
    LoopMap::Link link = own.link(from);
    if (linked && held) link.T_previous_this = map_.pose(map_.kept() - 1).inverse() * node.T_world_body;
    if (const Status status = map_.addKept(node, linked ? &link : nullptr, held); !status.ok()) return status;
    if (from.features.empty()) continue;
    loadFeatures(from, node);
    static_cast<void>(place_.keep(newest_, place_step_));  // if refused, the node has no place
    keepPlace();
    // Its own flight compared it with near nodes.
    if (place_step_.slot != PlaceDatabase::kNoSlot) comparisons_[place_step_.slot].near_left = 0;
  }
  for (const KeptLoop& loop : kept.loops) {
    if (held) break;
    if (const Status status = addKeptLoop(loop, 0, own.T_theirs_ours); !status.ok()) return status;
  }
  return settleWhole();
}

Status LoopStage::flyAgain(const KeptGraph& other, const LoopEffort& effort) {
  const OwnBody own{other.T_body_cam * rig_.T_body_cam[0].inverse()};
  const auto first = static_cast<std::uint32_t>(map_.size());
  std::vector<KeptLoop> loops = other.loops;
  std::stable_sort(loops.begin(), loops.end(),
                   [](const KeptLoop& a, const KeptLoop& b) { return a.to < b.to; });
  auto loop = loops.begin();
  for (const KeptNode& from : other.nodes) {
    LoopMap::Node node = own.node(from);
    const auto number = static_cast<std::uint32_t>(map_.size()) - first;
    const bool linked = number > 0 && from.linked;
    epoch_ += number > 0 && !linked ? 1 : 0;
    node.frame = number;
    node.epoch = epoch_;
    const LoopMap::Link link = own.link(from);
    if (const Status status = map_.add(node, linked ? &link : nullptr); !status.ok()) return status;
    for (; loop != loops.end() && loop->to == number; ++loop) {
      if (const Status status = addKeptLoop(*loop, first, own.T_theirs_ours); !status.ok()) return status;
    }
    LoopReport report;
    if (!from.features.empty()) {
      loadFeatures(from, node);
      if (place_.step(newest_, place_step_).ok()) {
        keepPlace();
        closeLoops(effort, report);
      }
    }
    closeNearLoops(effort, report);
    if (const Status status = map_.settle(effort.iterations, report.moved); !status.ok()) return status;
  }
  return settleWhole();
}

/// Loads a kept node's features into newest_.
void LoopStage::loadFeatures(const KeptNode& from, const LoopMap::Node& node) {
  newest_.index = node.frame;
  newest_.stamp = node.stamp;
  newest_.epoch = node.epoch;
  newest_.features.clear();
  for (const PlaceFeature& feature : from.features) static_cast<void>(newest_.features.tryPushBack(feature));
}

Status LoopStage::addKeptLoop(const KeptLoop& loop, std::uint32_t first_node, const SE3& T_theirs_ours) {
  const OwnBody own{T_theirs_ours};
  std::uint32_t id = 0;
  const Status status = map_.addLoop(first_node + loop.from, first_node + loop.to,
                                     own.relative(loop.T_from_to), own.covariance(loop.covariance), id);
  if (status.ok()) inliers_[id].clear();
  return status;
}

Status LoopStage::settleWhole() {
  for (bool moved = false; !map_.atRest();) {
    if (const Status status = map_.settle(kIterations, moved); !status.ok()) return status;
  }
  return okStatus();
}

/// The first node of the joined pieces with most nodes.
std::uint32_t LoopStage::largestPiece() const {
  std::uint32_t best = 0;
  std::size_t most = 0;
  for (std::uint32_t k = 0; k < map_.size(); ++k) {
    if (k > 0 && map_.joined(0, k)) continue;
    std::size_t count = 0;
    for (std::uint32_t other = k; other < map_.size(); ++other) count += map_.joined(k, other) ? 1 : 0;
    if (count <= most) continue;
    most = count;
    best = k;
  }
  return best;
}

std::vector<std::uint32_t> LoopStage::keep(KeptGraph& out) {
  out = {};
  out.camera = rig_.camera[0];
  out.T_body_cam = rig_.T_body_cam[0];
  std::vector<std::uint32_t> epochs;
  if (map_.size() == 0) return epochs;
  constexpr std::uint32_t kLeftOut = 0xffffffffU;
  const std::uint32_t piece = map_.kept() > 0 ? 0 : largestPiece();
  std::vector<std::uint32_t> number(map_.size(), kLeftOut);
  std::uint32_t before = kLeftOut;
  for (std::uint32_t k = 0; k < map_.size(); ++k) {
    if (!map_.joined(piece, k)) continue;
    number[k] = static_cast<std::uint32_t>(out.nodes.size());
    const LoopMap::Node& node = map_.node(k);
    const std::uint32_t epoch = std::min(node.epoch, kKeptEpochs);
    if (std::ranges::find(epochs, epoch) == epochs.end()) epochs.push_back(epoch);
    KeptNode& kept = out.nodes.emplace_back();
    kept.stamp = node.stamp;
    kept.T_map_body = map_.pose(k);
    kept.tilt = node.tilt;
    if (before != kLeftOut && map_.linked(k)) {
      kept.linked = true;
      kept.T_previous_this = map_.graph().odometry().relative(before, k);
      kept.covariance = map_.graph().odometry().covariance(before, k);
    } else if (before != kLeftOut) {
      kept.T_previous_this = map_.pose(before).inverse() * map_.pose(k);
      if (!map_.relativeCovariance(before, k, kept.covariance).ok()) kept.covariance.setIdentity();
    }
    before = k;
    if (!hasPlace(k)) continue;
    const auto& features = places_[node.place].features;
    kept.features.assign(features.begin(), features.end());
    for (PlaceFeature& feature : kept.features) feature.has_landmark = false;
  }
  for (std::uint32_t id = 0; id < map_.loops(); ++id) {
    const RelativePose<SE3>& edge = map_.loopEdge(id);
    if (!map_.selected(id) || number[edge.from] == kLeftOut) continue;
    out.loops.push_back(
        {number[edge.from], number[edge.to], edge.T_from_to, covarianceFromInformation(edge.information)});
  }
  return epochs;
}

}  // namespace swiftlet
