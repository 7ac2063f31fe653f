// The map of nodes and loops alone: long flights in little room, loops that are asked again.

#include "mapping/loop/loop_map.hpp"

#include <malloc.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "mapping/place/relative_pose.hpp"

using namespace swiftlet;

namespace {

constexpr double kSecondsANode = 0.5;
constexpr double kOdometryTurn = 2e-3;  // rad, 1 sigma of a step
constexpr double kOdometryMove = 5e-3;  // m
constexpr double kLoopTurn = 2e-3;      // rad
constexpr double kLoopMove = 1e-2;      // m

Vector6d draw(Random& random, double turn, double move) {
  Vector6d xi;
  for (int i = 0; i < 3; ++i) xi[i] = turn * random.normal();
  for (int i = 3; i < 6; ++i) xi[i] = move * random.normal();
  return xi;
}

Matrix6d covarianceOf(double turn, double move) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(turn), Eigen::Vector3d::Constant(move);
  return sigma.cwiseAbs2().asDiagonal();
}

/// A drone that wanders through a room of 10 m and recognizes places of its map within 1 m.
class Wanderer {
 public:
  Wanderer(const LoopLimits& limits, std::uint64_t seed, const LoopSettings& settings = {})
      : map(std::make_unique<LoopMap>(settings, limits)), random_(seed) {}

  void fly(int nodes, bool with_loops = true) {
    for (int i = 0; i < nodes; ++i) step(with_loops);
  }

  /// The next node, by the odometry.
  void step(bool with_loops = true) {
    const SE3 before = T_truth_;
    wander();
    LoopMap::Node node;
    node.stamp = Stamp{} + Duration::fromSeconds(kSecondsANode * static_cast<double>(truth_.size()));
    node.frame = truth_.size() + 1;
    const SE3 moved = before.inverse() * T_truth_;
    const LoopMap::Link link{moved * poseExp(draw(random_, kOdometryTurn, kOdometryMove)),
                             covarianceOf(kOdometryTurn, kOdometryMove)};
    const bool linked = !truth_.empty();
    T_world_ = linked ? T_world_ * link.T_previous_this : T_truth_;
    node.T_world_body = T_world_;
    odometry_.push_back(T_world_);
    truth_.push_back(T_truth_);
    if (map->full()) {
      LoopMap::Node left;
      REQUIRE(map->makeRoom(left));
      REQUIRE(left.frame < node.frame - 1);  // never the newest
    }
    REQUIRE(map->add(node, linked ? &link : nullptr).ok());
    if (with_loops && truth_.size() % 3 == 0) recognize();
    bool moved_map = false;
    static_cast<void>(map->settle(3, moved_map));
    settled_moves_ += moved_map ? 1 : 0;
  }

  /// A loop from the node nearest to here that is old enough.
  void recognize() {
    std::uint32_t from = 0;
    double nearest = 1;  // m
    for (std::uint32_t k = 0; k + 30 < map->size(); ++k) {
      const double distance = (truthOf(k).translation - T_truth_.translation).norm();
      if (distance < nearest) {
        nearest = distance;
        from = k;
      }
    }
    if (nearest < 1) addLoop(from, truthOf(from).inverse() * T_truth_);
  }

  void addLoop(std::uint32_t from, const SE3& T_from_newest) {
    std::uint32_t id = 0;
    const SE3 measured = T_from_newest * poseExp(draw(random_, kLoopTurn, kLoopMove));
    REQUIRE(map->addLoop(from, static_cast<std::uint32_t>(map->size() - 1), measured,
                         covarianceOf(kLoopTurn, kLoopMove), id)
                .ok());
  }

  [[nodiscard]] const SE3& truthOf(std::size_t node) const { return truth_[map->node(node).frame - 1]; }

  /// m, RMSE of the map's nodes, or of the odometry at the same nodes, rigidly aligned to the truth.
  [[nodiscard]] double error(bool of_odometry = false) const {
    const auto n = static_cast<Eigen::Index>(map->size());
    Eigen::Matrix3Xd found(3, n);
    Eigen::Matrix3Xd truth(3, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      found.col(i) = of_odometry ? odometry_[map->node(k).frame - 1].translation : map->pose(k).translation;
      truth.col(i) = truthOf(k).translation;
    }
    const Eigen::Matrix4d T = Eigen::umeyama(found, truth, false);
    const Eigen::Matrix3Xd aligned = (T.topLeftCorner<3, 3>() * found).colwise() + T.topRightCorner<3, 1>();
    return std::sqrt((aligned - truth).colwise().squaredNorm().mean());
  }

  std::unique_ptr<LoopMap> map;

