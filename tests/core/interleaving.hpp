#pragma once
// Runs a small concurrent program in every way that the C++ memory model lets it run, within limits.
//
// The program is a state and a function for each thread. Whatever the threads share is a model::Atomic
// (each operation a scheduling point) or a model::Plain (an ordinary variable, on which a data race is a
// failure). `explore` runs it again and again, each time with another schedule and another choice of what
// each load sees, until all are done (stateless model checking, depth first). Neighbouring steps that
// commute are run in one order only (sleep sets, Godefroid 1996): that leaves out repetitions, nothing else.
//
// Memory model: a machine of messages and views (Kang et al., "A promising semantics for relaxed-memory
// concurrency", POPL 2017, without promises). A store leaves a message with its value. A load may read any
// message that is not older than the newest that its thread knows of. A release store attaches all that its
// thread knows, an acquire load takes over what is attached; read-modify-writes read the newest message and
// pass on what was attached to it (release sequences). So there are stores that become visible late (store
// buffers), loads that were done early, and processors that see two stores in different orders.
// Not modelled: a load that reads what a later step of its own thread made possible (load buffering), a store
// that goes before an older one in modification order (cells here have one writer, or are changed by
// read-modify-write), fences, seq_cst (refused).
//
// Mutations: every call of an atomic operation in the code under test is known by its place in the source.
// `mutations` lists what can be broken at the places met (acquire or release taken away, a read-modify-write
// made two steps); exploring with one of them must fail if the test is worth its name.

#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace swiftlet::test::model {

inline constexpr int kMaxThreads = 5;  ///< the last index is the set-up's
inline constexpr int kMaxCells = 48;   ///< atomics of one program

enum class Breakage : std::uint8_t { kNone, kNoAcquire, kNoRelease, kTwoSteps };

/// Where the code under test calls an atomic operation. (std::source_location is not in every compiler that
/// reads this.)
struct Place {
  const char* file = "";
  std::uint32_t line = 0;
  auto operator<=>(const Place&) const = default;

  /// As a default argument: where the call stands.
  static constexpr Place current(const char* file = __builtin_FILE(), std::uint32_t line = __builtin_LINE()) {
    return {file, line};
  }
};

/// One broken place of the code under test.
struct Mutation {
  Breakage breakage = Breakage::kNone;
  Place place{};
  auto operator<=>(const Mutation&) const = default;
  [[nodiscard]] std::string text() const;
};

struct Outcome {
  std::uint64_t executions = 0;     ///< runs to the end
  std::uint64_t cut = 0;            ///< runs given up as repetitions
  std::uint64_t steps = 0;          ///< atomic operations run
  std::string failure;              ///< the first one; empty when all runs were right
  std::vector<Mutation> mutations;  ///< that apply to the places met
};

/// Called inside a program: ends this run, and the exploration, with a failure.
void fail(const std::string& what);
inline void check(bool condition, const char* what) {
  if (!condition) fail(what);
}

/// A time on each thread's own count of events: what happened before what.
using Clock = std::array<std::uint16_t, kMaxThreads>;

namespace detail {

enum class Kind : std::uint8_t { kLoad, kStore, kModify };

struct Operation {
  int cell = 0;
  Kind kind = Kind::kLoad;
  bool acquire = false;
  bool release = false;
  std::uint64_t operand = 0;
  std::uint64_t expected = 0;                                       ///< of a compare-exchange
  std::uint64_t (*modify)(std::uint64_t, std::uint64_t) = nullptr;  ///< (old, operand) to new
  bool compares = false;
  bool failure_acquires = false;
};

int newCell(std::uint64_t value);
/// Runs one operation as a step of the current thread; returns the value read.
std::uint64_t perform(Operation operation, const Place& where);
Clock tick();  ///< counts an event of the current thread and returns what it knows
int currentThread();
Outcome explore(const std::function<std::vector<std::function<void()>>()>& begin,
                const std::function<void()>& end, const Mutation& mutation);

template <typename T>
std::uint64_t toBits(T value) {
  static_assert(std::is_integral_v<T>);
  return static_cast<std::uint64_t>(value);
}

}  // namespace detail

/// Stands for std::atomic of an integer.
template <typename T>
class Atomic {
  using Bits = std::uint64_t;

 public:
  Atomic() : Atomic(T{}) {}
  Atomic(T value) : cell_(detail::newCell(detail::toBits(value))) {}  // NOLINT: as std::atomic
  Atomic(const Atomic&) = delete;
  Atomic& operator=(const Atomic&) = delete;

