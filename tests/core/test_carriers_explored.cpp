// The carriers between threads, run in every interleaving and with every stale read of small cases, and each
// acquire, release and indivisible step of theirs taken away in turn: at least one case must then fail.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "estimator/core/drop_oldest_ring.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/newest_shared.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "tests/core/interleaving.hpp"

namespace swiftlet::test {
namespace {

using model::check;
using model::Mutation;
using model::Outcome;
using model::Plain;

using Program = std::function<Outcome(const Mutation&)>;

template <typename State>
Program program(std::vector<void (*)(State&)> threads, void (*end)(State&)) {
  return [=](const Mutation& mutation) { return model::explore<State>(threads, end, mutation); };
}

/// Every program is right in all its runs, together `at_least` so many. In `file` there are `places` where an
/// order or an indivisible step can be taken away; each makes one of the programs fail, but for those
/// `beyond_the_model`.
void prove(const std::vector<Program>& programs, std::uint64_t at_least, const std::string& file,
           std::size_t places, std::size_t beyond_the_model = 0) {
  std::uint64_t executions = 0;
  std::string counts;
  std::set<Mutation> mutations;
  for (const Program& run : programs) {
    const Outcome outcome = run({});
    INFO(outcome.failure);
    CHECK(outcome.failure.empty());
    CHECK(outcome.executions > 1);
    executions += outcome.executions;
    counts += std::to_string(outcome.executions) + " runs, " + std::to_string(outcome.cut) + " cut, " +
              std::to_string(outcome.steps) + " steps; ";
    for (const Mutation& mutation : outcome.mutations) {
      if (mutation.text().find(file) == 0) mutations.insert(mutation);
    }
  }
  INFO(counts);
  CHECK(executions >= at_least);
  CHECK(mutations.size() == places);
  std::string survivors;
  std::size_t survived = 0;
  for (const Mutation& mutation : mutations) {
    const bool caught = std::any_of(programs.begin(), programs.end(),
                                    [&](const Program& run) { return !run(mutation).failure.empty(); });
    if (caught) continue;
    ++survived;
    survivors += mutation.text() + "; ";
  }
  INFO("not caught: " << survivors);
  CHECK(survived == beyond_the_model);
}

// ---- SpscRing -----------------------------------------------------------------------------------

template <std::size_t kCapacity>
struct RingState {
  SpscRing<Plain<int>, kCapacity, std::uint8_t, model::Atomics> ring;
  int pushed = 0;
  int popped = 0;

  /// The next value in line goes in when there is room.
  void push() {
    if (ring.tryPush(Plain<int>(pushed + 1))) ++pushed;
  }
  void pop() {
    Plain<int> value;
    if (ring.tryPop(value)) check(value.get() == ++popped, "out of order, lost or doubled");
  }
  void end() {
    while (popped < pushed) {
      const int before = popped;
      pop();
      check(popped == before + 1, "lost");
    }
    check(ring.front() == nullptr, "more than was pushed");
    check(ring.size() == 0, "an empty ring's size");
  }
};

template <std::size_t kCapacity, int kCalls>
Program ringProgram() {
  using State = RingState<kCapacity>;
  return program<State>({[](State& s) {
                           for (int i = 0; i < kCalls; ++i) s.push();
                         },
                         [](State& s) {
                           for (int i = 0; i < kCalls; ++i) s.pop();
                         }},
                        [](State& s) { s.end(); });
}

/// What size() promises to each side, and to a third thread.
Program ringSizeProgram() {
  using State = RingState<2>;
  return program<State>({[](State& s) {
                           s.push();
                           if (s.ring.size() < 2) {
                             s.push();
                             check(s.pushed == 2, "size said that there was room");
                           }
                         },
                         [](State& s) {
                           if (s.ring.size() > 0) {
                             s.pop();
                             check(s.popped == 1, "size said that there was one");
                           }
                         }},
                        [](State& s) { s.end(); });
}
Program ringObservedProgram() {
  using State = RingState<2>;
  return program<State>({[](State& s) { s.push(); }, [](State& s) { s.pop(); },
                         [](State& s) { check(s.ring.size() <= 1, "an impossible size"); }},
                        [](State& s) { s.end(); });
}

/// A ring with its steps in the wrong order, to show that the programs above would see it.
struct HastyRing {
  model::Atomic<int> published{0};
  Plain<int> item{0};
  int got = 0;
};

// ---- DropOldestRing -----------------------------------------------------------------------------

/// Two words, so that a torn value shows.
struct Pair {
  int first = 0;
  std::array<int, 2> rest{};
};
Pair pairOf(int n) { return {n, {n + 1, n + 2}}; }
void checkWhole(const Pair& pair) {
  check(pair.rest[0] == pair.first + 1 && pair.rest[1] == pair.first + 2, "torn");
}

template <std::size_t kCapacity>
struct DropState {
  DropOldestRing<Pair, kCapacity, model::Atomics> ring;
  int pushed = 0;
  int last = 0;         ///< newest value taken or dropped by the thread that asks
  std::set<int> taken;  ///< by the consumer
  std::set<int> gone;   ///< given back to the producer

