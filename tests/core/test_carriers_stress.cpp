// The carriers between real threads, millions of times: nothing lost, doubled, out of order or torn. Under
// ThreadSanitizer the same programs show that nothing races. `test_core "[.figures]"` prints what each costs.

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <thread>

#include "estimator/core/drop_oldest_ring.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/newest_shared.hpp"
#include "estimator/core/random.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/core/spsc_ring.hpp"

namespace swiftlet::test {
namespace {

#if defined(__SANITIZE_THREAD__)
constexpr std::uint64_t kShare = 10;  // each access costs ten times as much
#else
constexpr std::uint64_t kShare = 1;
#endif

/// A payload over two cache lines whose words all follow from its number.
struct Payload {
  std::array<std::uint64_t, 12> words{};

  static Payload of(std::uint64_t n) {
    Payload payload;
    for (std::uint64_t i = 0; i < payload.words.size(); ++i)
      payload.words[i] = (n + i) * 0x9e3779b97f4a7c15ULL;
    return payload;
  }
  /// Its number; the greatest one when it is a mixture.
  [[nodiscard]] std::uint64_t number() const {
    const std::uint64_t n = words[0] * 0xf1de83e19937733dULL;  // the factor's inverse modulo 2^64
    for (std::uint64_t i = 0; i < words.size(); ++i) {
      if (words[i] != (n + i) * 0x9e3779b97f4a7c15ULL) return ~0ULL;
    }
    return n;
  }
};

/// The two cores may be one, or busy: who cannot go on lets the other.
void waitALittle() { std::this_thread::yield(); }

/// Stops for a while now and then, so that full, empty and overtaken states are met.
void stumble(Random& random) {
  if (random.below(4096) == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
}

}  // namespace

TEST_CASE("a payload knows whether it is whole", "[core][carriers]") {
  CHECK(Payload::of(123456789).number() == 123456789);
  Payload torn = Payload::of(5);
  torn.words[11] = Payload::of(6).words[11];
  CHECK(torn.number() == ~0ULL);
}

TEST_CASE("ring: two threads, in order, none lost, none torn", "[core][carriers][stress]") {
  constexpr std::uint64_t kCount = 1'000'000 / kShare;
  SpscRing<Payload, 16, std::uint8_t> ring;  // the index wraps thousands of times
  std::uint64_t refused = 0;
  std::thread producer([&] {
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      while (!ring.tryPush(Payload::of(i))) {
        ++refused;
        waitALittle();
      }
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t i = 1; i <= kCount; ++i) {
    Payload out;
    while (!ring.tryPop(out)) waitALittle();
    if (out.number() != i) ++wrong;
  }
  producer.join();
  CHECK(wrong == 0);
  CHECK(ring.front() == nullptr);
  CHECK(ring.refused() == refused);
}

TEST_CASE("dropping ring: two threads, each value taken or dropped, in order", "[core][carriers][stress]") {
  constexpr std::uint64_t kCount = 2'000'000 / kShare;
  DropOldestRing<Payload, 4> ring;
  std::atomic<bool> through{false};
  std::uint64_t producer_wrong = 0;
  std::uint64_t dropped_sum = 0;
  std::uint64_t dropped_count = 0;
  std::thread producer([&] {
    Random random(1);
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      Payload dropped;
      if (ring.push(Payload::of(i), dropped)) {
        if (dropped.number() != i - 4) ++producer_wrong;
        dropped_sum += dropped.number();
        ++dropped_count;
      }
      if (i % 64 == 0) waitALittle();
      stumble(random);
    }
    through.store(true, std::memory_order_release);
  });
  Random random(2);
  std::uint64_t wrong = 0;
  std::uint64_t last = 0;
  std::uint64_t taken_sum = 0;
  std::uint64_t taken_count = 0;
  for (bool more = true; more;) {
    more = !through.load(std::memory_order_acquire);
    for (Payload out; ring.tryPop(out); stumble(random)) {
      const std::uint64_t number = out.number();
      if (number <= last || number > kCount) ++wrong;
      last = number;
      taken_sum += number;
      ++taken_count;
    }
    waitALittle();
  }
  producer.join();
  CHECK(wrong == 0);
  CHECK(producer_wrong == 0);
  CHECK(last == kCount);  // the newest is never the one dropped
  CHECK(taken_count + dropped_count == kCount);
  CHECK(taken_sum + dropped_sum == kCount * (kCount + 1) / 2);
  CHECK(ring.dropped() == dropped_count);
  CHECK(taken_count > 4);
  CHECK(dropped_count > 0);
}

TEST_CASE("newest: numbers rise, values are whole, the last one arrives", "[core][carriers][stress]") {
  constexpr std::uint64_t kCount = 2'000'000 / kShare;
  constexpr std::uint64_t kAhead = kCount / 100;  // so that the reader is let in on a busy machine too
  Newest<Payload> newest;
  std::atomic<std::uint64_t> read{0};
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      newest.write(Payload::of(i));
      if (i % 128 == 0) waitALittle();
      while (read.load() + kAhead < i) waitALittle();
    }
  });
  std::uint64_t wrong = 0;
  std::uint64_t last = 0;
  std::uint64_t seen = 0;
  while (last < kCount) {
    Payload out;
    const std::uint64_t sequence = newest.read(out);
    if (sequence < last || (sequence > 0 && out.number() != sequence)) ++wrong;
    if (sequence != last) {
      ++seen;
    } else {
      waitALittle();
    }
    last = sequence;
    read.store(last);
  }
  writer.join();
  CHECK(wrong == 0);
  CHECK(newest.refresh() == kCount);
  CHECK(seen >= kCount / (kAhead + 1));
}