 private:
  // Towards one random corner of the room after the other, 0.3 m a node.
  void wander() {
    const Eigen::Vector3d to = goal_ - T_truth_.translation;
    if (to.norm() < 0.5) {
      goal_ = Eigen::Vector3d(random_.uniform(-5, 5), random_.uniform(-5, 5), random_.uniform(0, 3));
    }
    const Eigen::Vector3d way = (goal_ - T_truth_.translation).normalized();
    T_truth_.translation += 0.3 * way;
    T_truth_.rotation = expSo3(Eigen::Vector3d(0, 0, std::atan2(way.y(), way.x())));
  }

  Random random_;
  Eigen::Vector3d goal_ = Eigen::Vector3d(4, 3, 1);
  SE3 T_truth_;
  SE3 T_world_;
  std::vector<SE3> truth_;
  std::vector<SE3> odometry_;
  int settled_moves_ = 0;
};

}  // namespace

TEST_CASE("a long flight in little room stays as right as one with room for all") {
  constexpr int kNodes = 3000;  // 25 minutes
  Wanderer small({60, 60}, 5);
  small.fly(1500);
  const std::size_t early = mallinfo2().uordblks;
  const double halfway = small.error();
  small.fly(kNodes - 1500);
  // What is left of the second half: the wanderer's own record of the truth, no more.
  const std::size_t late = mallinfo2().uordblks;
  CHECK(late < early + std::size_t{kNodes} * 4 * sizeof(SE3));
  CHECK(small.map->size() == 60);
  CHECK(small.map->loops() <= 60);
  const LoopMapCounters counters = small.map->counters();
  CHECK(counters.nodes_removed == kNodes - 60);
  CHECK(counters.loops_carried > 100);
  CHECK(counters.loops_released > 100);
  CHECK(small.map->selected() > 30);

  Wanderer large({kNodes, kNodes}, 5);
  large.fly(kNodes / 3);
  INFO("small " << halfway << " and " << small.error() << ", odometry " << small.error(true) << ", large "
                << large.error());
  CHECK(large.map->counters().nodes_removed == 0);
  CHECK(large.error() < 0.02);
  CHECK(small.error() < 0.05);
  CHECK(small.error(true) > 5 * small.error());  // or the test shows nothing
}

TEST_CASE("taking away nodes that only the odometry holds leaves the others where they are") {
  constexpr int kRemoved = 60;
  Wanderer thinned({200, 50}, 7);
  Wanderer whole({200, 50}, 7);
  thinned.fly(199);
  whole.fly(199);
  REQUIRE(thinned.map->selected() > 5);
  std::vector<std::uint64_t> gone;
  for (int i = 0; i < kRemoved; ++i) {
    LoopMap::Node left;
    REQUIRE(thinned.map->makeRoom(left));
    gone.push_back(left.frame);
  }
  REQUIRE(thinned.map->counters().loops_carried == 0);
  CHECK(thinned.map->selected() == whole.map->selected());
  // The same loop moves both alike.
  std::uint32_t from = 0;
  REQUIRE(whole.map->find(thinned.map->node(3).frame, 0, from));
  const SE3 T_from_newest = whole.truthOf(from).inverse() * whole.truthOf(whole.map->size() - 1);
  const SE3 before = thinned.map->pose(thinned.map->size() - 1);
  thinned.addLoop(3, T_from_newest);
  whole.addLoop(from, T_from_newest);
  bool moved = false;
  for (int i = 0; i < 20; ++i) {
    static_cast<void>(thinned.map->settle(10, moved));
    static_cast<void>(whole.map->settle(10, moved));
  }
  CHECK((thinned.map->pose(thinned.map->size() - 1).translation - before.translation).norm() > 2e-3);
  std::size_t compared = 0;
  for (std::uint32_t k = 0; k < thinned.map->size(); ++k) {
    std::uint32_t same = 0;
    REQUIRE(whole.map->find(thinned.map->node(k).frame, 0, same));
    CHECK((thinned.map->pose(k).translation - whole.map->pose(same).translation).norm() < 1e-3);
    ++compared;
  }
  CHECK(compared == 199 - kRemoved);
}

