// Pipelines that cannot start, give something else, die and come back: each a fault in words.

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>

#include "tests/drivers/gstreamer/feed_element.hpp"
#include "tests/drivers/gstreamer/frames.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

using test::awaitFrame;
using test::pipeline;

/// "kind: text" of a pipeline that does not open at 64x48 and 50 Hz.
struct Refusal {
  DeviceFaultKind kind;
  std::string text;
};
Refusal refusal(const std::string& text) {
  PipelineSource source(pipeline(text, 64, 48, 50));
  const DeviceFault fault = source.open();
  CHECK(!source.isOpen());
  CapturedFrame frame;
  CHECK(source.next(frame).kind == DeviceFaultKind::kUnplugged);
  CHECK(!frame.valid());
  std::cout << "gstreamer: " << describe(fault, "camera 0") << '\n';
  return {fault.kind, std::string(fault.text())};
}

TEST_CASE("A pipeline that cannot start says why", "[gstreamer]") {
  Refusal said = refusal("nosuchsrc");
  CHECK(said.kind == DeviceFaultKind::kWrongDevice);
  CHECK_THAT(said.text, Catch::Contains("nosuchsrc"));
  said = refusal("videotestsrc ! ! videoconvert");
  CHECK(said.kind == DeviceFaultKind::kWrongDevice);
  CHECK_THAT(said.text, Catch::Contains("syntax"));
  said = refusal("");
  CHECK(said.kind == DeviceFaultKind::kWrongDevice);
  said = refusal("videotestsrc ! fakesink");
  CHECK(said.kind == DeviceFaultKind::kWrongDevice);
  CHECK_THAT(said.text, Catch::Contains("fakesink"));
  said = refusal("filesrc location=/no/such/file");
  CHECK(said.kind == DeviceFaultKind::kMissing);
  CHECK_THAT(said.text, Catch::Contains("/no/such/file"));
  said = refusal("videotestsrc ! video/x-raw,format=RGB16,width=64,height=48");
  CHECK(said.kind == DeviceFaultKind::kUnsupported);
  CHECK_THAT(said.text, Catch::Contains("videoconvert") && Catch::Contains("RGB16"));
  said = refusal("videotestsrc num-buffers=0");
  CHECK(said.kind == DeviceFaultKind::kUnplugged);
  CHECK_THAT(said.text, Catch::Contains("ended"));
}

TEST_CASE("Another size or rate is refused with what the pipeline gives", "[gstreamer]") {
  Refusal said = refusal("videotestsrc ! video/x-raw,format=NV12,width=80,height=60");
  CHECK(said.kind == DeviceFaultKind::kChanged);
  CHECK_THAT(said.text, Catch::Contains("64x48") && Catch::Contains("80x60 NV12"));
  said = refusal("videotestsrc ! video/x-raw,framerate=30/1");
  CHECK(said.kind == DeviceFaultKind::kChanged);
  CHECK_THAT(said.text, Catch::Contains("requested 50") && Catch::Contains("delivers 30"));
  said = refusal("videotestsrc ! video/x-raw,interlace-mode=interleaved");
  CHECK(said.kind == DeviceFaultKind::kUnsupported);
  CHECK_THAT(said.text, Catch::Contains("interlaced"));
  // One that has a choice makes the right one.
  PipelineSource source(pipeline("videotestsrc is-live=true ! videoconvert n-threads=1", 64, 48, 50));
  REQUIRE(source.open().ok());
  CHECK(awaitFrame(source).image.width == 64);
  CHECK(source.facts().rate == 50);
}

TEST_CASE("A pipeline that gives no image is given up after five seconds", "[gstreamer]") {
  const Stamp begin = monotonicNow();
  const Refusal said = refusal("videotestsrc is-live=true ! valve drop=true");
  CHECK(said.kind == DeviceFaultKind::kSilent);
  CHECK_THAT(said.text, Catch::Contains("no image within 5 s"));
  const double took = (monotonicNow() - begin).seconds();
  CHECK(took > 4.9);
  CHECK(took < 8);
}

/// A camera that a test breaks.
class BreakableFeed : public test::Feed {
 public:
  std::atomic<bool> dies{false};
  std::atomic<bool> ends{false};
  std::atomic<bool> damages{false};
  std::atomic<bool> hangs{false};
  std::atomic<int> bytes{64 * 48};
  std::atomic<int> policy{-1};

  Next next(test::FedImage& image) override {
    policy.store(sched_getscheduler(0));
    if (dies.load()) return Next::kError;
    if (ends.load()) return Next::kEnd;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    image.bytes.assign(static_cast<std::size_t>(bytes.load()), 100);
    image.capture = monotonicNow();
    image.damaged = damages.load();
    return Next::kImage;
  }
  bool startHangs() override { return hangs.load(); }
};

constexpr const char* kBreakableFeed =
    "feedsrc feed=0 ! video/x-raw,format=GRAY8,width=64,height=48,framerate=50/1";

/// A feed that is known for as long as this lives, and longer than the source that a case makes after it.
struct Fed {
  Fed() { test::setFeed(0, &feed); }
  ~Fed() { test::setFeed(0, nullptr); }
  BreakableFeed feed;
};

/// The fault with which a source stops giving frames.
DeviceFault faultOf(PipelineSource& source) {
  DeviceFault fault;
  while (awaitFrame(source, &fault).valid()) {
  }
  return fault;
}

