// A node that the program does not have: what it takes to add one. It counts keyframes, under each schedule.
#include <catch2/catch.hpp>
#include <memory>
#include <string>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/inputs/log/log_player.hpp"
#include "firmware_host/schedule/lockstep.hpp"
#include "firmware_host/schedule/threaded.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/logs/silent_listener.hpp"
#include "tests/sanitized.hpp"

namespace swiftlet {
namespace {

// Its own file, in the program: what it reads, its policy when full, its counters.
class KeyframeCountNode final : public Node {
 public:
  KeyframeCountNode() : Node("keyframes", Rank::kLow) {}

  QueueIn<FrameResult, kResultRing> results{*this, "results_to_keyframes", Arrow::kWaits};

  bool turn() override {
    const bool ended = inputEnded();
    const FrameResult* result = results.front();
    if (result == nullptr) {
      if (ended) finish();
      return false;
    }
    const bool frame = result->kind == TrackMessage::Kind::kFrame;
    count_ += frame && result->tracked.keyframe ? 1U : 0U;
    results.pop();
    return true;
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }

 private:
  std::uint64_t count_ = 0;
};

// Its lines of the graph.
KeyframeCountNode& addKeyframeCount(Graph& graph) {
  KeyframeCountNode& node = graph.add(std::make_unique<KeyframeCountNode>());
  graph.smooth().results.to(node.results);
  return node;
}

struct Run {
  std::unique_ptr<LogSource> source = openLog(shortLog());
  test::SilentListener listener;
  RunObserver observer{listener};
  Settings settings;
  Graph graph{source->rig(), source->imuNoise(), settings, observer, GraphOptions{}};
  KeyframeCountNode& node = addKeyframeCount(graph);
  LogFeed feed{*source, {0, kSanitized ? 1.0 : 10.0, {}}, nullptr};

  void check() {
    graph.report(observer);
    CHECK(node.done());
    CHECK(node.count() > (kSanitized ? 1 : 5));
    CHECK(node.count() == observer.statistics().keyframes);
    CHECK(observer.statistics().losses.count("results_to_keyframes") == 0);
  }
};

TEST_CASE("a node that counts keyframes needs its file and its lines of the graph, in lockstep") {
  const auto run = std::make_unique<Run>();
  REQUIRE(runLockstep(run->feed, run->graph, RunControl{}));
  run->check();
}

TEST_CASE("and on threads") {
  const auto run = std::make_unique<Run>();
  LogPlayer player(run->feed, kSanitized ? 0.2 : 1);
  const ThreadedReport report = runThreaded(player, run->graph, ThreadedOptions{}, RunControl{});
  CHECK(report.faults.empty());
  CHECK(std::ranges::any_of(report.threads, [](const ThreadReport& t) { return t.name == "keyframes"; }));
  run->check();
}

}  // namespace
}  // namespace swiftlet