  void push() {
    Pair dropped;
    const bool drops = ring.push(pairOf(++pushed), dropped);
    if (!drops) return;
    checkWhole(dropped);
    check(dropped.first == pushed - static_cast<int>(kCapacity), "not the oldest was dropped");
    gone.insert(dropped.first);
  }
  bool pop() {
    Pair value;
    if (!ring.tryPop(value)) return false;
    checkWhole(value);
    check(value.first > last, "out of order or doubled");
    last = value.first;
    taken.insert(value.first);
    return true;
  }
  void end() {
    while (pop()) {
    }
    for (int i = 1; i <= pushed; ++i)
      check(taken.contains(i) != gone.contains(i), "taken and dropped, or neither");
    check(static_cast<int>(taken.size() + gone.size()) == pushed, "a value that was never pushed");
    check(ring.dropped() == gone.size(), "miscounted");
    check(ring.size() == 0, "an empty ring's size");
  }
};

template <std::size_t kCapacity, int kPushes, int kPops>
Program dropProgram() {
  using State = DropState<kCapacity>;
  return program<State>({[](State& s) {
                           for (int i = 0; i < kPushes; ++i) s.push();
                         },
                         [](State& s) {
                           for (int i = 0; i < kPops; ++i) s.pop();
                         }},
                        [](State& s) { s.end(); });
}
Program dropObservedProgram() {
  using State = DropState<2>;
  return program<State>({[](State& s) { s.push(); }, [](State& s) { s.pop(); },
                         [](State& s) { check(s.ring.size() <= 1, "an impossible size"); }},
                        [](State& s) { s.end(); });
}

// ---- Newest, NewestShared -----------------------------------------------------------------------

struct NewestState {
  Newest<Plain<int>, model::Atomics> newest;
  std::uint64_t last = 0;

  void read() {
    Plain<int> value(-1);
    const std::uint64_t sequence = newest.read(value);
    check(sequence >= last, "older than before");
    check(value.get() == (sequence == 0 ? -1 : static_cast<int>(sequence) * 10),
          "not the value of its number");
    last = sequence;
  }
};

template <int kWrites, int kReads>
Program newestProgram() {
  using State = NewestState;
  return program<State>({[](State& s) {
                           for (int i = 1; i <= kWrites; ++i) s.newest.write(Plain<int>(i * 10));
                         },
                         [](State& s) {
                           for (int i = 0; i < kReads; ++i) s.read();
                         }},
                        [](State& s) {
                          s.read();
                          check(s.last == kWrites, "not the newest");
                        });
}

template <std::size_t kCells, int kAttempts>
struct SharedState {
  NewestShared<Pair, kCells, kAttempts, model::Atomics> newest;

