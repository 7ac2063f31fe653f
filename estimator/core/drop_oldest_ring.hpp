#pragma once
// A queue of fixed capacity from one thread to one other whose push always succeeds. When it is full, the
// oldest waiting value is dropped, counted and returned to the producer (a slot's handle must go back to its
// pool). Used for the frames in front of the tracker, where old frames are the ones to drop.
//
// Threads: one producer calls push, one consumer calls tryPop; any thread may call size() and dropped().
// Values: small and trivially copyable (handles), stored as atomic words.
// Memory: kCapacity values inside the object and one cache line per side.
// Cost: push is O(1) and wait-free, with one compare-exchange if the ring is full. tryPop takes one
// compare-exchange. It restarts if a push dropped the value that it was taking, at most kPopAttempts times;
// each restart takes the producer one complete push.
//
// Alternatives. Letting the consumer skip to the newest N would drop the newest values if the consumer stops
// for longer than the ring lasts. An overwriting ring in which the consumer detects torn values leaves the
// ownership of overwritten values open. Here producer and consumer claim the oldest value by the same
// compare-exchange of `tail` from t to t + 1. Exactly one wins, so a value is either taken or dropped, and
// values leave in order.
//
// Why a taken value is complete: the consumer first copies value t and then claims it. The cell is
// overwritten only after the producer knows a tail beyond t. If the producer moved the tail itself, the claim
// fails and the copy is discarded. If it saw the consumer's claim, the acquire of that release orders the
// copying before the overwriting. The words of a cell are atomic, so a discarded copy is no data race. (The
// tail does not wrap around to the same 64-bit value between copy and claim.) Capacity 1: between dropping
// and publishing, the consumer may find the ring empty for some nanoseconds; the producer announces the
// following value as usual.

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
  /// After this many failed attempts tryPop reports an empty ring; by then about a full ring of values was
  /// dropped.
  static constexpr int kPopAttempts = 8;

  DropOldestRing() = default;
  DropOldestRing(const DropOldestRing&) = delete;
  DropOldestRing& operator=(const DropOldestRing&) = delete;

  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }

  /// Producer. True if the oldest waiting value was dropped. It is then in `dropped` (otherwise unchanged)
  /// and belongs to the producer again; the consumer never gets it.
  [[nodiscard]] bool push(const T& value, T& dropped) {
    const bool drops = producer_.head - producer_.tail_seen == kCapacity && claimOldest();
    if (drops) {
      dropped = cells_[producer_.head % kCapacity].load(std::memory_order_relaxed);  // own stores
      producer_.dropped.add();
    }
    cells_[producer_.head % kCapacity].store(value, std::memory_order_relaxed);
    producer_.published.store(++producer_.head, std::memory_order_release);
    return drops;
  }

  /// Consumer. False, with `out` unchanged, if empty (or after kPopAttempts failed attempts).
  [[nodiscard]] bool tryPop(T& out) {
    // Acquire, so that the head read next is not older than a tail that the producer moved.
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

  /// Number of waiting values; an estimate, but never too small for the producer.
  [[nodiscard]] std::size_t size() const {
    const std::uint64_t tail = tail_.load(std::memory_order_acquire);
    const std::uint64_t waiting = producer_.published.load(std::memory_order_relaxed) - tail;
    return waiting < kCapacity ? static_cast<std::size_t>(waiting) : kCapacity;
  }

  /// Number of dropped values.
  [[nodiscard]] std::uint64_t dropped() const { return producer_.dropped.value(); }

 private:
  struct alignas(kCacheLine) Producer {
    typename Policy::template Atomic<std::uint64_t> published{0};  ///< head: number of values pushed so far
    std::uint64_t head = 0;                                        ///< the producer's own copy
    std::uint64_t tail_seen = 0;                                   ///< the newest tail known to it
    EventCount dropped;
  };

  /// Moves the tail past the oldest value unless the consumer has already done so. Afterwards there is room
  /// for one value.
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
      typename Policy::template Atomic<std::uint64_t> tail_{0};  ///< index of the oldest unclaimed value
  alignas(kCacheLine) std::array<AtomicWords<T, Policy>, kCapacity> cells_{};
};

}  // namespace swiftlet
