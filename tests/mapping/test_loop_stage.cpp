// The stage of loop closure on real images: the seconds of log in the repository are flown twice, with an
// odometry that is made of the truth and has gone wrong in between.

#include "mapping/loop/loop_stage.hpp"

#include <catch2/catch.hpp>
#include <limits>

#include "estimator/geometry/so3.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"
#include "tests/mapping/picture_flight.hpp"

using namespace swiftlet;
using namespace swiftlet::picture_flight;

namespace {

/// 3 degrees of yaw and 0.4 m.
SE3 drift() { return {expSo3(Eigen::Vector3d(0, 0, 0.05)), Eigen::Vector3d(0.3, -0.25, 0.1)}; }

/// Both visits; the last report.
LoopReport flyTwice(Flight& flight) {
  LoopReport report;
  double seconds = 0;
  for (const Picture& picture : pictures().all) report = flight.see(picture, seconds += kSpacing, SE3());
  seconds += kVisitGap;
  for (const Picture& picture : pictures().all) report = flight.see(picture, seconds += kSpacing, drift());
  return report;
}

}  // namespace

TEST_CASE("a place seen again brings the map back where it was, and says how the world lies in it") {
  Flight flight;
  const LoopReport last = flyTwice(flight);
  const std::size_t n = pictures().all.size();
  REQUIRE(n >= 8);
  REQUIRE(flight.stage->nodeCount() == 2 * n);
  const LoopCounters counters = flight.stage->counters();
  CHECK(counters.components == 1);
  CHECK(counters.selected >= n - 2);
  CHECK(last.selected == counters.selected);
  for (std::size_t i = 0; i < n; ++i) {
    INFO("node " << i);
    CHECK(flight.errorOfNode(n + i, pictures().all[i]) < 0.03);
  }
  // The odometry still has its drift; the correction takes it away.
  const SE3 left = last.correction.T_map_world * drift();
  CHECK(left.translation.norm() < 0.15);  // about a point metres away: turned by half a degree
  CHECK(logSo3(left.rotation).norm() < 0.01);
  CHECK(last.correction.version == 2 * n);

  std::size_t revisits = 0;
  LoopRevisit revisit;
  for (std::uint32_t i = 0; i < flight.stage->loopCount(); ++i) {
    if (!flight.stage->revisit(i, revisit)) continue;
    ++revisits;
    CHECK(revisit.old_stamp < revisit.new_stamp);
    CHECK(revisit.matches.size() >= 15);
    CHECK(revisit.information.llt().info() == Eigen::Success);
  }
  CHECK(revisits == counters.selected);
}

/// Words are asked so strictly that of these pictures only the very first is a place, when it comes again.
LoopSettings strict() {
  LoopSettings out;
  out.min_similarity = 9;  // the first after one far from it has 13 or more, others 7 at most
  return out;
}

/// Every second picture from `first` on, as often as it is there.
double seeEverySecond(Flight& flight, std::size_t first, std::size_t end, double seconds,
                      const SE3& T_world_truth) {
  for (std::size_t i = first; i < end; i += 2) {
    flight.see(pictures().all[i], seconds += kSpacing, T_world_truth);
  }
  return seconds;
}

/// Two loops by words: one alone could be chance.
double seeFirstAgain(Flight& flight, double seconds, const SE3& T_world_truth) {
  for (const std::size_t i : {std::size_t{0}, pictures().all.size() - 1, std::size_t{0}}) {
    flight.see(pictures().all[i], seconds += kSpacing, T_world_truth);
  }
  return seconds;
}

