// Pairing against the rules of its header: on cases by hand, and on random drops against a model that
// sees the whole stream at once.

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/odometry/pairing.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kMs = 1'000'000;
const std::uint8_t kPixel = 0;

CameraFrame frameAt(std::uint32_t camera, std::int64_t ns) {
  CameraFrame frame;
  frame.stamp = frame.arrival = {ns};
  frame.camera = camera;
  frame.image = {&kPixel, 1, 1, 1};
  return frame;
}

struct Given {
  std::int64_t ns = 0;
  bool left = false;
  bool right = false;
  bool operator==(const Given&) const = default;
};

Given givenBy(const StereoFrame& frame) { return {frame.stamp.ns, frame.has(0), frame.has(1)}; }

std::ostream& operator<<(std::ostream& out, const Given& given) {
  return out << given.ns << (given.left ? " L" : "") << (given.right ? " R" : "");
}

std::vector<Given> runAll(Pairing& pairing, const std::vector<CameraFrame>& frames) {
  std::vector<Given> result;
  StereoFrame paired;
  for (const CameraFrame& frame : frames) {
    if (pairing.push(frame, paired).ok()) result.push_back(givenBy(paired));
  }
  while (pairing.flush(paired).ok()) result.push_back(givenBy(paired));
  return result;
}

TEST_CASE("frames of one instant become a pair with camera 0's stamp") {
  for (const bool left_first : {true, false}) {
    Pairing pairing{PairingSettings{}};
    StereoFrame paired;
    const CameraFrame left = frameAt(0, 100 * kMs);
    const CameraFrame right = frameAt(1, 101 * kMs);
    CHECK(pairing.push(left_first ? left : right, paired).code == StatusCode::kNotReady);
    CHECK(pairing.holdsImage());
    REQUIRE(pairing.push(left_first ? right : left, paired).ok());
    CHECK(givenBy(paired) == Given{100 * kMs, true, true});
    CHECK(paired.index == 0);
    CHECK_FALSE(pairing.holdsImage());
    CHECK(pairing.counters().pairs == 1);
  }
}

TEST_CASE("stamps further apart than the tolerance do not pair") {
  Pairing pairing{PairingSettings{}};
  const auto given = runAll(pairing, {frameAt(0, 100 * kMs), frameAt(1, 103 * kMs)});
  CHECK(given == std::vector<Given>{{100 * kMs, true, false}, {103 * kMs, false, true}});
  CHECK(pairing.counters().unpaired[0] == 1);
  CHECK(pairing.counters().unpaired[1] == 1);
}

TEST_CASE("the tolerance shrinks to a quarter of a fast camera's interval") {
  Pairing pairing{PairingSettings{}};
  // 250 Hz: frames 4 ms apart, cameras 2 ms out of step; 2 ms is within the setting but ambiguous.
  std::vector<CameraFrame> frames;
  for (int i = 0; i < 10; ++i) {
    frames.push_back(frameAt(0, 100 * kMs + i * 4 * kMs));
    frames.push_back(frameAt(1, 102 * kMs + i * 4 * kMs));
  }
  runAll(pairing, frames);
  CHECK(pairing.counters().pairs <= 1);  // the first frames have no interval yet
}

TEST_CASE("repeated, reversed, late and empty frames are refused and counted") {
  Pairing pairing{PairingSettings{}};
  StereoFrame paired;
  CHECK(pairing.push(frameAt(0, 100 * kMs), paired).code == StatusCode::kNotReady);
  CHECK(pairing.push(frameAt(0, 100 * kMs), paired).code == StatusCode::kInvalidInput);
  CHECK(pairing.push(frameAt(0, 90 * kMs), paired).code == StatusCode::kInvalidInput);
  REQUIRE(pairing.push(frameAt(0, 160 * kMs), paired).ok());  // 100 goes alone: overdue
  CHECK(pairing.push(frameAt(1, 100 * kMs), paired).code == StatusCode::kInvalidInput);
  CameraFrame empty = frameAt(1, 160 * kMs);
  empty.image = {};
  CHECK(pairing.push(empty, paired).code == StatusCode::kInvalidInput);
  REQUIRE(pairing.push(frameAt(1, 160 * kMs), paired).ok());
  CHECK(givenBy(paired) == Given{160 * kMs, true, true});
  CHECK(pairing.counters().refused[0] == 2);
  CHECK(pairing.counters().refused[1] == 2);
}