/// Opens as a thread in flight does, for 5 s at most; counts the tries.
int reopen(PipelineSource& source, double& longest) {
  for (int tries = 1; tries < 50; ++tries) {
    const Stamp begin = monotonicNow();
    const DeviceFault fault = source.open();
    longest = std::max(longest, (monotonicNow() - begin).seconds());
    if (fault.ok()) return tries;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return 0;
}

TEST_CASE("A pipeline that dies or ends says so and comes back", "[gstreamer]") {
  Fed fed;
  PipelineSource source(pipeline(kBreakableFeed, 64, 48, 50));
  REQUIRE(source.open().ok());
  CapturedFrame held = awaitFrame(source);
  REQUIRE(held.valid());
  const std::uint64_t before = held.sequence;
  fed.feed.dies.store(true);
  DeviceFault fault = faultOf(source);
  CHECK(fault.kind == DeviceFaultKind::kUnplugged);
  CHECK_THAT(std::string(fault.text()),
             Catch::Contains("feedsource") && Catch::Contains("The camera went away."));
  CHECK(!source.isOpen());
  held.release();  // after its source has closed: nothing happens
  fault = source.open();
  CHECK(!fault.ok());
  fed.feed.dies.store(false);
  double longest = 0;
  REQUIRE(reopen(source, longest) > 0);
  CHECK(longest < 0.5);
  CHECK(source.counters().reopened == 1);
  const CapturedFrame frame = awaitFrame(source);
  REQUIRE(frame.valid());
  CHECK(frame.sequence > before);

  fed.feed.ends.store(true);
  fault = faultOf(source);
  CHECK(fault.kind == DeviceFaultKind::kUnplugged);
  CHECK_THAT(std::string(fault.text()), Catch::Contains("ended"));
  fed.feed.ends.store(false);
  REQUIRE(reopen(source, longest) > 0);
  CHECK(source.counters().reopened == 2);
}

TEST_CASE("A pipeline that hangs as it starts again does not hold its thread up", "[gstreamer]") {
  Fed fed;
  PipelineSource source(pipeline(kBreakableFeed, 64, 48, 50));
  REQUIRE(source.open().ok());
  fed.feed.dies.store(true);
  static_cast<void>(faultOf(source));
  fed.feed.dies.store(false);
  fed.feed.hangs.store(true);
  for (int i = 0; i < 5; ++i) {
    const Stamp begin = monotonicNow();
    const DeviceFault fault = source.open();
    CHECK(fault.kind == DeviceFaultKind::kMissing);
    CHECK_THAT(std::string(fault.text()), Catch::Contains("starting"));
    CHECK((monotonicNow() - begin).seconds() < 0.5);
  }
  fed.feed.hangs.store(false);
  double longest = 0;
  CHECK(reopen(source, longest) > 0);
}

TEST_CASE("Damaged and short buffers are counted and left out", "[gstreamer]") {
  Fed fed;
  PipelineSource source(pipeline(kBreakableFeed, 64, 48, 50));
  REQUIRE(source.open().ok());
  const auto countIs = [&](const std::uint64_t& count) {
    for (int i = 0; i < 500 && count == 0; ++i) {
      CapturedFrame frame;
      REQUIRE(source.next(frame).ok());
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return count > 0;
  };
  fed.feed.damages.store(true);
  CHECK(countIs(source.counters().damaged));
  fed.feed.damages.store(false);
  fed.feed.bytes.store(100);
  CHECK(countIs(source.counters().too_short));
  fed.feed.bytes.store(64 * 48);
  CHECK(awaitFrame(source).valid());
}

TEST_CASE("Two frames are lent out at most, and none outlives its source's close", "[gstreamer]") {
  Fed fed;
  PipelineSource source(pipeline(kBreakableFeed, 64, 48, 50));
  REQUIRE(source.open().ok());
  CapturedFrame first = awaitFrame(source);
  CapturedFrame second = awaitFrame(source);
  REQUIRE(first.valid());
  REQUIRE(second.valid());
  CapturedFrame third;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  CHECK(source.next(third).ok());
  CHECK(!third.valid());
  first.release();
  third = awaitFrame(source);
  CHECK(third.valid());
  source.close();
  CHECK(!source.isOpen());
  second.release();
  CHECK(source.open().ok());
  CHECK(awaitFrame(source).valid());
}

TEST_CASE("GStreamer's threads do not run at the priority of who opens", "[gstreamer]") {
  Fed fed;
  int of_opener = -1;
  bool opened = false;
  std::thread opener([&] {
    sched_param priority{};
    priority.sched_priority = 5;
    pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
    of_opener = sched_getscheduler(0);
    PipelineSource source(pipeline(kBreakableFeed, 64, 48, 50));
    opened = source.open().ok();
  });
  opener.join();
  CHECK(opened);
  CHECK(fed.feed.policy.load() == SCHED_OTHER);
  if (of_opener != SCHED_FIFO)
    skipCase("no right to SCHED_FIFO", "sudo build/release/tests/drivers/gstreamer/test_drivers_gstreamer");
}

TEST_CASE("Opening and closing again and again leaves nothing behind", "[gstreamer]") {
  const auto threads = [] {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task"))
      count += entry.exists() ? 1 : 0;
    return count;
  };
  const auto descriptors = [] {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
      count += entry.is_symlink() ? 1 : 0;
    return count;
  };
  int threads_before = 0;
  int descriptors_before = 0;
  for (int i = 0; i < 30; ++i) {
    PipelineSource source(pipeline("videotestsrc is-live=true ! video/x-raw,width=64,height=48", 64, 48, 50));
    REQUIRE(source.open().ok());
    REQUIRE(awaitFrame(source).valid());
    if (i == 5) {
      threads_before = threads();
      descriptors_before = descriptors();
    }
    if (i == 29) {
      // GStreamer keeps idle threads for a while.
      CHECK(threads() <= threads_before + 2);
      CHECK(descriptors() == descriptors_before);
    }
  }
}

}  // namespace
}  // namespace swiftlet