TEST_CASE("a loop that the odometry spoke against comes back when the map has become better") {
  // Straight ahead; the odometry drifts by 12 mm a step and believes 10 mm, 1 sigma, at random.
  constexpr int kSteps = 40;
  constexpr int kLoose = 20;
  LoopMap map({}, {100, 40});
  std::uint64_t frame = 0;
  const auto add = [&](double ahead, double drift, double sigma) {
    LoopMap::Node node;
    node.frame = ++frame;
    node.stamp = Stamp{} + Duration::fromSeconds(static_cast<double>(frame));
    LoopMap::Link link;
    link.T_previous_this.translation.x() = ahead + drift;
    link.covariance = covarianceOf(1e-4, sigma);
    REQUIRE(map.add(node, frame > 1 ? &link : nullptr).ok());
  };
  const auto loopTo = [&](std::uint32_t from, double x, double sigma) {
    std::uint32_t id = 0;
    SE3 T;
    T.translation.x() = x - 0.5 * from;
    REQUIRE(
        map.addLoop(from, static_cast<std::uint32_t>(map.size() - 1), T, covarianceOf(1e-3, sigma), id).ok());
    return id;
  };
  for (int i = 0; i <= kSteps; ++i) add(0.5, 0.012, 0.01);
  const double end = 0.5 * kSteps;
  const std::uint32_t right = loopTo(0, end, 2e-3);
  const std::uint32_t wrong = loopTo(1, end + 3, 2e-3);
  CHECK(map.graph().verdict(right) == LoopVerdict::kAgainstOdometry);
  CHECK(map.graph().verdict(wrong) == LoopVerdict::kAgainstOdometry);
  bool moved = false;
  static_cast<void>(map.settle(10, moved));
  CHECK(map.counters().graph.taken_back == 0);
  // Loops that know less pass, and together make the map better.
  for (std::uint32_t i = 0; i < kLoose; ++i) {
    add(0, 0, 1e-4);
    loopTo(i / 2, end, 0.12);
    static_cast<void>(map.settle(10, moved));
  }
  for (int i = 0; i < 10; ++i) static_cast<void>(map.settle(10, moved));
  CHECK(map.graph().verdict(right) == LoopVerdict::kSelected);
  CHECK(map.graph().verdict(wrong) == LoopVerdict::kAgainstOdometry);
  CHECK(map.counters().graph.taken_back >= 1);
  CHECK(map.selected() == kLoose + 1);
  const std::uint64_t asked = map.counters().graph.reconsidered;
  for (int i = 0; i < 10; ++i) static_cast<void>(map.settle(10, moved));
  CHECK(map.counters().graph.reconsidered == asked);  // at rest nobody is asked twice
}

namespace {

/// What a LoopMap must hold, kept without cleverness: nodes by their frames, loops by the frames at their
/// ends.
class PlainMap {
 public:
  void add(std::uint64_t frame) { frames_.push_back(frame); }
  void remove(std::uint64_t frame) {
    const auto at = std::find(frames_.begin(), frames_.end(), frame);
    REQUIRE(at != frames_.end());
    frames_.erase(at);
  }
  void addLoop(std::uint32_t id, std::uint64_t from, std::uint64_t to) {
    if (id >= loops_.size()) loops_.resize(id + 1);
    loops_[id] = {from, to};
  }

  /// Every loop that was not given up joins the nodes that it was found between or, where these are gone,
  /// others; every one that is believed is an edge of the graph.
  void check(const LoopMap& map) {
    REQUIRE(map.size() == frames_.size());
    const PoseGraph<SE3>& graph = map.graph().graph();
    REQUIRE(graph.poses.size() == frames_.size());
    std::size_t links = 0;
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      REQUIRE(map.node(k).frame == frames_[k]);
      links += map.linked(static_cast<std::uint32_t>(k)) ? 1 : 0;
    }
    std::size_t edges = 0, selected = 0;
    for (std::uint32_t id = 0; id < map.loops(); ++id) {
      if (map.graph().verdict(id) == LoopVerdict::kReleased) {
        REQUIRE_FALSE(map.selected(id));
        continue;
      }
      selected += map.selected(id) ? 1 : 0;
      const RelativePose<SE3>& loop = map.loopEdge(id);
      REQUIRE(loop.from != loop.to);
      REQUIRE(std::max(loop.from, loop.to) < frames_.size());
      follow(frames_[loop.from], loops_[id].from);
      follow(frames_[loop.to], loops_[id].to);
      const std::optional<double> weight = map.graph().weight(id);
      if (!weight.has_value()) {
        REQUIRE_FALSE(map.selected(id));
        continue;
      }
      // Between the two: while graduated weights are at work.
      REQUIRE((map.atRest() ? *weight == (map.selected(id) ? 1 : 0) : *weight <= 1));
      ++edges;
      const auto same = [&](const RelativePose<SE3>& edge) {
        return edge.from == loop.from && edge.to == loop.to &&
               edge.T_from_to.translation == loop.T_from_to.translation;
      };
      REQUIRE(std::count_if(graph.edges.begin(), graph.edges.end(), same) >= 1);
    }
    REQUIRE(map.selected() == selected);
    REQUIRE(graph.edges.size() >= links + edges);
  }

 private:
  /// A loop's end stays as long as its node does.
  void follow(std::uint64_t found, std::uint64_t& kept) const {
    if (std::find(frames_.begin(), frames_.end(), kept) != frames_.end()) REQUIRE(found == kept);
    kept = found;
  }

  std::vector<std::uint64_t> frames_;
  struct Ends {
    std::uint64_t from = 0, to = 0;  ///< frames; those of neighbours once theirs are gone
  };
  std::vector<Ends> loops_;
};

}  // namespace