  T load(std::memory_order order, const Place& where = Place::current()) const {
    return static_cast<T>(detail::perform(make(detail::Kind::kLoad, order, 0, nullptr), where));
  }
  void store(T value, std::memory_order order, const Place& where = Place::current()) {
    detail::perform(make(detail::Kind::kStore, order, detail::toBits(value), nullptr), where);
  }
  T exchange(T value, std::memory_order order, const Place& where = Place::current()) {
    return change(
        value, order, [](Bits, Bits operand) { return operand; }, where);
  }
  T fetch_or(T value, std::memory_order order, const Place& where = Place::current()) {
    return change(
        value, order, [](Bits old, Bits operand) { return old | operand; }, where);
  }
  T fetch_and(T value, std::memory_order order, const Place& where = Place::current()) {
    return change(
        value, order, [](Bits old, Bits operand) { return old & operand; }, where);
  }
  T fetch_add(T value, std::memory_order order, const Place& where = Place::current()) {
    return change(
        value, order, [](Bits old, Bits operand) { return old + operand; }, where);
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success, std::memory_order failure,
                               const Place& where = Place::current()) {
    detail::Operation operation = make(detail::Kind::kModify, success, detail::toBits(desired),
                                       [](Bits, Bits operand) { return operand; });
    operation.compares = true;
    operation.expected = detail::toBits(expected);
    operation.failure_acquires = failure != std::memory_order_relaxed;
    const T read = static_cast<T>(detail::perform(operation, where));
    const bool done = read == expected;
    expected = read;
    return done;
  }

 private:
  using Modify = Bits (*)(Bits, Bits);

  detail::Operation make(detail::Kind kind, std::memory_order order, Bits operand, Modify rule) const {
    check(order != std::memory_order_seq_cst && order != std::memory_order_consume,
          "an order that is not modelled");
    detail::Operation operation;
    operation.cell = cell_;
    operation.kind = kind;
    operation.acquire = order == std::memory_order_acquire || order == std::memory_order_acq_rel;
    operation.release = order == std::memory_order_release || order == std::memory_order_acq_rel;
    operation.operand = operand;
    operation.modify = rule;
    return operation;
  }
  T change(T value, std::memory_order order, Modify rule, const Place& where) {
    return static_cast<T>(
        detail::perform(make(detail::Kind::kModify, order, detail::toBits(value), rule), where));
  }

  int cell_;
};

/// An ordinary variable. Two accesses that no order of the memory model separates, one a write, are a
/// failure.
template <typename T>
class Plain {
 public:
  Plain() = default;
  Plain(T value) : value_(value) { write(); }  // NOLINT: stands for its value
  Plain(const Plain& other) : value_(other.get()) { write(); }
  Plain& operator=(const Plain& other) {
    const T value = other.get();
    write();
    value_ = value;
    return *this;
  }
  [[nodiscard]] T get() const {
    const Clock now = detail::tick();
    check(written_ <= now[static_cast<std::size_t>(writer_)], "data race: read beside a write");
    const auto me = static_cast<std::size_t>(detail::currentThread());
    reads_[me] = now[me];
    return value_;
  }

 private:
  void write() {
    const Clock now = detail::tick();
    check(written_ <= now[static_cast<std::size_t>(writer_)], "data race: write beside a write");
    for (std::size_t i = 0; i < kMaxThreads; ++i)
      check(reads_[i] <= now[i], "data race: write beside a read");
    writer_ = detail::currentThread();
    written_ = now[static_cast<std::size_t>(writer_)];
  }

  T value_{};
  int writer_ = 0;
  std::uint16_t written_ = 0;
  mutable Clock reads_{};
};

/// The policy under which the carriers are explored.
struct Atomics {
  template <typename T>
  using Atomic = model::Atomic<T>;
  static void require(bool condition, const char* what) { check(condition, what); }
};

/// All runs of the threads on a fresh State each, or all until the first that fails. `end` looks at the state
/// when every thread is through, and knows what they know.
template <typename State>
Outcome explore(const std::vector<void (*)(State&)>& threads, void (*end)(State&),
                const Mutation& mutation = {}) {
  std::unique_ptr<State> state;
  const auto begin = [&] {
    state = std::make_unique<State>();
    std::vector<std::function<void()>> bodies;
    bodies.reserve(threads.size());
    for (auto* thread : threads) bodies.emplace_back([thread, &state] { thread(*state); });
    return bodies;
  };
  return detail::explore(
      begin, [&] { end(*state); }, mutation);
}

}  // namespace swiftlet::test::model