TEST_CASE("shared newest: two readers, numbers rise, values are whole", "[core][carriers][stress]") {
  constexpr std::uint64_t kCount = 500'000 / kShare;
  NewestShared<Payload> newest;
  NewestShared<Payload, 1> single;  // the classic seqlock: overtaken far more often
  std::atomic<std::uint64_t> wrong{0};
  const auto reader = [&](auto& carrier) {
    std::uint64_t last = 0;
    while (last < kCount) {
      Payload out;
      const std::uint64_t sequence = carrier.read(out);
      if (sequence == 0 || sequence == last) waitALittle();
      if (sequence == 0) continue;  // none yet, or overtaken
      if (sequence < last || out.number() != sequence) wrong.fetch_add(1, std::memory_order_relaxed);
      last = sequence;
    }
  };
  std::thread other([&] {
    reader(newest);
    reader(single);
  });
  const auto write = [](auto& carrier) {
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      carrier.write(Payload::of(i));
      if (i % 1024 == 0) waitALittle();
    }
  };
  std::thread writer([&] {
    write(newest);
    write(single);
  });
  reader(newest);
  reader(single);
  writer.join();
  other.join();
  CHECK(wrong.load() == 0);
}

namespace {

using StressPool = SlotPool<Payload, 8, 3>;
constexpr StressPool::Quotas kQuotas = {4, 2, 1};
static_assert(StressPool::slotsFor(kQuotas) == StressPool::capacity());

struct PoolStress {
  StressPool pool{kQuotas};
  DropOldestRing<SlotHandle, 2> fast_ring;  // reader 0 holds one at a time: 2 + 1 + 1
  SpscRing<SlotHandle, 2> slow_ring;        // reader 1 stumbles and skips
  SpscRing<SlotHandle, 1> stalled_ring;     // reader 2 keeps its only slot for good
  std::atomic<bool> through{false};
  std::atomic<std::uint64_t> wrong{0};
  std::array<std::uint64_t, 3> got{};
  std::uint64_t taken_back = 0;

