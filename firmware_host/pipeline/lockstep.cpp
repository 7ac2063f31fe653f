#include "firmware_host/pipeline/lockstep.hpp"

namespace swiftlet {
namespace {

HostTimes now() {
  const double seconds = wallSeconds();
  return {seconds, seconds};
}

/// Every thread's turn, until none has anything to do.
void runAll(Wiring& wiring) {
  for (bool any = true; any;) {
    any = wiring.propagate();
    any = wiring.track() || any;
    any = wiring.smooth() || any;
    any = wiring.mesh() || any;
    any = wiring.loop() || any;
    any = wiring.map() || any;
    any = wiring.log() || any;
    any = wiring.record() || any;
  }
}

}  // namespace

bool runLockstep(LogFeed& feed, Wiring& wiring, const RunControl& control) {
  std::uint64_t told = 0;
  bool stopped = control.stopped();
  for (auto next = LogFeed::Next::kEnd; !stopped && (next = feed.next()) != LogFeed::Next::kEnd;) {
    if (next == LogFeed::Next::kSample) {
      wiring.takeImu(feed.sample(), feed.sample().stamp, now());
    } else if (next == LogFeed::Next::kImage) {
      wiring.takeScene(feed.scene());
      wiring.takeImage(feed.image(), now());
    } else {
      // Nobody is ahead of us: there is room.
      static_cast<void>(wiring.takeTracks(feed.tracks()));
    }
    runAll(wiring);
    if (control.progress && feed.taken() != told) control.progress(told = feed.taken());
    stopped = control.stopped();
  }
  wiring.endInput();
  runAll(wiring);
  return !stopped;
}

}  // namespace swiftlet