  void read(std::uint64_t& last, int writes) {
    Pair value = pairOf(-1);
    const std::uint64_t overtaken = newest.overtaken();
    const std::uint64_t sequence = newest.read(value);
    checkWhole(value);
    check(value.first == (sequence == 0 ? -1 : static_cast<int>(sequence)), "not the value of its number");
    if (sequence == 0 && last != 0) check(newest.overtaken() > overtaken, "gone again");
    if (sequence != 0) check(sequence >= last, "older than before");
    // To overtake a read, the writer must begin kCells values after the one that is being copied.
    if (writes <= static_cast<int>(kCells)) check(newest.overtaken() == 0, "overtaken without reason");
    if (sequence != 0) last = sequence;
  }
};

template <std::size_t kCells, int kAttempts, int kWrites, int kReads, bool kSecondReader>
Program sharedProgram() {
  using State = SharedState<kCells, kAttempts>;
  const auto reader = [](State& s) {
    std::uint64_t last = 0;
    for (int i = 0; i < kReads; ++i) s.read(last, kWrites);
  };
  std::vector<void (*)(State&)> threads = {[](State& s) {
                                             for (int i = 1; i <= kWrites; ++i) s.newest.write(pairOf(i));
                                           },
                                           reader};
  if (kSecondReader) threads.push_back(reader);
  return program<State>(threads, [](State& s) {
    std::uint64_t last = 0;
    s.read(last, kWrites);
    check(last == kWrites, "not the newest");
  });
}

// ---- SlotPool, with the rings that carry its handles ---------------------------------------------

template <std::size_t kSlots, std::size_t kReaders, std::uint32_t kQuota>
struct PoolState {
  using Pool = SlotPool<Plain<int>, kSlots, kReaders, model::Atomics>;
  using Ring = SpscRing<SlotHandle, 2, std::uint64_t, model::Atomics>;

  static typename Pool::Quotas quotas() {
    typename Pool::Quotas all{};
    all.fill(kQuota);
    return all;
  }
  Pool pool{quotas()};
  std::array<Ring, kReaders> rings;
  std::array<int, kReaders> handed{};
  std::array<int, kReaders> got{};

  static int contentOf(SlotHandle handle) { return static_cast<int>(handle.generation * 100 + handle.slot); }

  /// One message to all readers; skipped when no slot is free, which enough slots rule out.
  void write() {
    const SlotHandle handle = pool.tryAcquire();
    if (!handle.valid()) {
      check(kSlots < Pool::slotsFor(quotas()), "no slot left although every reader kept its quota");
      return;
    }
    pool.fill(handle) = Plain<int>(contentOf(handle));
    for (std::size_t r = 0; r < kReaders; ++r) {
      if (!pool.tryHand(handle, r)) continue;
      if (rings[r].tryPush(handle)) {
        ++handed[r];
      } else {
        pool.takeBack(handle, r);
      }
    }
    pool.finish(handle);
  }
  void read(std::size_t reader) {
    SlotHandle handle;
    if (!rings[reader].tryPop(handle)) return;
    const auto loan = pool.borrow(handle, reader);
    check(static_cast<bool>(loan), "a handle that was not lent");
    check(loan->get() == contentOf(handle), "not what was written for it");
    ++got[reader];
  }
  void end() {
    for (std::size_t r = 0; r < kReaders; ++r) {
      while (rings[r].size() > 0) read(r);
      check(got[r] == handed[r], "a message lost or doubled");
    }
    check(pool.inUse() == 0, "a slot that nobody gives back");
    check(pool.misused() == 0, "misuse");
  }
};

template <std::size_t kSlots, std::uint32_t kQuota, int kWrites, int kReads>
Program oneReaderProgram() {
  using State = PoolState<kSlots, 1, kQuota>;
  return program<State>({[](State& s) {
                           for (int i = 0; i < kWrites; ++i) s.write();
                         },
                         [](State& s) {
                           for (int i = 0; i < kReads; ++i) s.read(0);
                         }},
                        [](State& s) { s.end(); });
}
/// Both readers must be through before the only slot is filled again.
Program twoReadersProgram() {
  using State = PoolState<1, 2, 1>;
  return program<State>({[](State& s) {
                           s.write();
                           const SlotHandle again = s.pool.tryAcquire();
                           if (!again.valid()) return;
                           s.pool.fill(again) = Plain<int>(0);
                           s.pool.finish(again);
                         },
                         [](State& s) { s.read(0); }, [](State& s) { s.read(1); }},
                        [](State& s) { s.end(); });
}
/// A reader's ring is full, and what was handed is taken back while the other reader lets go.
Program takenBackProgram() {
  using State = PoolState<1, 2, 1>;
  return program<State>({[](State& s) {
                           const SlotHandle handle = s.pool.tryAcquire();
                           s.pool.fill(handle) = Plain<int>(State::contentOf(handle));
                           check(s.pool.tryHand(handle, 0) && s.rings[0].tryPush(handle), "no room");
                           s.handed[0] = 1;
                           check(s.pool.tryHand(handle, 1), "over the quota");
                           s.pool.takeBack(handle, 1);
                           s.pool.finish(handle);
                         },
                         [](State& s) { s.read(0); }},
                        [](State& s) { s.end(); });
}

/// Frames in front of a reader that is too slow: the oldest handle comes back to the writer. One on loan, one
/// waiting, one handed before the waiting one comes back: a quota of three never refuses.
struct DropPoolState {
  SlotPool<Plain<int>, 4, 1, model::Atomics> pool{{3}};
  DropOldestRing<SlotHandle, 1, model::Atomics> ring;
  int read = 0;

