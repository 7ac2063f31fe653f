// Doorbell in every interleaving of small cases: no wake-up is lost, nothing is read before it was
// published, and each order and each indivisible step of it is needed.
//
// The kernel is modelled as what a futex promises: the check of the word and the falling asleep are one
// step, and a wake reaches who sleeps. A sleeper here has no bound: asleep with a ring not heard and no wake
// is a lost wake-up.

#include <array>
#include <catch2/catch.hpp>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "firmware_host/realtime/doorbell.hpp"
#include "tests/core/interleaving.hpp"

namespace swiftlet {
namespace {

namespace model = test::model;
using model::check;

/// How the sleeper leaves its program when it falls asleep for good.
struct Asleep {};

struct ModelSleep {
  template <typename T>
  using Atomic = model::Atomic<T>;

  static inline bool asleep = false;
  static inline bool woken = false;

  static void sleepWhile(model::Atomic<std::uint32_t>& word, std::uint32_t value, Duration) {
    // Adding nothing reads the newest value, as the kernel does under its lock.
    if (word.fetch_add(0, std::memory_order_relaxed) != value) return;
    asleep = true;
    throw Asleep{};
  }
  static void wake(model::Atomic<std::uint32_t>&) { woken = woken || asleep; }
};

constexpr Duration kModelWait = Duration::fromMilliseconds(1000);

struct State {
  State() { ModelSleep::asleep = ModelSleep::woken = false; }

  BasicDoorbell<ModelSleep> bell;
  std::array<model::Plain<int>, 2> items;         // one ringer: item i before ring i
  std::array<model::Atomic<int>, 2> flags{0, 0};  // two ringers: flag r before the ring of r
  int rings = 0;
  std::uint32_t slept_with = 0;
};

void ringTwice(State& s) {
  for (auto& item : s.items) {
    item = model::Plain<int>(1);
    ++s.rings;
    s.bell.ring();
  }
}

/// Reads what its ticket, or the end of its wait, promises.
void takeBoth(State& s) {
  const auto read = [&s](std::uint32_t i) { check(s.items[i].get() == 1, "not published"); };
  try {
    std::uint32_t taken = 0;
    while (taken < 2) {
      const std::uint32_t ticket = s.bell.ticket();
      check(ticket >= taken && ticket <= 2, "a count that nobody rang");
      for (; taken < ticket; ++taken) read(taken);
      if (taken == 2) break;
      s.slept_with = ticket;
      check(s.bell.wait(ticket, kModelWait), "gave up early");
      // A ring beyond the ticket: its item is there without another look at the bell.
      read(taken++);
    }
  } catch (const Asleep&) {
  }
}

template <std::size_t kRinger>
void ringOnce(State& s) {
  s.flags[kRinger].store(1, std::memory_order_relaxed);
  ++s.rings;
  s.bell.ring();
}

void takeFlags(State& s) {
  try {
    for (;;) {
      const std::uint32_t ticket = s.bell.ticket();
      int seen = 0;
      for (auto& flag : s.flags) seen += flag.load(std::memory_order_relaxed);
      check(seen >= static_cast<int>(ticket), "not published");
      if (seen == 2) break;
      s.slept_with = ticket;
      check(s.bell.wait(ticket, kModelWait), "gave up early");
    }
  } catch (const Asleep&) {
  }
}

void noneLost(State& s) {
  const std::uint32_t rung = s.bell.ticket();
  check(rung == static_cast<std::uint32_t>(s.rings), "a ring was not counted");
  check(!ModelSleep::asleep || ModelSleep::woken || rung == s.slept_with, "a wake-up was lost");
}

TEST_CASE("Doorbell is right in every interleaving, and each of its orders is needed", "[model]") {
  using Program = std::function<model::Outcome(const model::Mutation&)>;
  const std::vector<Program> programs = {
      [](const model::Mutation& m) {
        return model::explore<State>({takeBoth, ringTwice}, noneLost, m);
      },
      [](const model::Mutation& m) {
        return model::explore<State>({takeFlags, ringOnce<0>, ringOnce<1>}, noneLost, m);
      }};
  std::set<model::Mutation> mutations;
  std::uint64_t executions = 0;
  for (const Program& run : programs) {
    const model::Outcome outcome = run({});
    INFO(outcome.failure);
    CHECK(outcome.failure.empty());
    executions += outcome.executions;
    for (const model::Mutation& mutation : outcome.mutations) {
      if (mutation.text().find("doorbell.hpp") == 0) mutations.insert(mutation);
    }
  }
  CHECK(executions > 50);
  CHECK(mutations.size() >= 7);
  for (const model::Mutation& mutation : mutations) {
    INFO(mutation.text());
    bool caught = false;
    for (const Program& run : programs) caught = caught || !run(mutation).failure.empty();
    CHECK(caught);
  }
}

/// A sleeper that looks, then takes its ticket: what came between is slept through.
void ticketTooLate(State& s) {
  try {
    const bool there = s.flags[0].load(std::memory_order_relaxed) == 1;
    s.slept_with = 0;
    if (!there) s.bell.wait(s.bell.ticket(), kModelWait);
  } catch (const Asleep&) {
  }
}

TEST_CASE("a ticket taken after looking is caught", "[model]") {
  const model::Outcome outcome = model::explore<State>({ticketTooLate, ringOnce<0>}, noneLost);
  CHECK(!outcome.failure.empty());
}

}  // namespace
}  // namespace swiftlet