  void write(std::uint64_t count) {
    Random random(3);
    for (std::uint64_t i = 1; i <= count; ++i) {
      const SlotHandle handle = pool.tryAcquire();
      if (!handle.valid()) continue;  // counted by the pool, and looked at in the end
      pool.fill(handle) = Payload::of(i);
      SlotHandle dropped;
      if (pool.tryHand(handle, 0) && fast_ring.push(handle, dropped)) {
        pool.takeBack(dropped, 0);
        ++taken_back;
      }
      if (pool.tryHand(handle, 1) && !slow_ring.tryPush(handle)) pool.takeBack(handle, 1);
      if (pool.tryHand(handle, 2) && !stalled_ring.tryPush(handle)) pool.takeBack(handle, 2);
      pool.finish(handle);
      if (i % 16 == 0) waitALittle();
      stumble(random);
    }
    through.store(true, std::memory_order_release);
  }
  template <typename Ring>
  void read(Ring& ring, std::size_t reader) {
    Random random(10 + reader);
    std::uint64_t last = 0;
    for (bool more = true; more;) {
      more = !through.load(std::memory_order_acquire);
      for (SlotHandle handle; ring.tryPop(handle);) {
        if (reader == 1 && random.below(8) == 0) {
          pool.release(handle, reader);
          continue;
        }
        const auto loan = pool.borrow(handle, reader);
        const std::uint64_t before = loan ? loan->number() : ~0ULL;
        stumble(random);
        if (before <= last || before == ~0ULL || loan->number() != before) {
          wrong.fetch_add(1, std::memory_order_relaxed);
        }
        last = before;
        ++got[reader];
      }
      waitALittle();
    }
  }
};

}  // namespace

TEST_CASE("pool: three readers, one stalled for good, and the writer never without a slot",
          "[core][carriers][stress]") {
  constexpr std::uint64_t kCount = 500'000 / kShare;
  PoolStress stress;
  std::thread fast([&] { stress.read(stress.fast_ring, 0); });
  std::thread slow([&] { stress.read(stress.slow_ring, 1); });
  stress.write(kCount);
  fast.join();
  slow.join();
  CHECK(stress.wrong.load() == 0);
  CHECK(stress.pool.exhausted() == 0);
  CHECK(stress.pool.misused() == 0);
  CHECK(stress.pool.refused(0) == 0);  // its quota suits its ring: it loses old frames, never new ones
  CHECK(stress.pool.refused(2) == kCount - 1);
  CHECK(stress.got[0] + stress.taken_back == kCount);
  CHECK(stress.fast_ring.dropped() == stress.taken_back);
  CHECK(stress.got[1] > 0);
  // All is back but the stalled reader's, which is still what it was lent as.
  CHECK(stress.pool.inUse() == 1);
  SlotHandle handle;
  REQUIRE(stress.stalled_ring.tryPop(handle));
  CHECK(stress.pool.borrow(handle, 2)->number() == 1);
  CHECK(stress.pool.inUse() == 0);
}

namespace {

template <typename Body>
double nanosecondsEach(std::uint64_t count, Body body) {
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 1; i <= count; ++i) body(i);
  const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - begin;
  return taken.count() / static_cast<double>(count);
}

/// The producer on a thread of its own, the consumer here; per value, until the last one arrived. The best of
/// many short runs, each within a time slice, in which the consumer saw a twentieth of the values at least:
/// so both threads had a core. Not a number when there was none.
template <typename Produce, typename Consume>
double nanosecondsAcross(Produce produce, Consume consume) {
  constexpr std::uint64_t kRun = 50'000;
  double best = std::numeric_limits<double>::quiet_NaN();
  for (std::uint64_t run = 0; run < 40; ++run) {
    const auto begin = std::chrono::steady_clock::now();
    std::thread producer([&] {
      for (std::uint64_t i = 1; i <= kRun; ++i) produce(run * kRun + i);
    });
    std::uint64_t seen = 0;
    for (std::uint64_t last = 0; last < (run + 1) * kRun;) {
      const std::uint64_t now = consume();
      if (now > last) {
        last = now;
        ++seen;
      }
    }
    const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - begin;
    producer.join();
    if (seen >= kRun / 20) best = std::fmin(best, taken.count() / static_cast<double>(kRun));
  }
  return best;
}

