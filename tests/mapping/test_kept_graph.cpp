// A flight in the map of an earlier one: located, extended, and not where two places look the same.

#include "mapping/loop/kept_graph.hpp"

#include <malloc.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "drivers/input/input_error.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/outputs/map_files/kept_graph_file.hpp"
#include "tests/mapping/picture_flight.hpp"

using namespace swiftlet;
using namespace swiftlet::picture_flight;

namespace {

/// Where the later flight's odometry has its origin.
SE3 elsewhere() { return {expSo3(Eigen::Vector3d(0, 0, 2)), Eigen::Vector3d(20, -7, 1)}; }

/// Every second picture, seen at `places` that look the same.
KeptGraph mapOf(const std::vector<SE3>& places) {
  Flight flight;
  double seconds = 0;
  for (const SE3& place : places) {
    for (std::size_t i = 0; i < pictures().all.size(); i += 2) {
      flight.see(pictures().all[i], seconds += kSpacing, place);
    }
    seconds += kVisitGap;
  }
  KeptGraph out;
  flight.stage->keep(out);
  return out;
}

Flight flightIn(const KeptGraph& map, KeptUse use = KeptUse::kLocalize) {
  Flight flight({60 + map.nodes.size(), 100 + map.loops.size()});
  REQUIRE(flight.stage->takeIn(map, use).ok());
  return flight;
}

/// m, of what the flight takes for the picture's place in the map; the map's frame is the truth's.
double errorOf(const LoopReport& report, const Picture& picture) {
  const SE3 T_world_body = elsewhere() * picture.T_truth_body;
  return ((report.correction.T_map_world * T_world_body).translation - picture.T_truth_body.translation)
      .norm();
}

}  // namespace

TEST_CASE("a flight that begins in a kept map finds itself there, and the map stays where it is") {
  const KeptGraph map = mapOf({SE3()});
  REQUIRE(map.nodes.size() >= 4);
  Flight flight = flightIn(map);
  std::size_t located = 0;
  double seconds = 0;
  for (std::size_t i = 1; i < pictures().all.size(); i += 2) {
    const LoopReport report = flight.see(pictures().all[i], seconds += kSpacing, elsewhere());
    INFO("picture " << i);
    if (report.correction.located) {
      ++located;
      CHECK(errorOf(report, pictures().all[i]) < 0.05);
    }
    // One or two loops could be chance.
    CHECK(report.correction.located == (report.selected >= 3));
  }
  CHECK(located > 0);
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    const SE3 now = flight.stage->node(i).T_map_body;
    CHECK((now.translation - map.nodes[i].T_map_body.translation).norm() < 1e-12);
  }
  SECTION("after a reset again") {
    flight.newEpoch();
    LoopReport report;
    for (std::size_t i = 1; i < pictures().all.size(); i += 2) {
      report = flight.see(pictures().all[i], seconds += kSpacing, elsewhere());
      if (i == 1) CHECK_FALSE(report.correction.located);
    }
    CHECK(report.correction.located);
    CHECK(errorOf(report, pictures().all.back()) < 0.05);
  }
  SECTION("loops into the kept map say so, and are none of full smoothing's") {
    LoopRevisit revisit;
    for (std::uint32_t i = 0; i < flight.stage->loopCount(); ++i) {
      CHECK(flight.stage->loop(i).kept);
      CHECK_FALSE(flight.stage->revisit(i, revisit));
    }
    CHECK(flight.stage->counters().kept_loops == flight.stage->loopCount());
  }
}

TEST_CASE("ten minutes in a kept map take no more memory than the first") {
  const KeptGraph map = mapOf({SE3()});
  constexpr std::size_t kFlightNodes = 20;
  Flight flight({map.nodes.size() + kFlightNodes, 100});
  REQUIRE(flight.stage->takeIn(map, KeptUse::kLocalize).ok());
  constexpr int kMinutes = 10;
  double seconds = 0;
  std::size_t early = 0;
  for (std::size_t i = 0; seconds < 60 * kMinutes; ++i) {
    const Picture& picture = pictures().all[i % pictures().all.size()];
    const LoopReport report = flight.see(picture, seconds += kSpacing, elsewhere());
    if (i > kFlightNodes) CHECK(report.correction.located);
    if (seconds < 120) early = mallinfo2().uordblks;
  }
  // The optimizer's factor is taken anew where the graph's shape changes.
  constexpr std::size_t kFactor = std::size_t{256} << 10U;
  CHECK(mallinfo2().uordblks < early + kFactor);
  CHECK(flight.stage->nodeCount() == map.nodes.size() + kFlightNodes);
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {  // none of them left for room
    CHECK(flight.stage->node(i).T_map_body.translation.isApprox(map.nodes[i].T_map_body.translation, 1e-9));
  }
}

/// What a picture shows upside down: recognized, with a pose that contradicts the map.
Picture upsideDown(const Picture& picture) {
  Picture out = picture;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    std::reverse(out.pixels[c].begin(), out.pixels[c].end());
    out.image[c].data = out.pixels[c].data();
  }
  return out;
}

