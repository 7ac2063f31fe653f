#pragma once
// The stage of the thread `loop`: corrects the drift of the odometry by recognizing places seen before.
//
// A keyframe that has moved or turned enough since the last node becomes a node: a pose of the graph, joined
// to the node before by the odometry and, if its images are available, a place. Per step the stage describes
// the place, queries the database, verifies up to `effort.candidates` candidates by geometry, gives those
// that pass to the selection, and optimizes the graph (at most `effort.iterations`) while selection or poses
// still change.
//
// Near nodes. Words find the first revisit; once a loop is accepted, the map predicts further ones. Each node
// is then compared, once, with the two nearest older nodes of its piece within 2 m and 45 degrees, until one
// gives a loop. The newest node starts with the nearest and continues with similar places; if the nearest
// gave a loop, only with places elsewhere, so that a wrong map does not confirm itself. Candidates left in a
// step go to older nodes without a loop, the newest first. `min_similarity` thus decides about the first loop
// and hardly about later ones. A near candidate is verified and selected like any other.
//
// A kept map (kept_graph.hpp) taken in before the flight is its first piece, and the map frame is that of the
// kept map. Until loops join the flight to it, each node also tries candidates at other places after the
// first verified one, because loops to two similar places must both be known to the selection
// (loop_selection.hpp). Loops from the same view to the same view count once. MapCorrection::located holds
// while these loops are accepted, and ends where three more views contradict it, or fit another place as
// well, than only agree, however many agreed before. The loops are released if ten different views in a row
// near kept nodes are not recognized: a wrong location that nothing contradicts ends too.
//
// A piece that neither odometry nor loops join to others keeps its own world; an epoch of the odometry begins
// a piece. Frames: world is that of an epoch of the odometry, map that of the first piece. Errors:
// kInvalidInput (no window, tracks of another frame, a pose that is not finite): nothing changes. When full,
// each new node replaces one (loop_map.hpp), counted.
// Memory: reserved by the constructor for LoopLimits (38 kB a node). No clock; random seeds come from frame
// indices: same input, same bytes. docs/pose_graph.md, docs/place.md.

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
  std::size_t candidates = 2;  ///< verified per step, up to kMaxLoopCandidates
  double verification = 1;     ///< share of the samples that verification may draw
  int iterations = 3;          ///< of the optimizer
};

/// Number of older nodes near it in the map that a node is compared with.
inline constexpr std::size_t kMaxNearNodes = 2;

struct LoopInput {
  const TrackedFrame* tracks = nullptr;    ///< of the keyframe
  const SmoothedWindow* window = nullptr;  ///< its newest pose is that of the keyframe
  const KeyframeLink* link = nullptr;
  std::array<ImageView, kMaxCameras> image;  ///< raw; empty where missing
};

/// A verified loop and its verdict.
struct MapLoop {
  Stamp old_stamp;  ///< of the nodes that it joins now: neighbours of those that saw it if these were removed
  Stamp new_stamp;
  bool kept = false;  ///< the old node is of a kept map, its stamp of another clock
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
  SE3 T_world_body;  ///< of the odometry, or of the kept map, when it became a node
};

class LoopStage {
 public:
  /// `vocabulary` outlives the stage.
  LoopStage(const Rig& rig, const LoopSettings& settings, const LoopLimits& limits = {},
            const Vocabulary& vocabulary = Vocabulary::shipped());

  /// Loads an earlier map, before the first step. Its nodes need room in `limits` beside those of the flight.
  /// On kCapacityReached or kInvalidInput (not finite, loops between missing nodes) a part is loaded.
  /// Allocates only scratch; with KeptUse::kExtend it solves the graph.
  Status takeIn(const KeptGraph& kept, KeptUse use);
  /// Replaces a flight: adds the nodes and loops of another map as if it had been flown now. Its nodes need
  /// room too. Errors as takeIn().
  Status flyAgain(const KeptGraph& other, const LoopEffort& effort);
  /// After the flight: writes what later flights need. It covers everything joined to the kept map by
  /// odometry and loops, or without a kept map the joined pieces with most nodes. Returns its epochs
  /// (kKeptEpochs for a kept map). Allocates.
  std::vector<std::uint32_t> keep(KeptGraph& out);

  Status step(const LoopInput& input, const LoopEffort& effort, LoopReport& report);

  [[nodiscard]] const MapCorrection& correction() const { return correction_; }
  [[nodiscard]] LoopCounters counters() const;
  /// The first keptCount() nodes are of a kept map.
  [[nodiscard]] std::size_t nodeCount() const { return map_.size(); }
  [[nodiscard]] std::size_t keptCount() const { return map_.kept(); }
  [[nodiscard]] MapNode node(std::size_t i) const;
  /// The other epochs that loops join to this one, ascending; kKeptEpochs stands for a kept map.
  void tiedEpochs(std::uint32_t epoch, FixedVector<std::uint32_t, kTiedEpochs>& out) const;
  [[nodiscard]] std::uint32_t loopCount() const { return map_.loops(); }
  [[nodiscard]] MapLoop loop(std::uint32_t i) const;
  /// For full smoothing. False if loop i is not accepted or the keyframes that saw it were removed from the
  /// map. Allocates: for use after the flight.
  [[nodiscard]] bool revisit(std::uint32_t i, LoopRevisit& out) const;

 private:
  /// From the last node to the newest keyframe.
  struct Pending {
    bool linked = false;
    std::uint64_t frame = 0;  ///< index of the newest keyframe
    SE3 T_node_this;
    Matrix6d covariance = Matrix6d::Zero();
  };

  /// Comparisons made for a node.
  struct Comparisons {
    FixedVector<std::uint64_t, kMaxLoopCandidates + kMaxNearNodes> frames;
    std::size_t near_left = kMaxNearNodes;  ///< remaining comparisons with near nodes
  };

  /// What the loops of a node say about the location.
  struct Evidence {
    bool agrees = false;
    bool contradicts = false;
    bool repeats = false;  ///< what an earlier view contradicted already
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
  void checkLocation(std::uint32_t to, double view, bool seen);
  void weighLocation();
  [[nodiscard]] bool agrees(std::uint32_t id) const;
  [[nodiscard]] bool isRepeated(std::uint32_t from, std::uint32_t to) const;
  [[nodiscard]] bool isSkipped(std::uint32_t from, std::uint32_t to) const;
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
  std::vector<Comparisons> comparisons_;    ///< by the database's slots
  std::vector<DescriptorMatches> inliers_;  ///< by the map's loop ids
  std::uint32_t epoch_ = 0;
  std::uint32_t newest_loop_ = 0;  ///< id
  int missed_ = 0;                 ///< views in a row that a location predicts and that were not recognized
  SE3 missed_at_;                  ///< the last of them, in the odometry's world
  Evidence evidence_;              ///< of the newest node
  int against_ = 0;                ///< recent views that contradict the location, less those that agree
  Pending pending_;
  PlaceKeyframe newest_;
  PlaceStep place_step_;
  LoopVerification verification_;
  MapCorrection correction_;
  LoopCounters counters_;
};

}  // namespace swiftlet
