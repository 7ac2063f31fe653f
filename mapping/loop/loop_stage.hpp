#pragma once
// The stage of the thread `loop`: keyframes to a map that places seen again hold together.
//
// A keyframe that has moved or turned enough since the last one kept becomes a node: a pose of the graph,
// tied to the node before by the odometry's relative pose, and, where its images are at hand, a place. Per
// step: describe the place, ask the database for places alike, verify up to `effort.candidates` of them by
// geometry, give those that pass to the selection, and optimize the graph (at most `effort.iterations`) while
// the selected set, or the poses, still change.
//
// Near nodes. Words find a place that nothing else leads to; once a loop is selected, the map leads too. Each
// node is then compared, once in its life, with the two nearest of the older nodes of its piece that the map
// has within 2 m and 45 degrees of it, until one gives a loop. The newest node begins with the nearest and
// goes on with places alike; where the nearest gave a loop, with those only that lead elsewhere, lest a map
// gone wrong be asked about itself alone. What a step has left of its candidates goes to older nodes that
// have no loop yet, the newest first. So how strict the words are asked decides which loop is the first,
// hardly which come after it. A near candidate is verified and selected as any other.
//
// A kept map (kept_graph.hpp) taken in before the flight is its first piece, and the map's frame that of the
// kept one. Until loops tie the flight to it, each node asks its candidates further after the first that
// geometry verifies, at places elsewhere: two that look the same must both be heard (loop_selection.hpp).
// From then on MapCorrection::located holds, for as long as these loops are believed.
//
// Every piece that neither odometry nor loops join keeps its own world; an epoch of the odometry begins a
// piece. Frames: world is the odometry's of an epoch, map that of the first piece. Errors: kInvalidInput (no
// window, tracks of another frame, a pose that is not finite): nothing changes. Full: a node leaves for each
// new one (loop_map.hpp), counted.
// Memory: reserved by the constructor for LoopLimits (38 kB a node). No clock, no randomness but seeds from
// frame indices: same input, same bytes. docs/pose_graph.md, docs/place.md.

#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/keyframe_link.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "mapping/loop/kept_graph.hpp"
#include "mapping/loop/loop_map.hpp"
#include "mapping/loop/loop_report.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/place/feature_depth.hpp"
#include "mapping/place/place_stage.hpp"

namespace swiftlet {

struct LoopEffort {
  std::size_t candidates = 2;  ///< verified in a step, up to kMaxLoopCandidates
  double verification = 1;     ///< part of the samples that verification may draw
  int iterations = 3;          ///< of the optimizer
};

/// Older nodes that a node is compared with because the map has them near it.
inline constexpr std::size_t kMaxNearNodes = 2;

struct LoopInput {
  const TrackedFrame* tracks = nullptr;    ///< of the keyframe
  const SmoothedWindow* window = nullptr;  ///< whose newest pose is the keyframe's
  const KeyframeLink* link = nullptr;
  std::array<ImageView, kMaxCameras> image;  ///< raw; empty where missing
};

/// A verified loop, and what the selection says of it.
struct MapLoop {
  Stamp old_stamp;  ///< of the nodes that it joins now: neighbours of those that saw it, when these had to go
  Stamp new_stamp;
  bool kept = false;  ///< the old node is of a kept map: its stamp is of another clock
  SE3 T_old_new;
  double rotation_sigma = 0;     ///< rad, of the worst direction
  double translation_sigma = 0;  ///< m
  std::size_t inliers = 0;
  LoopVerdict verdict = LoopVerdict::kSelected;
};

/// A keyframe in the map.
struct MapNode {
  Stamp stamp;
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;  ///< kKeptEpochs: of a kept map
  SE3 T_map_body;
  SE3 T_world_body;  ///< as the odometry, or the kept map, had it when it became a node
};

class LoopStage {
 public:
  /// `vocabulary` outlives the stage.
  LoopStage(const Rig& rig, const LoopSettings& settings, const LoopLimits& limits = {},
            const Vocabulary& vocabulary = Vocabulary::shipped());