TEST_CASE("ten thousand random operations lose no loop") {
  for (const bool consistency : {false, true}) {
    LoopSettings settings;
    settings.consistency = consistency;
    const LoopLimits limits{40, 25};
    LoopMap map(settings, limits);
    PlainMap plain;
    Random random(consistency ? 61 : 60);
    std::uint64_t frame = 0;
    std::size_t added = 0;
    constexpr int kOperations = 5000;
    for (int i = 0; i < kOperations; ++i) {
      const double what = random.uniform(0, 1);
      if (what < 0.3 || map.size() < 3) {
        LoopMap::Node left;
        if (map.full() && map.makeRoom(left)) plain.remove(left.frame);
        LoopMap::Node node;
        node.frame = ++frame;
        node.stamp = Stamp{} + Duration::fromSeconds(0.5 * static_cast<double>(frame));
        const LoopMap::Link link{poseExp(draw(random, 0.1, 0.2)), covarianceOf(kOdometryTurn, kOdometryMove)};
        const bool linked = random.uniform(0, 1) < 0.97;
        node.T_world_body = poseExp(draw(random, 0.1, 2));
        REQUIRE(map.add(node, linked ? &link : nullptr).ok());
        plain.add(frame);
      } else if (what < 0.4) {
        LoopMap::Node left;
        if (map.makeRoom(left)) plain.remove(left.frame);
      } else if (what < 0.8) {
        const auto to = static_cast<std::uint32_t>(random.uniform(1, static_cast<double>(map.size()) - 1e-9));
        // Next to each other, too.
        const auto from =
            random.uniform(0, 1) < 0.3 ? to - 1 : static_cast<std::uint32_t>(random.uniform(0, to - 1e-9));
        const SE3 truth = map.pose(from).inverse() * map.pose(to);
        const SE3 measured = random.uniform(0, 1) < 0.7 ? truth * poseExp(draw(random, kLoopTurn, kLoopMove))
                                                        : poseExp(draw(random, 1, 3));
        std::uint32_t id = 0;
        const Status status = map.addLoop(from, to, measured, covarianceOf(kLoopTurn, kLoopMove), id);
        REQUIRE(status.ok());
        plain.addLoop(id, map.node(from).frame, map.node(to).frame);
        ++added;
      } else {
        bool moved = false;
        static_cast<void>(map.settle(2, moved));
      }
      plain.check(map);
    }
    CHECK(added > std::size_t{kOperations} / 4);
    CHECK(map.counters().loops_released > 50);
    CHECK(map.counters().loops_carried > 20);
  }
}

TEST_CASE("ties that are taken back leave those that contradicted them") {
  LoopMap map({}, {60, 40});
  constexpr std::uint32_t kPiece = 20;  // nodes
  std::vector<SE3> truth;
  for (std::uint32_t k = 0; k < 2 * kPiece; ++k) {
    const double angle = 0.1 * (k % kPiece);
    truth.emplace_back(expSo3(Eigen::Vector3d(0, 0, angle)),
                       Eigen::Vector3d(3 * std::sin(angle), 3 - 3 * std::cos(angle), 0));
    LoopMap::Node node;
    node.frame = k;
    node.T_world_body = truth[k];
    const LoopMap::Link link{k > 0 ? truth[k - 1].inverse() * truth[k] : SE3(),
                             covarianceOf(kOdometryTurn, kOdometryMove)};
    REQUIRE(map.add(node, k % kPiece == 0 ? nullptr : &link).ok());
  }
  const SE3 elsewhere(expSo3(Eigen::Vector3d(0, 0, 3)), Eigen::Vector3d(4, 0, 0));
  const auto tie = [&](std::uint32_t k, const SE3& shift) {
    std::uint32_t id = 0;
    REQUIRE(map.addLoop(k, kPiece + k, truth[k].inverse() * shift * truth[kPiece + k],
                        covarianceOf(kLoopTurn, kLoopMove), id)
                .ok());
  };
  const auto settle = [&map] {
    for (bool moved = false; !map.atRest();) REQUIRE(map.settle(10, moved).ok());
  };
  constexpr std::uint32_t kWrong = 9, kRight = 3;
  for (std::uint32_t k = 0; k < kWrong; ++k) tie(k, elsewhere);
  for (std::uint32_t k = 0; k < kRight; ++k) tie(kWrong + k, SE3());
  settle();
  REQUIRE(map.joined(0, kPiece));
  REQUIRE(map.selected() == kWrong);
  map.releaseTies(map.component(kPiece));
  settle();
  CHECK(map.joined(0, kPiece));
  CHECK(map.selected() == kRight);
  CHECK((map.pose(kPiece).translation - truth[kPiece].translation).norm() < 0.1);
}