struct Message {
  std::array<std::uint64_t, 8> words{};
};

}  // namespace

TEST_CASE("figures: rings", "[.figures]") {
  constexpr std::uint64_t kCount = 5'000'000;
  SpscRing<Message, 64> ring;
  Message out;
  std::printf("SpscRing, 64 B: push and pop on one thread %.1f ns",
              nanosecondsEach(kCount, [&](std::uint64_t i) {
                (void)ring.tryPush(Message{{i}});
                (void)ring.tryPop(out);
              }));
  std::printf(", across two %.1f ns a value\n",
              nanosecondsAcross(
                  [&](std::uint64_t i) {
                    while (!ring.tryPush(Message{{i}})) {
                    }
                  },
                  [&] { return ring.tryPop(out) ? out.words[0] : std::uint64_t{0}; }));
  DropOldestRing<SlotHandle, 4> dropping;
  SlotHandle handle;
  SlotHandle dropped;
  std::printf("DropOldestRing, 8 B: push and pop on one thread %.1f ns",
              nanosecondsEach(kCount, [&](std::uint64_t i) {
                (void)dropping.push({static_cast<std::uint32_t>(i), 0}, dropped);
                (void)dropping.tryPop(handle);
              }));
  std::printf(", push that drops %.1f ns", nanosecondsEach(kCount, [&](std::uint64_t i) {
                (void)dropping.push({static_cast<std::uint32_t>(i), 0}, dropped);
              }));
  std::printf(", across two %.1f ns a value\n",
              nanosecondsAcross(
                  [&](std::uint64_t i) {
                    (void)dropping.push({static_cast<std::uint32_t>(i), 1}, dropped);
                  },
                  [&] { return dropping.tryPop(handle) && handle.generation == 1 ? handle.slot : 0U; }));
}

TEST_CASE("figures: newest values and slots", "[.figures]") {
  constexpr std::uint64_t kCount = 5'000'000;
  Message out;
  Newest<Message> newest;
  std::printf("Newest, 64 B: write and read on one thread %.1f ns",
              nanosecondsEach(kCount, [&](std::uint64_t i) {
                newest.write(Message{{i}});
                (void)newest.read(out);
              }));
  std::printf(", read without news %.1f ns",
              nanosecondsEach(kCount, [&](std::uint64_t) { (void)newest.read(out); }));
  std::printf(", across two %.1f ns a write\n",
              nanosecondsAcross([&](std::uint64_t i) { newest.write(Message{{i + kCount}}); },
                                [&] { return newest.read(out) - kCount; }));
  NewestShared<Message> shared;
  std::printf("NewestShared, 64 B: write and read on one thread %.1f ns",
              nanosecondsEach(kCount, [&](std::uint64_t i) {
                shared.write(Message{{i}});
                (void)shared.read(out);
              }));
  std::uint64_t last = kCount;
  std::printf(", across two %.1f ns a write\n",
              nanosecondsAcross([&](std::uint64_t i) { shared.write(Message{{i}}); },
                                [&] {
                                  const std::uint64_t sequence = shared.read(out);
                                  if (sequence != 0) last = sequence;
                                  return last - kCount;
                                }));
  SlotPool<Message, 8, 2> pool({3, 3});
  std::printf("SlotPool: acquire, hand to two, finish, two loans %.1f ns\n",
              nanosecondsEach(kCount, [&](std::uint64_t) {
                const SlotHandle handle = pool.tryAcquire();
                (void)pool.tryHand(handle, 0);
                (void)pool.tryHand(handle, 1);
                pool.finish(handle);
                (void)pool.borrow(handle, 0);
                (void)pool.borrow(handle, 1);
              }));
}

}  // namespace swiftlet::test
