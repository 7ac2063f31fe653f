// The explorer itself, on the memory model's textbook programs: what must be possible is found, what must not
// be is not.

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>
#include <utility>

#include "tests/core/interleaving.hpp"

namespace swiftlet::test {
namespace {

using model::Atomic;
using model::explore;
using model::Outcome;
using model::Plain;
using std::memory_order_acq_rel;
using std::memory_order_acquire;
using std::memory_order_relaxed;
using std::memory_order_release;

/// What the runs of one program saw, gathered over all of them.
std::set<std::pair<int, int>> seen;

struct Two {
  Atomic<int> x{0};
  Atomic<int> y{0};
  Plain<int> data{0};
  int a = -1;
  int b = -1;
  int c = -1;
  int d = -1;
};

void gather(Two& s) { seen.insert({s.a, s.b}); }
void ignore(Two&) {}

}  // namespace

TEST_CASE("explorer: without reduction two threads of two stores have six schedules, two that differ a cell",
          "[core][model]") {
  // Stores to one cell do not commute: C(4, 2) schedules.
  const Outcome same = explore<Two>({[](Two& s) {
                                       s.x.store(1, memory_order_relaxed);
                                       s.x.store(2, memory_order_relaxed);
                                     },
                                     [](Two& s) {
                                       s.x.store(3, memory_order_relaxed);
                                       s.x.store(4, memory_order_relaxed);
                                     }},
                                    ignore);
  CHECK(same.executions == 6);
  CHECK(same.failure.empty());
  // Stores to different cells do: one is enough.
  const Outcome apart = explore<Two>({[](Two& s) { s.x.store(1, memory_order_relaxed); },
                                      [](Two& s) { s.y.store(1, memory_order_relaxed); }},
                                     ignore);
  CHECK(apart.executions == 1);
}

TEST_CASE("explorer: stores may be seen late, on both sides at once", "[core][model]") {
  seen.clear();
  explore<Two>({[](Two& s) {
                  s.x.store(1, memory_order_release);
                  s.a = s.y.load(memory_order_acquire);
                },
                [](Two& s) {
                  s.y.store(1, memory_order_release);
                  s.b = s.x.load(memory_order_acquire);
                }},
               gather);
  CHECK(seen == std::set<std::pair<int, int>>{{0, 0}, {0, 1}, {1, 0}, {1, 1}});
}

TEST_CASE("explorer: a message passes with release and acquire, and only with both", "[core][model]") {
  const auto program = [](auto send, auto take) {
    seen.clear();
    explore<Two>({send, take}, gather);
    return seen.contains({1, 0});
  };
  const auto send = [](Two& s) {
    s.x.store(1, memory_order_relaxed);
    s.y.store(1, memory_order_release);
  };
  const auto send_relaxed = [](Two& s) {
    s.x.store(1, memory_order_relaxed);
    s.y.store(1, memory_order_relaxed);
  };
  const auto take = [](Two& s) {
    s.a = s.y.load(memory_order_acquire);
    s.b = s.x.load(memory_order_relaxed);
  };
  const auto take_relaxed = [](Two& s) {
    s.a = s.y.load(memory_order_relaxed);
    s.b = s.x.load(memory_order_relaxed);
  };
  CHECK_FALSE(program(send, take));
  CHECK(program(send_relaxed, take));
  CHECK(program(send, take_relaxed));
}

TEST_CASE("explorer: one cell is read in order by each thread, whatever the order asked for",
          "[core][model]") {
  seen.clear();
  explore<Two>({[](Two& s) {
                  s.x.store(1, memory_order_relaxed);
                  s.x.store(2, memory_order_relaxed);
                },
                [](Two& s) {
                  s.a = s.x.load(memory_order_relaxed);
                  s.b = s.x.load(memory_order_relaxed);
                }},
               gather);
  CHECK(seen == std::set<std::pair<int, int>>{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}});
}