TEST_CASE("one view that contradicts a location is one contradiction, however often the flight looks there") {
  Flight flight = flightIn(mapOf({SE3()}));
  double seconds = 0;
  LoopReport report;
  for (const Picture& picture : pictures().all)
    report = flight.see(picture, seconds += kSpacing, elsewhere());
  REQUIRE(report.correction.located);
  const std::array<Picture, 2> turned{upsideDown(pictures().all[1]), upsideDown(pictures().all[7])};
  constexpr double kQuick = 0.3;  // s between nodes: what the flight saw itself is not yet a revisit
  constexpr std::size_t kLooks = 20;
  for (std::size_t i = 0; i < kLooks; ++i) {
    CHECK(flight.see(turned[i % 2], seconds += kQuick, elsewhere()).correction.located);
  }
  CHECK(flight.stage->loopCount() > report.loops);  // it was recognized
}

TEST_CASE("three views that contradict a location end it, however many agreed before") {
  Flight flight = flightIn(mapOf({SE3()}));
  double seconds = 0;
  LoopReport report;
  for (const Picture& picture : pictures().all)
    report = flight.see(picture, seconds += kSpacing, elsewhere());
  const double agree = report.selected;
  REQUIRE((agree - 3) * (agree - 3) >= 3 * (agree + 3));  // the selection would keep the location
  // Ten metres on the flight sees the same pictures again: one of the two places is not that of the map.
  SE3 on = elsewhere();
  on.translation.x() += 10;
  for (const std::size_t i : {0U, 4U, 8U}) {  // views apart
    REQUIRE(report.correction.located);
    report = flight.see(pictures().all[i], seconds += kSpacing, on);
  }
  CHECK_FALSE(report.correction.located);
  // A view that agrees brings it back.
  report = flight.see(pictures().all[6], seconds += kSpacing, elsewhere());
  CHECK(report.correction.located);
  CHECK(errorOf(report, pictures().all[6]) < 0.05);
}

TEST_CASE("a hover in front of one kept view is one witness, however long it lasts") {
  KeptGraph map = mapOf({SE3()});
  for (std::size_t i = 1; i < map.nodes.size(); ++i) map.nodes[i].features.clear();
  Flight flight = flightIn(map);
  constexpr int kHover = 20;  // nodes
  double seconds = 0;
  for (int i = 0; i < kHover; ++i) {
    CHECK_FALSE(flight.see(pictures().all[1], seconds += kSpacing, elsewhere()).correction.located);
  }
  CHECK(flight.stage->counters().kept_loops == 1);  // it did recognize the view
}

TEST_CASE("a location whose predictions fail is taken back, and one view that is hidden is no reason to") {
  const KeptGraph map = mapOf({SE3()});
  Flight flight = flightIn(map);
  double seconds = 0;
  LoopReport report;
  constexpr double kQuick = 0.3;  // s between keyframes: what the flight saw itself is not yet a revisit
  for (const Picture& picture : pictures().all) report = flight.see(picture, seconds += kQuick, elsewhere());
  REQUIRE(report.correction.located);
  // Where the location has the kept views the flight sees what is not in the map: their mirror images.
  std::vector<Picture> strange = pictures().all;
  for (Picture& picture : strange) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      for (auto row = picture.pixels[c].begin(); row != picture.pixels[c].end();) {
        const auto end = row + picture.image[c].width;
        std::reverse(row, end);
        row = end;
      }
      picture.image[c].data = picture.pixels[c].data();
    }
  }
  constexpr std::array<std::size_t, 2> kTurned{1, 7};  // 0.29 rad apart
  const auto miss = [&](int views) {
    for (int i = 0; i < views; ++i) {
      report = flight.see(strange[kTurned[static_cast<std::size_t>(i) % 2]], seconds += kQuick, elsewhere());
    }
  };
  SECTION("ten views in a row") {
    miss(9);
    CHECK(report.correction.located);
    miss(3);
    CHECK_FALSE(report.correction.located);
    CHECK(flight.stage->counters().selected < 3);
    // Views that agree locate it again.
    for (const Picture& picture : pictures().all) {
      report = flight.see(picture, seconds += kSpacing, elsewhere());
    }
    CHECK(report.correction.located);
  }
  SECTION("none after which the place is recognized") {
    for (int i = 0; i < 3; ++i) {
      miss(7);
      report = flight.see(pictures().all[5], seconds += kQuick, elsewhere());
    }
    CHECK(report.correction.located);
  }
  SECTION("a hidden view") {
    for (int i = 0; i < 30; ++i) report = flight.see(strange[1], seconds += kSpacing, elsewhere());
    CHECK(report.correction.located);
  }
}

TEST_CASE("where two places of the map look the same it is unknown which of them the flight is at") {
  SE3 twin;
  twin.translation.x() = 10;
  Flight flight = flightIn(mapOf({SE3(), twin}));
  double seconds = 0;
  for (std::size_t i = 1; i < pictures().all.size(); i += 2) {
    CHECK_FALSE(flight.see(pictures().all[i], seconds += kSpacing, elsewhere()).correction.located);
  }
  CHECK(flight.stage->counters().kept_loops >= 4);  // it did recognize them
}