TEST_CASE(
    "once a loop is selected nodes that the map has near each other are compared, whatever their words") {
  const std::size_t n = pictures().all.size();
  SECTION("not before") {
    Flight flight({60, 100}, strict());
    const double seconds = seeEverySecond(flight, 0, n, 0, SE3()) + kVisitGap;
    seeEverySecond(flight, 1, n, seconds, drift());
    CHECK(flight.stage->counters().near == 0);
    CHECK(flight.stage->loopCount() == 0);
  }
  SECTION("nodes that come after it, and those that came before it") {
    Flight flight({60, 100}, strict());
    double seconds = seeEverySecond(flight, 0, n, 0, SE3()) + kVisitGap;
    const std::size_t half = n / 2;
    seconds = seeEverySecond(flight, 1, half, seconds, drift());
    CHECK(flight.stage->loopCount() == 0);
    seconds = seeFirstAgain(flight, seconds, drift());
    REQUIRE(flight.stage->counters().selected >= 2);
    const std::size_t later = flight.stage->nodeCount();
    seconds = seeEverySecond(flight, half | 1U, n, seconds, drift());
    // Keyframes that are no nodes: what they have left goes to nodes still to be asked.
    for (int i = 0; i < 4; ++i) flight.see(pictures().all[n - 1], seconds += 0.1, drift());
    const LoopCounters counters = flight.stage->counters();
    CHECK(counters.nodes > later);
    CHECK(counters.loops - counters.near_loops == 2);  // by words
    CHECK(counters.near_loops >= 4);
    CHECK(counters.selected == counters.loops);
    std::size_t before = 0;
    std::size_t after = 0;
    for (std::uint32_t i = 0; i < flight.stage->loopCount(); ++i) {
      const MapLoop loop = flight.stage->loop(i);
      before += loop.new_stamp < flight.stage->node(later - 1).stamp ? 1 : 0;
      after += loop.new_stamp > flight.stage->node(later - 1).stamp ? 1 : 0;
    }
    CHECK(before > 0);
    CHECK(after > 0);
  }
  SECTION("words that lead elsewhere are still asked") {
    Flight flight;
    SE3 elsewhere;
    elsewhere.translation.x() = 10;  // where it looks the same
    double seconds = seeEverySecond(flight, 0, n, 0, SE3());
    seconds = seeEverySecond(flight, 0, n, seconds + kVisitGap, elsewhere) + kVisitGap;
    std::size_t gainsaid = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const LoopReport report = flight.see(pictures().all[i], seconds += kSpacing, SE3());
      if (report.candidates.size() < 2 || !report.candidates[0].near) continue;
      // Its own place first, of the newest node; then by words the other one.
      if (report.candidates[0].new_frame != report.frame || report.candidates[0].fate != LoopFate::kAccepted)
        continue;
      gainsaid += !report.candidates[1].near && report.candidates[1].new_frame == report.frame ? 1 : 0;
    }
    CHECK(gainsaid > 0);
    for (std::uint32_t i = 0; i < flight.stage->loopCount(); ++i) {
      const MapLoop loop = flight.stage->loop(i);
      // The third visit is to the first room.
      const bool right = loop.new_stamp > flight.stage->node(n - 1).stamp &&
                         loop.old_stamp < flight.stage->node(n / 2).stamp;
      CHECK((loop.verdict == LoopVerdict::kSelected) == right);
    }
  }
  SECTION("a look-alike beside a place is not taken for it") {
    Flight flight({60, 100}, strict());
    double seconds = seeEverySecond(flight, 0, n, 0, SE3()) + kVisitGap;
    seconds = seeFirstAgain(flight, seconds, drift());
    const LoopCounters before = flight.stage->counters();
    REQUIRE(before.selected >= 2);
    REQUIRE(before.selected == before.loops);
    // 0.6 m beside, 20 sigma of the odometry, it all looks the same.
    SE3 beside = drift();
    beside.translation.y() += 0.6;
    seeEverySecond(flight, 1, n, seconds, beside);
    const LoopCounters counters = flight.stage->counters();
    CHECK(counters.near > before.near);
    CHECK(counters.near_loops > before.near_loops);  // geometry cannot tell
    CHECK(counters.selected == before.selected);
  }
}