TEST_CASE("explorer: two readers may see two stores in different orders", "[core][model]") {
  static bool apart;
  apart = false;
  explore<Two>(
      {[](Two& s) { s.x.store(1, memory_order_release); }, [](Two& s) { s.y.store(1, memory_order_release); },
       [](Two& s) {
         s.a = s.x.load(memory_order_acquire);
         s.b = s.y.load(memory_order_acquire);
       },
       [](Two& s) {
         s.c = s.y.load(memory_order_acquire);
         s.d = s.x.load(memory_order_acquire);
       }},
      [](Two& s) { apart = apart || (s.a == 1 && s.b == 0 && s.c == 1 && s.d == 0); });
  CHECK(apart);
}

TEST_CASE("explorer: read-modify-writes lose no count and pass on what a release attached", "[core][model]") {
  const auto end = [](Two& s) { model::check(s.x.load(memory_order_relaxed) == 3, "a count was lost"); };
  const auto add = [](Two& s) { s.x.fetch_or(1, memory_order_relaxed); };
  const auto add_two = [](Two& s) { s.x.fetch_or(2, memory_order_relaxed); };
  const Outcome whole = explore<Two>({add, add_two}, end);
  CHECK(whole.failure.empty());
  CHECK(whole.executions == 2);
  REQUIRE(whole.mutations.size() == 2);  // the two places, in two steps
  CHECK(explore<Two>({add, add_two}, end, whole.mutations[0]).failure == "a count was lost");

  // A relaxed exchange between a release and its acquire keeps the release's message.
  const Outcome sequence = explore<Two>({[](Two& s) {
                                           s.data = Plain<int>(7);
                                           s.x.store(1, memory_order_release);
                                         },
                                         [](Two& s) { s.x.fetch_or(2, memory_order_relaxed); },
                                         [](Two& s) {
                                           if (s.x.load(memory_order_acquire) == 3) s.a = s.data.get();
                                         }},
                                        ignore);
  CHECK(sequence.failure.empty());
  CHECK(sequence.executions > 3);
}

TEST_CASE("explorer: a compare-exchange has one winner", "[core][model]") {
  const auto first = [](Two& s) {
    int expected = 0;
    s.a = s.x.compare_exchange_strong(expected, 1, memory_order_acq_rel, memory_order_acquire) ? 1 : 0;
  };
  const auto second = [](Two& s) {
    int expected = 0;
    s.b = s.x.compare_exchange_strong(expected, 2, memory_order_acq_rel, memory_order_acquire) ? 1 : 0;
  };
  const auto end = [](Two& s) { model::check(s.a + s.b == 1, "not one winner"); };
  const Outcome whole = explore<Two>({first, second}, end);
  CHECK(whole.failure.empty());
  const auto split =
      std::find_if(whole.mutations.begin(), whole.mutations.end(),
                   [](const model::Mutation& m) { return m.breakage == model::Breakage::kTwoSteps; });
  REQUIRE(split != whole.mutations.end());
  CHECK(explore<Two>({first, second}, end, *split).failure == "not one winner");
}

TEST_CASE("explorer: ordinary variables race unless something orders them", "[core][model]") {
  const auto write = [](Two& s) {
    s.data = Plain<int>(7);
    s.x.store(1, memory_order_release);
  };
  const auto read_when_told = [](Two& s) {
    if (s.x.load(memory_order_acquire) == 1) model::check(s.data.get() == 7, "an old value");
  };
  const auto read_at_once = [](Two& s) {
    if (s.x.load(memory_order_relaxed) == 1) s.a = s.data.get();
  };
  const auto write_too = [](Two& s) {
    if (s.x.load(memory_order_relaxed) == 1) s.data = Plain<int>(8);
  };
  CHECK(explore<Two>({write, read_when_told}, ignore).failure.empty());
  CHECK(explore<Two>({write, read_at_once}, ignore).failure == "data race: read beside a write");
  CHECK(explore<Two>({write, write_too}, ignore).failure == "data race: write beside a write");
  // The writer comes back while the reader may still be reading.
  const auto write_again = [](Two& s) {
    s.data = Plain<int>(7);
    s.x.store(1, memory_order_release);
    s.data = Plain<int>(8);
  };
  CHECK(explore<Two>({write_again, read_when_told}, ignore).failure.find("data race") == 0);
}

}  // namespace swiftlet::test