  /// Before the first step: an earlier map. Its nodes need room in `limits` beside those of the flight.
  /// kCapacityReached, kInvalidInput (not finite, loops between nodes that are not there): a part is taken
  /// in. Allocates nothing but scratch; solves the graph that is extended.
  Status takeIn(const KeptGraph& kept, KeptUse use);
  /// In place of a flight: what another map holds, as if it had been flown now. Its nodes need room too.
  /// Errors as takeIn().
  Status flyAgain(const KeptGraph& other, const LoopEffort& effort);
  /// After the flight: what later ones need. Of all that odometry and loops hold together with the kept map,
  /// or without one with most nodes. Gives the epochs in it, kKeptEpochs for a kept map. Allocates.
  std::vector<std::uint32_t> keep(KeptGraph& out);

  Status step(const LoopInput& input, const LoopEffort& effort, LoopReport& report);

  [[nodiscard]] const MapCorrection& correction() const { return correction_; }
  [[nodiscard]] LoopCounters counters() const;
  /// The first keptCount() of them are of a kept map.
  [[nodiscard]] std::size_t nodeCount() const { return map_.size(); }
  [[nodiscard]] std::size_t keptCount() const { return map_.kept(); }
  [[nodiscard]] MapNode node(std::size_t i) const;
  /// The other epochs whose worlds loops hold in the same map, ascending; kKeptEpochs: a kept map.
  void tiedEpochs(std::uint32_t epoch, FixedVector<std::uint32_t, kTiedEpochs>& out) const;
  [[nodiscard]] std::uint32_t loopCount() const { return map_.loops(); }
  [[nodiscard]] MapLoop loop(std::uint32_t i) const;
  /// For full smoothing. False where loop i is not selected, or the keyframes that saw it are not in the map
  /// any more. Allocates: after the flight.
  [[nodiscard]] bool revisit(std::uint32_t i, LoopRevisit& out) const;

 private:
  /// From the last node to the newest keyframe.
  struct Pending {
    bool linked = false;
    std::uint64_t frame = 0;  ///< index of the newest keyframe
    SE3 T_node_this;
    Matrix6d covariance = Matrix6d::Zero();
  };

  /// What a node was compared with.
  struct Comparisons {
    FixedVector<std::uint64_t, kMaxLoopCandidates + kMaxNearNodes> frames;
    std::size_t near_left = kMaxNearNodes;  ///< comparisons with near nodes still to make
  };

  void extendPending(const LoopInput& input);
  void bridge(const LoopInput& input);
  void appendLink(const SE3& T_previous_this, const Matrix6d& covariance);
  [[nodiscard]] bool movedEnough(Stamp now) const;
  Status addNode(const SmoothedWindow& window);
  void loadFeatures(const KeptNode& from, const LoopMap::Node& node);
  Status addKeptLoop(const KeptLoop& loop, std::uint32_t first_node, const SE3& T_theirs_ours);
  Status settleWhole();
  [[nodiscard]] bool located(std::uint32_t k) const { return map_.kept() > 0 && map_.joined(0, k); }
  [[nodiscard]] std::uint32_t largestPiece() const;
  [[nodiscard]] bool describePlace(const LoopInput& input);
  void moveToMiddleRow(const ScanMotion& motion);
  void closeLoops(const LoopEffort& effort, LoopReport& report);
  void keepPlace();
  void closeNearLoops(const LoopEffort& effort, LoopReport& report);
  [[nodiscard]] bool hasPlace(std::uint32_t k) const;
  [[nodiscard]] bool nearestNode(std::uint32_t to, std::uint32_t& from) const;
  [[nodiscard]] bool compareNearest(std::uint32_t to, const LoopEffort& effort, LoopReport& report);
  [[nodiscard]] double view(std::uint32_t a, std::uint32_t b) const;
  [[nodiscard]] bool verify(std::uint32_t from, std::uint32_t to, LoopCandidate& told,
                            const LoopEffort& effort, LoopReport& report);
  void correct(const SmoothedWindow& window);

  Rig rig_;
  PlaceStage place_;
  std::unique_ptr<StereoDepth> stereo_;  ///< null with one camera
  LandmarkDepth landmarks_;
  LoopVerifier verifier_;
  LoopMap map_;

  std::vector<PlaceKeyframe> places_;       ///< by the database's slots
  std::vector<Comparisons> comparisons_;    ///< likewise
  std::vector<DescriptorMatches> inliers_;  ///< by the map's loops
  std::uint32_t epoch_ = 0;
  Pending pending_;
  PlaceKeyframe newest_;
  PlaceStep place_step_;
  LoopVerification verification_;
  MapCorrection correction_;
  LoopCounters counters_;
};

}  // namespace swiftlet