TEST_CASE("one camera alone passes through, the other is ignored") {
  PairingSettings settings;
  settings.cameras = 1;
  Pairing pairing{settings};
  const auto given = runAll(pairing, {frameAt(0, 100 * kMs), frameAt(1, 100 * kMs), frameAt(0, 150 * kMs)});
  CHECK(given == std::vector<Given>{{100 * kMs, true, false}, {150 * kMs, true, false}});
  CHECK(pairing.counters().unpaired[0] == 0);
}

TEST_CASE("an overdue frame is let go by the stamps of other messages") {
  Pairing pairing{PairingSettings{}};
  StereoFrame paired;
  CHECK(pairing.push(frameAt(1, 100 * kMs), paired).code == StatusCode::kNotReady);
  CHECK(pairing.expire({150 * kMs}, paired).code == StatusCode::kNotReady);
  REQUIRE(pairing.expire({151 * kMs}, paired).ok());
  CHECK(givenBy(paired) == Given{100 * kMs, false, true});
  CHECK(pairing.expire({200 * kMs}, paired).code == StatusCode::kNotReady);
}

TEST_CASE("frames pair if one camera's arrive several intervals later") {
  struct Case {
    int hz;
    std::int64_t late_ms;
  };
  for (const Case c : {Case{20, 40}, {60, 20}, {120, 12}, {120, 30}, {200, 6}, {200, 18}}) {
    INFO(c.hz << " Hz, camera 1 " << c.late_ms << " ms later");
    Pairing pairing{PairingSettings{}};
    std::vector<CameraFrame> frames;
    for (int i = 0; i < 200; ++i) {
      const std::int64_t stamp = 1'000'000'000LL * i / c.hz;
      for (const std::uint32_t camera : {0U, 1U}) {
        frames.push_back(frameAt(camera, stamp));
        frames.back().arrival = {stamp + camera * c.late_ms * kMs};
      }
    }
    std::ranges::stable_sort(frames, {}, [](const CameraFrame& f) { return f.arrival.ns; });
    const auto given = runAll(pairing, frames);
    CHECK(pairing.counters().pairs == 200);
    CHECK(std::ranges::is_sorted(given, {}, &Given::ns));
  }
}

TEST_CASE("only so many frames wait, whatever the patience") {
  PairingSettings settings;
  settings.patience = {1'000 * kMs};
  Pairing pairing{settings};
  StereoFrame paired;
  int given = 0;
  for (int i = 0; i < 6; ++i) given += pairing.push(frameAt(0, i * 5 * kMs), paired).ok() ? 1 : 0;
  CHECK(given == 6 - static_cast<int>(kPairingFrames));
  // A later frame of the other camera shows that those before are alone.
  given += pairing.push(frameAt(1, 25 * kMs), paired).ok() ? 1 : 0;
  while (pairing.expire({25 * kMs}, paired).ok()) ++given;
  CHECK(given == 6);
  CHECK(givenBy(paired) == Given{25 * kMs, true, true});
  CHECK_FALSE(pairing.holdsImage());
}

TEST_CASE("a lost camera does not delay the other, and comes back") {
  Pairing pairing{PairingSettings{}};
  StereoFrame paired;
  int at_once = 0;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t stamp = (100 + 50 * i) * kMs;
    const bool given = pairing.push(frameAt(0, stamp), paired).ok();
    // The next IMU sample comes 5 ms later.
    const bool soon = pairing.expire({stamp + 5 * kMs}, paired).ok();
    at_once += (given || soon) && !pairing.holdsImage() ? 1 : 0;
  }
  CHECK(pairing.isLost(1));
  CHECK(at_once >= 15);
  pairing.push(frameAt(1, 1100 * kMs), paired);
  REQUIRE(pairing.push(frameAt(0, 1100 * kMs), paired).ok());
  CHECK(givenBy(paired) == Given{1100 * kMs, true, true});
  CHECK_FALSE(pairing.isLost(1));
}

