// The carriers between threads, used from one: what full, empty, wrapped and moved mean.

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/core/drop_oldest_ring.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/newest_shared.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/core/spsc_ring.hpp"

namespace swiftlet::test {

TEST_CASE("a ring fills, refuses with a count, and empties in order", "[core][carriers]") {
  SpscRing<int, 3> ring;  // any capacity with a 64-bit index
  int out = -1;
  CHECK(ring.capacity() == 3);
  CHECK_FALSE(ring.tryPop(out));
  CHECK(out == -1);
  CHECK(ring.front() == nullptr);
  for (int i = 0; i < 3; ++i) {
    CHECK(ring.tryPush(i));
    CHECK(ring.size() == static_cast<std::size_t>(i) + 1);
  }
  CHECK(ring.refused() == 0);
  CHECK_FALSE(ring.tryPush(9));
  CHECK_FALSE(ring.tryPush(9));
  CHECK(ring.refused() == 2);
  CHECK(ring.size() == 3);
  for (int i = 0; i < 3; ++i) {
    REQUIRE(ring.front() != nullptr);
    CHECK(*ring.front() == i);
    CHECK(ring.tryPop(out));
    CHECK(out == i);
  }
  CHECK_FALSE(ring.tryPop(out));
  CHECK(ring.size() == 0);
}

TEST_CASE("a ring of one element", "[core][carriers]") {
  SpscRing<int, 1> ring;
  for (int i = 0; i < 5; ++i) {
    int out = -1;
    CHECK(ring.tryPush(i));
    CHECK_FALSE(ring.tryPush(100));
    CHECK(ring.tryPop(out));
    CHECK(out == i);
    CHECK_FALSE(ring.tryPop(out));
  }
  CHECK(ring.refused() == 5);
}

TEST_CASE("a ring's index may wrap, also where it is full at the time", "[core][carriers]") {
  // An 8-bit index wraps every 256 elements; a capacity of 128 leaves it just enough room. Every phase of
  // the wrap is met with every fill level.
  SpscRing<int, 128, std::uint8_t> ring;
  int pushed = 0;
  int popped = 0;
  for (int level = 0; level <= 128; ++level) {
    for (int step = 0; step < 300; ++step) {
      while (pushed - popped < level) REQUIRE(ring.tryPush(pushed++));
      REQUIRE(ring.size() == static_cast<std::size_t>(level));
      if (level == 128) REQUIRE_FALSE(ring.tryPush(-1));
      int out = -1;
      REQUIRE(ring.tryPop(out) == (level > 0));
      if (level > 0) REQUIRE(out == popped++);
    }
  }
  // The greatest capacity that an index can tell from empty.
  SpscRing<int, 1, std::uint8_t> smallest;
  for (int i = 0; i < 1000; ++i) {
    int out = -1;
    REQUIRE(smallest.tryPush(i));
    REQUIRE_FALSE(smallest.tryPush(-1));
    REQUIRE(smallest.tryPop(out));
    REQUIRE(out == i);
  }
}

TEST_CASE("a ring is written and read in place", "[core][carriers]") {
  SpscRing<std::array<int, 4>, 2> ring;
  std::array<int, 4>* draft = ring.beginPush();
  REQUIRE(draft != nullptr);
  (*draft)[3] = 7;
  CHECK(ring.front() == nullptr);  // not handed over yet
  CHECK(ring.beginPush() == draft);
  ring.commitPush();
  REQUIRE(ring.front() != nullptr);
  CHECK((*ring.front())[3] == 7);
  CHECK(ring.front() == draft);
  CHECK(ring.tryPush({}));
  CHECK(ring.beginPush() == nullptr);
  CHECK(ring.refused() == 1);
  ring.pop();
  CHECK(ring.size() == 1);
}

TEST_CASE("a ring carries what can only be moved, and a refused push leaves it whole", "[core][carriers]") {
  SpscRing<std::unique_ptr<int>, 1> ring;
  auto first = std::make_unique<int>(1);
  auto second = std::make_unique<int>(2);
  CHECK(ring.tryPush(std::move(first)));
  CHECK(first == nullptr);
  CHECK_FALSE(ring.tryPush(std::move(second)));
  // That it was not moved is the point.
  REQUIRE(second != nullptr);  // NOLINT(bugprone-use-after-move)
  CHECK(*second == 2);         // NOLINT(bugprone-use-after-move)
  std::unique_ptr<int> out;
  CHECK(ring.tryPop(out));
  REQUIRE(out != nullptr);
  CHECK(*out == 1);
}

TEST_CASE("the sides of a ring write to cache lines of their own", "[core][carriers]") {
  using Ring = SpscRing<std::uint8_t, 2>;
  CHECK(alignof(Ring) == kCacheLine);
  CHECK(sizeof(Ring) == 3 * kCacheLine);
  CHECK(sizeof(DropOldestRing<SlotHandle, 2>) == 3 * kCacheLine);
  CHECK(sizeof(Newest<int>) == 6 * kCacheLine);
}

TEST_CASE("a dropping ring gives the oldest back and keeps the newest", "[core][carriers]") {
  DropOldestRing<int, 3> ring;
  int dropped = -1;
  int out = -1;
  CHECK_FALSE(ring.tryPop(out));
  for (int i = 0; i < 3; ++i) CHECK_FALSE(ring.push(i, dropped));
  CHECK(dropped == -1);
  for (int i = 3; i < 10; ++i) {
    CHECK(ring.push(i, dropped));
    CHECK(dropped == i - 3);
    CHECK(ring.size() == 3);
  }
  CHECK(ring.dropped() == 7);
  // What the consumer takes makes room, although the producer has not looked since.
  CHECK(ring.tryPop(out));
  CHECK(out == 7);
  CHECK_FALSE(ring.push(10, dropped));
  CHECK(dropped == 6);
  for (int i = 8; i <= 10; ++i) {
    CHECK(ring.tryPop(out));
    CHECK(out == i);
  }
  CHECK_FALSE(ring.tryPop(out));
  CHECK(out == 10);
  CHECK(ring.size() == 0);
  CHECK(ring.dropped() == 7);
}

TEST_CASE("values of any size pass through atomic words whole", "[core][carriers]") {
  const auto there_and_back = [](auto value) {
    AtomicWords<decltype(value)> words;
    words.store(value, std::memory_order_relaxed);
    return words.load(std::memory_order_relaxed) == value;
  };
  CHECK(there_and_back(std::uint8_t{200}));
  CHECK(there_and_back(-1.5));
  CHECK(there_and_back(std::array<std::uint8_t, 7>{1, 2, 3, 4, 5, 6, 7}));
  CHECK(there_and_back(std::array<std::uint8_t, 9>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  CHECK(there_and_back(std::array<std::uint32_t, 3>{1, 2, 0xffffffffU}));
  CHECK(sizeof(AtomicWords<std::array<std::uint8_t, 9>>) == 16);
}

TEST_CASE("the newest value comes with its number, once and again", "[core][carriers]") {
  Newest<std::vector<int>> newest;  // not trivially copyable
  std::vector<int> out = {-1};
  CHECK(newest.read(out) == 0);
  CHECK(out == std::vector<int>{-1});
  CHECK(newest.write({1}) == 1);
  CHECK(newest.sequence() == 0);  // not before the reader refreshes
  CHECK(newest.read(out) == 1);
  CHECK(out == std::vector<int>{1});
  CHECK(newest.read(out) == 1);  // no news: the same again
  for (int i = 2; i <= 9; ++i) newest.write({i});
  CHECK(newest.refresh() == 9);  // seven were overwritten unseen
  CHECK(newest.value() == std::vector<int>{9});
  newest.draft() = {10};
  CHECK(newest.refresh() == 9);
  CHECK(newest.value() == std::vector<int>{9});
  CHECK(newest.publish() == 10);
  CHECK(newest.refresh() == 10);
  CHECK(newest.value() == std::vector<int>{10});
}

TEST_CASE("the shared newest value comes with its number", "[core][carriers]") {
  NewestShared<std::array<int, 3>> newest;
  std::array<int, 3> out = {-1, -1, -1};
  CHECK(newest.read(out) == 0);
  CHECK(out[0] == -1);
  for (int i = 1; i <= 20; ++i) {
    CHECK(newest.write({i, i + 1, i + 2}) == static_cast<std::uint64_t>(i));
    CHECK(newest.read(out) == static_cast<std::uint64_t>(i));
    CHECK(out == std::array<int, 3>{i, i + 1, i + 2});
    CHECK(newest.read(out) == static_cast<std::uint64_t>(i));
  }
  CHECK(newest.overtaken() == 0);
}

TEST_CASE("a pool lends its slots and gets them back", "[core][carriers]") {
  using Pool = SlotPool<int, 3, 2>;
  STATIC_REQUIRE(Pool::slotsFor({1, 2}) == 4);
  Pool pool({1, 2});
  const SlotHandle handle = pool.tryAcquire();
  REQUIRE(handle.valid());
  CHECK_FALSE(SlotHandle{}.valid());
  pool.fill(handle) = 42;
  CHECK(pool.tryHand(handle, 0));
  CHECK(pool.tryHand(handle, 1));
  pool.finish(handle);
  CHECK(pool.inUse() == 1);
  {
    const Pool::Loan loan = pool.borrow(handle, 0);
    REQUIRE(loan);
    CHECK(*loan == 42);
    CHECK(loan.handle() == handle);
    CHECK(pool.heldBy(handle, 0));
  }
  CHECK_FALSE(pool.heldBy(handle, 0));
  CHECK(pool.heldBy(handle, 1));
  CHECK(pool.inUse() == 1);
  pool.release(handle, 1);
  CHECK(pool.inUse() == 0);
  CHECK(pool.misused() == 0);
}

TEST_CASE("a loan moves, ends once, and can be ended early", "[core][carriers]") {
  using Pool = SlotPool<int, 2, 1>;
  Pool pool({2});
  std::array<SlotHandle, 2> handles;
  for (SlotHandle& handle : handles) {
    handle = pool.tryAcquire();
    CHECK(pool.tryHand(handle, 0));
    pool.finish(handle);
  }
  Pool::Loan first = pool.borrow(handles[0], 0);
  Pool::Loan second = pool.borrow(handles[1], 0);
  Pool::Loan moved = std::move(first);
  CHECK_FALSE(first);  // NOLINT(bugprone-use-after-move): empty is what it must be
  CHECK(moved);
  CHECK(pool.inUse() == 2);
  moved = std::move(second);  // lets go of what it had
  CHECK_FALSE(pool.heldBy(handles[0], 0));
  CHECK(pool.heldBy(handles[1], 0));
  moved.reset();
  moved.reset();
  CHECK(pool.inUse() == 0);
  CHECK(pool.misused() == 0);
}

TEST_CASE("a reader at its quota is passed over and the others are served", "[core][carriers]") {
  using Pool = SlotPool<int, 4, 2>;  // quotas of 1 and 2, one to fill
  Pool pool({1, 2});
  std::vector<SlotHandle> slow;
  for (int i = 0; i < 50; ++i) {
    const SlotHandle handle = pool.tryAcquire();
    REQUIRE(handle.valid());
    REQUIRE(pool.tryHand(handle, 0));
    if (pool.tryHand(handle, 1)) slow.push_back(handle);  // never released
    pool.finish(handle);
    pool.release(handle, 0);
  }
  CHECK(slow.size() == 2);
  CHECK(pool.refused(1) == 48);
  CHECK(pool.refused(0) == 0);
  CHECK(pool.exhausted() == 0);
  CHECK(pool.inUse() == 2);
  // One back, one more.
  pool.release(slow[0], 1);
  const SlotHandle handle = pool.tryAcquire();
  CHECK(pool.tryHand(handle, 1));
  CHECK_FALSE(pool.heldBy(slow[0], 1));
}

TEST_CASE("what a reader did not get, the writer takes back", "[core][carriers]") {
  SlotPool<int, 2, 1> pool({1});
  for (int i = 0; i < 10; ++i) {
    const SlotHandle handle = pool.tryAcquire();
    REQUIRE(handle.valid());
    REQUIRE(pool.tryHand(handle, 0));
    pool.takeBack(handle, 0);
    pool.finish(handle);
    CHECK(pool.inUse() == 0);
  }
  CHECK(pool.refused(0) == 0);
}

TEST_CASE("a pool without a free slot says so", "[core][carriers]") {
  SlotPool<int, 2, 1> pool({2});
  const SlotHandle a = pool.tryAcquire();
  const SlotHandle b = pool.tryAcquire();
  CHECK(a.slot != b.slot);
  CHECK_FALSE(pool.tryAcquire().valid());
  CHECK(pool.exhausted() == 1);
  pool.finish(a);
  const SlotHandle again = pool.tryAcquire();
  CHECK(again.slot == a.slot);
  CHECK(again.generation == a.generation + 1);
  CHECK_FALSE(again == a);
}

#ifdef NDEBUG
TEST_CASE("in flight a wrong release is ignored and counted", "[core][carriers]") {
  using Pool = SlotPool<int, 1, 2>;
  Pool pool({1, 1});
  const SlotHandle old = pool.tryAcquire();
  pool.finish(old);
  const SlotHandle handle = pool.tryAcquire();
  CHECK(pool.tryHand(handle, 0));
  CHECK(pool.tryHand(handle, 1));
  pool.finish(handle);
  pool.release(old, 0);  // another life of the slot
  CHECK(pool.heldBy(handle, 0));
  pool.release(handle, 0);
  pool.release(handle, 0);  // twice
  CHECK(pool.heldBy(handle, 1));
  CHECK_FALSE(pool.borrow(handle, 0));
  volatile std::size_t no_such_reader = 7;  // a constant would make GCC warn of code that is never reached
  pool.release(handle, no_such_reader);
  pool.release(SlotHandle{9, 1}, 0);
  CHECK(pool.misused() == 5);
  pool.release(handle, 1);
  CHECK(pool.inUse() == 0);
  CHECK(pool.tryAcquire().valid());
}
#endif

}  // namespace swiftlet::test