TEST_CASE("the same keyframes give the same map, bit for bit") {
  const LoopSettings settings = GENERATE(values<LoopSettings>({LoopSettings{}, strict()}));
  Flight a({60, 100}, settings);
  Flight b({60, 100}, settings);
  flyTwice(a);
  flyTwice(b);
  REQUIRE(a.stage->nodeCount() == b.stage->nodeCount());
  for (std::size_t i = 0; i < a.stage->nodeCount(); ++i) {
    const SE3 x = a.stage->node(i).T_map_body;
    const SE3 y = b.stage->node(i).T_map_body;
    CHECK(x.translation == y.translation);
    CHECK(x.rotation.coeffs() == y.rotation.coeffs());
  }
}

TEST_CASE("an epoch of the odometry that begins anew is tied to the map by what it sees") {
  Flight flight;
  double seconds = 0;
  for (const Picture& picture : pictures().all) flight.see(picture, seconds += kSpacing, SE3());
  flight.newEpoch();
  const SE3 elsewhere(expSo3(Eigen::Vector3d(0, 0, 2)), Eigen::Vector3d(20, -7, 1));
  LoopReport report;
  seconds += kVisitGap;
  for (const Picture& picture : pictures().all) report = flight.see(picture, seconds += kSpacing, elsewhere);
  CHECK(flight.stage->counters().components == 2);
  CHECK(report.correction.epoch == 1);
  const std::size_t n = pictures().all.size();
  CHECK(flight.errorOfNode(2 * n - 1, pictures().all.back()) < 0.03);
}

TEST_CASE("without images, without room and without a pose the map goes on as it can") {
  SECTION("a keyframe whose images are gone is a pose without a place") {
    Flight flight;
    for (std::size_t i = 0; i < 4; ++i) {
      flight.see(pictures().all[i], kSpacing * static_cast<double>(i), SE3(), i != 2);
    }
    CHECK(flight.status.ok());
    CHECK(flight.stage->nodeCount() == 4);
    CHECK(flight.stage->counters().without_image == 1);
  }
  SECTION("a full map gives up a node for each new one, and its place with it") {
    Flight flight({6, 10});
    double seconds = 0;
    for (int visit = 0; visit < 3; ++visit, seconds += kVisitGap) {
      for (std::size_t i = 0; i < 6; ++i) flight.see(pictures().all[i], seconds += kSpacing, SE3());
    }
    CHECK(flight.status.ok());
    CHECK(flight.stage->nodeCount() == 6);
    const LoopCounters counters = flight.stage->counters();
    CHECK(counters.refused == 0);
    CHECK(counters.nodes == 18);
    CHECK(counters.map.nodes_removed == 12);
    CHECK(counters.loops > 0);
    LoopRevisit revisit;
    for (std::uint32_t i = 0; i < flight.stage->loopCount(); ++i) {
      if (!flight.stage->revisit(i, revisit)) continue;
      CHECK(revisit.old_stamp < revisit.new_stamp);  // both are there
    }
  }
  SECTION("input that is none") {
    Flight flight;
    LoopReport report;
    CHECK(flight.stage->step({}, LoopEffort{}, report).code == StatusCode::kInvalidInput);
    Picture bad = pictures().all[0];
    bad.T_truth_body.translation.x() = std::nan("");
    flight.see(bad, 1, SE3());
    CHECK(flight.status.code == StatusCode::kInvalidInput);
    CHECK(flight.stage->nodeCount() == 0);
  }
}

TEST_CASE("odometry that is not finite costs its link, not the nodes after it") {
  Flight flight;
  double seconds = 0;
  for (int i = 0; i < 6; ++i) {
    flight.covariance_factor = i == 3 ? std::numeric_limits<double>::quiet_NaN() : 1;
    flight.see(pictures().all[0], seconds += kSpacing, SE3(), false);
    CHECK(flight.status.ok());
  }
  CHECK(flight.stage->nodeCount() == 6);
  CHECK(flight.stage->counters().components == 2);
}