  void write() {
    const SlotHandle handle = pool.tryAcquire();
    check(handle.valid(), "no slot left");
    pool.fill(handle) = Plain<int>(static_cast<int>(handle.slot));
    check(pool.tryHand(handle, 0), "over the quota");
    SlotHandle dropped;
    if (ring.push(handle, dropped)) pool.takeBack(dropped, 0);
    pool.finish(handle);
  }
  void take() {
    SlotHandle handle;
    if (!ring.tryPop(handle)) return;
    const auto loan = pool.borrow(handle, 0);
    check(loan && loan->get() == static_cast<int>(handle.slot), "not what was written for it");
    ++read;
  }
};

Program dropPoolProgram() {
  return program<DropPoolState>({[](DropPoolState& s) {
                                   for (int i = 0; i < 3; ++i) s.write();
                                 },
                                 [](DropPoolState& s) { s.take(); }},
                                [](DropPoolState& s) {
                                  s.take();
                                  check(static_cast<int>(s.ring.dropped()) + s.read == 3,
                                        "a frame lost or doubled");
                                  check(s.pool.inUse() == 0, "a slot that nobody gives back");
                                });
}

}  // namespace

TEST_CASE("SpscRing is right in every interleaving, and each of its orders is needed", "[core][model]") {
  prove({ringProgram<1, 3>(), ringProgram<2, 4>(), ringSizeProgram(), ringObservedProgram()}, 2000,
        "spsc_ring.hpp", 5);
}

TEST_CASE("a ring that hands over before it fills is caught", "[core][model]") {
  const Outcome outcome =
      model::explore<HastyRing>({[](HastyRing& s) {
                                   s.published.store(1, std::memory_order_release);
                                   s.item = Plain<int>(7);
                                 },
                                 [](HastyRing& s) {
                                   if (s.published.load(std::memory_order_acquire) == 1) s.got = s.item.get();
                                 }},
                                [](HastyRing& s) { check(s.got == 0 || s.got == 7, "not filled"); });
  CHECK_FALSE(outcome.failure.empty());
}

TEST_CASE("DropOldestRing is right in every interleaving, and each of its orders is needed",
          "[core][model]") {
  // Beyond the model: the acquire with which a failing claim sees the consumer's. Without it a copy could
  // read what is stored later because of it (load buffering), which no run here can show.
  prove({dropObservedProgram(), dropProgram<1, 3, 1>(), dropProgram<2, 4, 1>(), dropProgram<1, 2, 2>()}, 1000,
        "drop_oldest_ring.hpp", 10, 1);
}

TEST_CASE("Newest is right in every interleaving, and each of its orders is needed", "[core][model]") {
  prove({newestProgram<4, 3>()}, 500, "newest.hpp", 6);
}

TEST_CASE("NewestShared is right in every interleaving, and each of its orders is needed", "[core][model]") {
  const std::vector<Program> programs = {sharedProgram<1, 1, 2, 2, false>(),
                                         sharedProgram<2, 1, 3, 2, false>(),
                                         sharedProgram<1, 2, 1, 1, true>()};
  prove(programs, 1000, "newest_shared.hpp", 2);
  prove(programs, 1000, "atomic_words.hpp", 2);
}

TEST_CASE("SlotPool is right in every interleaving, and each of its orders is needed", "[core][model]") {
  prove({oneReaderProgram<2, 1, 3, 2>(), oneReaderProgram<1, 1, 2, 2>(), twoReadersProgram(),
         takenBackProgram(), dropPoolProgram()},
        5000, "slot_pool.hpp", 8);
}

// ---- Misuse, found in every build because the model's policy reports it ---------------------------

TEST_CASE("a handle used by who does not hold it is recognised", "[core][model]") {
  using Pool = SlotPool<Plain<int>, 2, 2, model::Atomics>;
  struct State {
    Pool pool{{2, 2}};
  };
  const auto misuse = [](void (*use)(State&)) { return model::explore<State>({use}, [](State&) {}).failure; };
  const std::string message = "a slot's handle used by who does not hold it";
  CHECK(misuse([](State& s) {
          const SlotHandle handle = s.pool.tryAcquire();
          check(s.pool.tryHand(handle, 0), "refused");
          s.pool.release(handle, 0);
          s.pool.finish(handle);
        }).empty());
  CHECK(misuse([](State& s) {  // released twice while another reader still holds the slot
          const SlotHandle handle = s.pool.tryAcquire();
          check(s.pool.tryHand(handle, 0) && s.pool.tryHand(handle, 1), "refused");
          s.pool.release(handle, 0);
          s.pool.release(handle, 0);
        }) == message);
  CHECK(misuse([](State& s) {  // a handle from an earlier life of the slot, which the same reader holds again
          const SlotHandle old = s.pool.tryAcquire();
          s.pool.finish(old);
          SlotHandle handle = s.pool.tryAcquire();
          while (handle.slot != old.slot) {
            s.pool.finish(handle);
            handle = s.pool.tryAcquire();
          }
          check(s.pool.tryHand(handle, 0), "refused");
          (void)s.pool.borrow(old, 0);
        }) == message);
  CHECK(misuse([](State& s) { (void)s.pool.borrow(SlotHandle{}, 0); }) == message);
  CHECK(misuse([](State& s) {
          const SlotHandle handle = s.pool.tryAcquire();
          (void)s.pool.tryHand(handle, 2);  // no such reader
        }) == message);
  CHECK(misuse([](State& s) {
          const SlotHandle handle = s.pool.tryAcquire();
          s.pool.finish(handle);
          (void)s.pool.fill(handle);
        }) == "fill of a slot that the writer does not hold");
}

TEST_CASE("a ring's commit and pop want a begin and a front", "[core][model]") {
  using Ring = SpscRing<int, 1, std::uint8_t, model::Atomics>;
  struct State {
    Ring ring;
  };
  CHECK(model::explore<State>({[](State& s) {
                                check(s.ring.beginPush() != nullptr, "full");
                                s.ring.commitPush();
                                s.ring.commitPush();
                              }},
                              [](State&) {})
            .failure == "commit without begin");
  CHECK(model::explore<State>({[](State& s) { s.ring.pop(); }}, [](State&) {}).failure ==
        "pop without front");
}

}  // namespace swiftlet::test
