#include "firmware_host/schedule/lockstep.hpp"

namespace swiftlet {
namespace {

HostTimes now() {
  const double seconds = wallSeconds();
  return {seconds, seconds};
}

}  // namespace

void runAll(Graph& graph) {
  for (bool any = true; any;) {
    any = false;
    for (Node* node : graph.nodes()) any = node->turn() || any;
  }
}

bool runLockstep(LogFeed& feed, Graph& graph, const RunControl& control) {
  SensorNode& sensors = graph.sensors();
  std::uint64_t told = 0;
  bool stopped = control.stopped();
  for (auto next = LogFeed::Next::kEnd; !stopped && (next = feed.next()) != LogFeed::Next::kEnd;) {
    if (next == LogFeed::Next::kSample) {
      sensors.takeImu(feed.sample(), feed.sample().stamp, now());
    } else if (next == LogFeed::Next::kImage) {
      sensors.takeScene(feed.scene());
      sensors.takeImage(feed.image(), now());
    } else {
      // All earlier frames have been processed, so there is room.
      static_cast<void>(graph.track().takeTracks(feed.tracks(), sensors.timeline()));
    }
    runAll(graph);
    if (control.progress && feed.taken() != told) control.progress(told = feed.taken());
    stopped = control.stopped();
  }
  sensors.endInput();
  runAll(graph);
  return !stopped;
}

}  // namespace swiftlet