TEST_CASE("a camera is waited for until it has missed three frames running") {
  for (const int missed : {2, 3}) {
    Pairing pairing{PairingSettings{}};
    StereoFrame paired;
    std::int64_t stamp = 100 * kMs;
    for (int i = 0; i < missed; ++i, stamp += 100 * kMs) {
      pairing.push(frameAt(0, stamp), paired);
      REQUIRE(pairing.expire({stamp + 60 * kMs}, paired).ok());
    }
    CAPTURE(missed);
    CHECK(pairing.isLost(1) == (missed == 3));
    CHECK(pairing.push(frameAt(0, stamp), paired).ok() == (missed == 3));
  }
}

/// What must come out, seen from above: instants in order, with the images that were not dropped.
struct Model {
  std::vector<CameraFrame> frames;
  std::map<std::int64_t, std::pair<bool, bool>> instants;
};

Model randomStream(std::uint64_t seed, double drop) {
  Random random(seed);
  Model model;
  std::int64_t stamp = 1'000 * kMs;
  for (int i = 0; i < 300; ++i) {
    stamp += 50 * kMs + static_cast<std::int64_t>(random.below(2 * kMs));
    // The right camera's stamp lags by less than the tolerance.
    const std::int64_t right = stamp + static_cast<std::int64_t>(random.below(2 * kMs));
    const bool has_left = random.uniform() >= drop;
    const bool has_right = random.uniform() >= drop;
    if (has_left) model.frames.push_back(frameAt(0, stamp));
    if (has_right) model.frames.push_back(frameAt(1, right));
    if (has_left || has_right) model.instants[has_left ? stamp : right] = {has_left, has_right};
  }
  return model;
}

TEST_CASE("random drops: every instant once, in order, complete, and nothing else") {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const double drop = 0.02 * static_cast<double>(seed % 25);
    const Model model = randomStream(seed, drop);
    Pairing pairing{PairingSettings{}};
    const auto given = runAll(pairing, model.frames);
    const PairingCounters& counters = pairing.counters();

    std::size_t images = 0;
    std::size_t cut_pairs = 0;
    auto expected = model.instants.begin();
    for (const Given& g : given) {
      REQUIRE(expected != model.instants.end());
      INFO("seed " << seed << ", given " << g);
      CHECK(g.ns == expected->first);
      images += (g.left ? 1U : 0U) + (g.right ? 1U : 0U);
      const bool complete = g.left == expected->second.first && g.right == expected->second.second;
      // Only a camera counted as lost may miss its partner's frame: the left one went out at once.
      if (!complete) {
        CHECK(g.left);
        CHECK_FALSE(g.right);
        ++cut_pairs;
      }
      ++expected;
    }
    CHECK(expected == model.instants.end());
    CHECK(images + counters.refused[0] + counters.refused[1] == model.frames.size());
    CHECK(counters.refused[0] == 0);
    CHECK(counters.refused[1] == cut_pairs);
    if (drop == 0) CHECK(counters.pairs == model.instants.size());
    if (drop == 0) CHECK(cut_pairs == 0);
  }
}

TEST_CASE("the output up to an image does not depend on what comes after") {
  const Model model = randomStream(77, 0.2);
  Pairing whole{PairingSettings{}};
  const auto all = runAll(whole, model.frames);
  for (std::size_t cut = 1; cut < model.frames.size(); cut += 7) {
    // A cut between the two images of one instant makes another instant: cut after whole instants.
    const std::int64_t next = model.frames[cut].stamp.ns;
    if (next - model.frames[cut - 1].stamp.ns < 10 * kMs) continue;
    Pairing pairing{PairingSettings{}};
    const auto given = runAll(pairing, {model.frames.begin(), model.frames.begin() + static_cast<long>(cut)});
    REQUIRE(given.size() <= all.size());
    CHECK(std::equal(given.begin(), given.end(), all.begin()));
  }
}

}  // namespace
}  // namespace swiftlet
