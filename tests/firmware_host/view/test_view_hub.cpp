// Queues between the live view's publisher and its viewers.

#include <catch2/catch.hpp>
#include <string>

#include "firmware_host/outputs/view/view_hub.hpp"

namespace swiftlet {
namespace {

ViewHub::Text text(const std::string& what) { return std::make_shared<const std::string>(what); }

std::string next(ViewHub& hub, int place) {
  ViewHub::Text out;
  switch (hub.next(place, 0, out)) {
    case ViewHub::Next::kMessage:
      return *out;
    case ViewHub::Next::kNothing:
      return "nothing";
    case ViewHub::Next::kEnded:
      break;
  }
  return "ended";
}

TEST_CASE("a viewer gets a document, then the patches after it, then the end") {
  ViewHub hub;
  CHECK_FALSE(hub.documentWanted());
  const int place = hub.admit();
  REQUIRE(place >= 0);
  CHECK(hub.documentWanted());
  hub.publish(text("patch 1"));  // in the document already
  hub.offer(text("document 1"));
  CHECK_FALSE(hub.documentWanted());
  hub.publish(text("patch 2"));
  hub.publish(text("patch 3"));
  hub.end();
  CHECK(next(hub, place) == "document 1");
  CHECK(next(hub, place) == "patch 2");
  CHECK(next(hub, place) == "patch 3");
  CHECK(next(hub, place) == "ended");
  CHECK(hub.admit() == -1);
  CHECK(hub.counters().delivered == 2);
  CHECK(hub.counters().dropped == 0);
}

TEST_CASE("of images the newest waits alone, behind the patches") {
  ViewHub hub;
  const int place = hub.admit();
  hub.publishImages(text("images 0"));  // it has no document yet
  hub.offer(text("document"));
  CHECK(next(hub, place) == "document");
  CHECK(next(hub, place) == "nothing");
  for (int i = 1; i <= 4; ++i) hub.publishImages(text("images " + std::to_string(i)));
  hub.publish(text("patch"));
  CHECK(next(hub, place) == "patch");
  CHECK(next(hub, place) == "images 4");
  CHECK(next(hub, place) == "nothing");
  CHECK(hub.counters().images == 5);
  CHECK(hub.counters().images_delivered == 1);
  CHECK(hub.counters().images_dropped == 3);
  CHECK(hub.counters().bytes == 8 + 5 + 8);
  CHECK(hub.imagesTaken() == 0.25);
  CHECK(hub.imagesTaken() == 1);  // none came since
  // Of several viewers the quickest counts.
  static_cast<void>(hub.admit());
  hub.offer(text("document"));
  hub.publishImages(text("images 5"));
  CHECK(next(hub, place) == "images 5");
  CHECK(hub.imagesTaken() == 1);
}

TEST_CASE("a viewer that is slow loses patches, counted, and gets a fresh document") {
  ViewHub hub;
  const int slow = hub.admit();
  const int quick = hub.admit();
  hub.offer(text("document 0"));
  CHECK(next(hub, slow) == "document 0");
  CHECK(next(hub, quick) == "document 0");
  constexpr int kPatches = 40;
  for (int i = 1; i <= kPatches; ++i) {
    hub.publish(text("patch " + std::to_string(i)));
    CHECK(next(hub, quick) == "patch " + std::to_string(i));
  }
  // It is still sending: no document is made for it.
  CHECK_FALSE(hub.documentWanted());
  CHECK(hub.counters().dropped == kPatches);
  CHECK(next(hub, slow) == "nothing");
  CHECK(hub.documentWanted());
  hub.publish(text("patch 41"));
  hub.offer(text("document 41"));
  hub.publish(text("patch 42"));
  CHECK(next(hub, slow) == "document 41");
  CHECK(next(hub, slow) == "patch 42");
  CHECK(next(hub, quick) == "patch 41");
  CHECK(next(hub, quick) == "patch 42");
  CHECK(hub.counters().dropped == kPatches);
}

TEST_CASE("a document that was never taken is not counted as a lost patch") {
  ViewHub hub;
  const int slow = hub.admit();
  hub.offer(text("document 0"));
  // The document and the patches after it fill the queue; one more, and all of it is old.
  for (std::size_t i = 0; i < ViewHub::kMostWaiting; ++i) hub.publish(text("patch"));
  CHECK(hub.counters().dropped == ViewHub::kMostWaiting);
  CHECK(next(hub, slow) == "nothing");
}

TEST_CASE("there are so many places and no more, and who leaves makes room") {
  ViewHub hub;
  for (std::size_t i = 0; i < ViewHub::kMostViewers; ++i) CHECK(hub.admit() == static_cast<int>(i));
  CHECK(hub.admit() == -1);
  CHECK(hub.viewers() == ViewHub::kMostViewers);
  hub.leave(3, true);
  CHECK(hub.admit() == 3);
  CHECK(hub.counters().refused == 1);
  CHECK(hub.counters().given_up == 1);
  CHECK(hub.counters().viewers == ViewHub::kMostViewers + 1);
  CHECK(hub.counters().most_viewers == ViewHub::kMostViewers);
}

}  // namespace
}  // namespace swiftlet