TEST_CASE("a map that is extended holds what both flights saw, in its own frame") {
  const KeptGraph map = mapOf({SE3()});
  Flight flight = flightIn(map, KeptUse::kExtend);
  double seconds = 0;
  for (const Picture& picture : pictures().all) flight.see(picture, seconds += kSpacing, elsewhere());
  KeptGraph extended;
  flight.stage->keep(extended);
  REQUIRE(extended.nodes.size() == map.nodes.size() + pictures().all.size());
  CHECK(extended.loops.size() >= 3);
  for (std::size_t i = 0; i < pictures().all.size(); ++i) {
    const KeptNode& node = extended.nodes[map.nodes.size() + i];
    INFO("picture " << i);
    CHECK((node.T_map_body.translation - pictures().all[i].T_truth_body.translation).norm() < 0.05);
  }
  // And is a map like any other.
  Flight third = flightIn(extended);
  LoopReport report;
  for (const Picture& picture : pictures().all) {
    report = third.see(picture, seconds += kSpacing, elsewhere());
  }
  CHECK(report.correction.located);
}

TEST_CASE("two maps of one place become one, and maps of places that share nothing stay apart") {
  const KeptGraph first = mapOf({SE3()});
  Flight other;
  double seconds = 0;
  for (const Picture& picture : pictures().all) other.see(picture, seconds += kSpacing, elsewhere());
  KeptGraph second;
  other.stage->keep(second);
  SECTION("one place") {
    Flight merged = flightIn(first, KeptUse::kExtend);
    REQUIRE(merged.stage->flyAgain(second, LoopEffort{}).ok());
    KeptGraph both;
    merged.stage->keep(both);
    REQUIRE(both.nodes.size() == first.nodes.size() + second.nodes.size());
    for (std::size_t i = 0; i < pictures().all.size(); ++i) {
      const SE3& found = both.nodes[first.nodes.size() + i].T_map_body;
      CHECK((found.translation - pictures().all[i].T_truth_body.translation).norm() < 0.05);
    }
  }
  SECTION("nothing shared") {
    for (KeptNode& node : second.nodes) node.features.clear();
    Flight merged = flightIn(first, KeptUse::kExtend);
    REQUIRE(merged.stage->flyAgain(second, LoopEffort{}).ok());
    KeptGraph both;
    merged.stage->keep(both);
    CHECK(both.nodes.size() == first.nodes.size());
  }
}

TEST_CASE("the map of a body that carries its camera elsewhere is taken as of one's own") {
  KeptGraph map = mapOf({SE3()});
  const SE3 X(expSo3(Eigen::Vector3d(0.3, -0.2, 1)), Eigen::Vector3d(0.1, 0.2, -0.3));
  map.T_body_cam = X.inverse() * map.T_body_cam;
  for (KeptNode& node : map.nodes) {
    node.T_map_body = node.T_map_body * X;
    node.T_previous_this = X.inverse() * node.T_previous_this * X;
    node.tilt.up_body = X.R().transpose() * node.tilt.up_body;
    node.tilt.covariance = (X.R().transpose() * node.tilt.covariance * X.R()).eval();
  }
  const KeptUse use = GENERATE(KeptUse::kLocalize, KeptUse::kExtend);
  Flight flight = flightIn(map, use);
  LoopReport report;
  double seconds = 0;
  for (const Picture& picture : pictures().all)
    report = flight.see(picture, seconds += kSpacing, elsewhere());
  CHECK(report.correction.located);
  CHECK(errorOf(report, pictures().all.back()) < 0.05);
}

TEST_CASE("a kept graph is read as it was written, and refused when anything in it is amiss") {
  const KeptGraph map = mapOf({SE3(), SE3()});
  REQUIRE_FALSE(map.loops.empty());
  const std::vector<std::uint8_t> bytes = keptGraphBytes(map);
  const KeptGraph read = readKeptGraph("map", bytes);
  REQUIRE(read.nodes.size() == map.nodes.size());
  REQUIRE(read.loops.size() == map.loops.size());
  CHECK(keptGraphBytes(read) == bytes);
  CHECK(read.nodes.back().features.size() == map.nodes.back().features.size());
  CHECK(read.loops.back().covariance.isApprox(map.loops.back().covariance, 1e-12));

  for (std::size_t at = 0; at < bytes.size(); at += 1 + bytes.size() / 500) {
    std::vector<std::uint8_t> damaged = bytes;
    damaged[at] ^= 0x10U;
    INFO("byte " << at);
    CHECK_THROWS_AS(readKeptGraph("map", damaged), InputError);
  }
  for (const std::size_t length : {std::size_t{0}, std::size_t{7}, std::size_t{40}, bytes.size() - 1}) {
    CHECK_THROWS_AS(readKeptGraph("map", std::span(bytes).first(length)), InputError);
  }
}
