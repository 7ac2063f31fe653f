#pragma once
// A queue of fixed capacity from one thread to one other whose push always succeeds: when it is full, the
// oldest waiting value goes, is counted, and is given back to the producer (a slot's handle must be
// returned to its pool). The queue of frames in front of the tracker: old frames are the ones to lose.
//
// Threads: one producer calls push; one consumer calls tryPop; size() and dropped() are for anyone.
// Values: small and trivially copyable (handles), kept as atomic words.
// Memory: kCapacity values inside the object and one cache line a side.
// Cost: push O(1) and wait-free, one compare-exchange when it finds the ring full. tryPop: one
//   compare-exchange; it starts again when a push dropped the very value it was taking, at most
//   kPopAttempts times, each of which costs the producer a whole push.
//
// Why this and not a shorter way. Letting the consumer skip to the newest N would drop the newest when the
// consumer is stopped for longer than the ring lasts; an overwriting ring in which the consumer finds
// torn values leaves open who owns what was overwritten. Here producer and consumer claim the oldest value
// by the same compare-exchange of `tail` from t to t + 1: exactly one wins, so a value is either taken or
// dropped, never both, never neither, and values leave in order.
// Why a taken value is whole: the consumer copies value t first and claims it second. Its cell is written
// again only after the producer knows a tail beyond t. Either the producer moved the tail itself: the
// claim fails and the copy is thrown away. Or it saw the consumer's claim: that release, acquired, puts
// the copying before the overwriting. The cell's words are atomic, so that a copy made for nothing is no
// data race. (A tail that comes round to the same 64-bit value between copy and claim does not happen.)
// Capacity 1: between dropping and publishing, the consumer may find the ring empty for some nanoseconds;
// the value that follows is announced by the producer as any other is.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"
#include "estimator/core/atomic_words.hpp"

namespace swiftlet {

template <typename T, std::size_t kCapacity, typename Policy = HardwareAtomics>
class DropOldestRing {
  static_assert(kCapacity >= 1);

 public:
  using value_type = T;
  /// A pop that was beaten this often has lost as many values as most rings hold: it reports nothing taken.
  static constexpr int kPopAttempts = 8;

  DropOldestRing() = default;
  DropOldestRing(const DropOldestRing&) = delete;
  DropOldestRing& operator=(const DropOldestRing&) = delete;

  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }

  /// Producer. True when the oldest waiting value had to go; it is then in `dropped`, which is otherwise
  /// left as it was, and belongs to the producer again: the consumer never had it and never will.
  [[nodiscard]] bool push(const T& value, T& dropped) {
    const bool drops = producer_.head - producer_.tail_seen == kCapacity && claimOldest();
    if (drops) {
      dropped = cells_[producer_.head % kCapacity].load(std::memory_order_relaxed);  // our own stores
      producer_.dropped.add();
    }
    cells_[producer_.head % kCapacity].store(value, std::memory_order_relaxed);
    producer_.published.store(++producer_.head, std::memory_order_release);
    return drops;
  }

  /// Consumer. False, and `out` untouched, when empty (or beaten kPopAttempts times).
  [[nodiscard]] bool tryPop(T& out) {
    // Acquired, also below: after a tail that the producer moved, the head read next is not behind it.
    std::uint64_t tail = tail_.load(std::memory_order_acquire);
    for (int attempt = 0; attempt < kPopAttempts; ++attempt) {
      if (producer_.published.load(std::memory_order_acquire) == tail) return false;
      const T candidate = cells_[tail % kCapacity].load(std::memory_order_relaxed);
      if (tail_.compare_exchange_strong(tail, tail + 1, std::memory_order_release,
                                        std::memory_order_acquire)) {
        out = candidate;
        return true;
      }
    }
    return false;
  }

  /// Values waiting; an estimate for any thread but the producer, for which it is never too small.
  [[nodiscard]] std::size_t size() const {
    const std::uint64_t tail = tail_.load(std::memory_order_acquire);
    const std::uint64_t waiting = producer_.published.load(std::memory_order_relaxed) - tail;
    return waiting < kCapacity ? static_cast<std::size_t>(waiting) : kCapacity;
  }

  /// Values that the consumer was too late for.
  [[nodiscard]] std::uint64_t dropped() const { return producer_.dropped.value(); }

 private:
  struct alignas(kCacheLine) Producer {
    typename Policy::template Atomic<std::uint64_t> published{0};  ///< head: values handed over so far
    std::uint64_t head = 0;                                        ///< the producer's own copy
    std::uint64_t tail_seen = 0;                                   ///< the newest tail that it knows
    EventCount dropped;
  };

  /// Moves the tail past the oldest value, unless the consumer has already done so. Room for one either way.
  bool claimOldest() {
    const std::uint64_t oldest = producer_.tail_seen;
    if (tail_.compare_exchange_strong(producer_.tail_seen, oldest + 1, std::memory_order_release,
                                      std::memory_order_acquire)) {
      producer_.tail_seen = oldest + 1;
      return true;
    }
    return false;
  }

  Producer producer_;
  alignas(kCacheLine)
      typename Policy::template Atomic<std::uint64_t> tail_{0};  ///< the oldest not yet claimed
  alignas(kCacheLine) std::array<AtomicWords<T, Policy>, kCapacity> cells_{};
};

}  // namespace swiftlet
