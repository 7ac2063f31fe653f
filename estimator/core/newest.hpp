#pragma once
// Passes the newest value from one thread to one other: a triple buffer. Wait-free on both sides (one
// exchange each); neither waits for the other or retries because of it.
//
// Threads: one writer calls draft, publish, write; one reader calls refresh, value, sequence, read. For
// several readers use one Newest each, or NewestShared for small trivially copyable values.
// Values: anything default-constructible and assignable, including Eigen members; written and read in place.
// Values that the reader did not take are overwritten; sequence numbers show how many there were.
// Sequence: values are numbered from 1 in the order of publishing; 0 means that nothing was published yet.
//   The reader records the number of each value that it read, so that a run can be repeated.
// Memory: three values inside the object, each in its own cache lines.
// Cost: O(1); a refresh without a new value is one load.
//
// Why it is correct: the writer owns one of three buffers, the reader another, and the third changes owner by
// exchange of `middle_`. Release publishes what a thread did to the buffer that it gives away; acquire shows
// what the other thread did to the buffer that it gets. No buffer ever has two owners, and the middle one is
// the newest published or the one that the reader returned. (The exchange is one instruction on x86-64 and
// ARMv8.1; before that a load-linked pair, which the hardware may repeat.)

#include <array>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"

namespace swiftlet {

template <typename T, typename Policy = HardwareAtomics>
class Newest {
 public:
  using value_type = T;

  Newest() = default;
  Newest(const Newest&) = delete;
  Newest& operator=(const Newest&) = delete;

  /// Writer. The value to fill before publish(); it holds an older value.
  [[nodiscard]] T& draft() { return buffers_[writer_.buffer].value; }
  /// Writer. Publishes the draft; returns its sequence number.
  std::uint64_t publish() {
    buffers_[writer_.buffer].sequence = ++writer_.sequence;
    const std::uint32_t before = middle_.exchange(writer_.buffer | kFresh, std::memory_order_acq_rel);
    writer_.buffer = before & kBufferMask;
    return writer_.sequence;
  }
  std::uint64_t write(const T& value) {
    draft() = value;
    return publish();
  }

  /// Reader. Takes the newest value if there is a newer one; returns the sequence number of value().
  std::uint64_t refresh() {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) != 0) {
      reader_.buffer = middle_.exchange(reader_.buffer, std::memory_order_acq_rel) & kBufferMask;
    }
    return sequence();
  }
  /// Reader. The value taken by the last refresh(); valid and unchanged until the next.
  [[nodiscard]] const T& value() const { return buffers_[reader_.buffer].value; }
  [[nodiscard]] std::uint64_t sequence() const { return buffers_[reader_.buffer].sequence; }
  /// Reader. Copies the newest value and returns its number; 0, with `out` unchanged, while there is none.
  [[nodiscard]] std::uint64_t read(T& out) {
    const std::uint64_t taken = refresh();
    if (taken != 0) out = value();
    return taken;
  }

 private:
  static constexpr std::uint32_t kBufferMask = 3;
  static constexpr std::uint32_t kFresh = 4;  ///< the middle buffer was not taken yet

  struct alignas(kCacheLine) Buffer {
    T value{};
    std::uint64_t sequence = 0;
  };
  struct alignas(kCacheLine) Writer {
    std::uint32_t buffer = 0;
    std::uint64_t sequence = 0;
  };
  struct alignas(kCacheLine) Reader {
    std::uint32_t buffer = 2;
  };

  Writer writer_;
  Reader reader_;
  alignas(kCacheLine) typename Policy::template Atomic<std::uint32_t> middle_{1};
  std::array<Buffer, 3> buffers_{};
};

}  // namespace swiftlet
