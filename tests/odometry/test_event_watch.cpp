// Events from what changes between frames, and the buffer that holds them.

#include "estimator/odometry/event_watch.hpp"

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

using namespace swiftlet;

namespace {

std::vector<EventKind> kinds(EventBuffer& buffer) {
  auto output = std::make_unique<OdometryOutput>();
  buffer.flush(*output);
  std::vector<EventKind> result;
  for (const Event& e : output->events) result.push_back(e.kind);
  return result;
}

EventWatch::Frame goodFrame(int k) {
  EventWatch::Frame frame;
  frame.stamp = Stamp{k * 50'000'000LL};
  frame.camera_present = {true, true};
  frame.cameras = 2;
  frame.health = Health::kGood;
  return frame;
}

}  // namespace

TEST_CASE("EventBuffer: what does not fit is counted in the last place", "[odometry][events]") {
  EventBuffer buffer;
  for (int k = 0; k < 40; ++k) buffer.raise(Stamp{k}, EventKind::kImuInvalid, 1);
  auto output = std::make_unique<OdometryOutput>();
  buffer.flush(*output);
  REQUIRE(output->events.full());
  CHECK(output->events[30].kind == EventKind::kImuInvalid);
  CHECK(output->events[31].kind == EventKind::kCapacityReached);
  CHECK(output->events[31].value == 9);
  CHECK(kinds(buffer).empty());
}

TEST_CASE("EventWatch: a camera is lost after three frames, not after one", "[odometry][events]") {
  EventWatch watch;
  EventBuffer buffer;
  watch.step(goodFrame(0), buffer);
  CHECK(kinds(buffer) == std::vector{EventKind::kHealthChanged, EventKind::kInitialized});
  EventWatch::Frame frame = goodFrame(1);
  frame.camera_present[1] = false;
  watch.step(frame, buffer);
  watch.step(goodFrame(2), buffer);
  CHECK(kinds(buffer).empty());
  for (int k = 3; k < 6; ++k) {
    frame.stamp = goodFrame(k).stamp;
    watch.step(frame, buffer);
  }
  CHECK(kinds(buffer) == std::vector{EventKind::kCameraLost});
  watch.step(goodFrame(6), buffer);
  CHECK(kinds(buffer) == std::vector{EventKind::kCameraBack});
}

TEST_CASE("EventWatch: rest and blackout begin and end once", "[odometry][events]") {
  EventWatch watch;
  EventBuffer buffer;
  watch.step(goodFrame(0), buffer);
  kinds(buffer);
  EventWatch::Frame frame = goodFrame(1);
  frame.at_rest = true;
  watch.step(frame, buffer);
  watch.step(frame, buffer);
  CHECK(kinds(buffer) == std::vector{EventKind::kRestStarted});
  frame = goodFrame(20);
  frame.seconds_without_image = 0.4;
  watch.step(frame, buffer);
  frame.seconds_without_image = 0.45;
  watch.step(frame, buffer);
  CHECK(kinds(buffer) == std::vector{EventKind::kRestEnded, EventKind::kBlackoutStarted});
  watch.step(goodFrame(30), buffer);
  CHECK(kinds(buffer) == std::vector{EventKind::kBlackoutEnded});
}
