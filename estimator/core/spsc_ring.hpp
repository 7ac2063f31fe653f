#pragma once
// A queue of fixed capacity from one thread to one other: wait-free on both sides, first in first out.
//
// Threads: one producer calls tryPush, beginPush, commitPush; one consumer calls front, pop, tryPop. Both may
//   call size() (an estimate for other threads); any thread may call refused().
// Full: the push is refused and counted, and no waiting element is lost. The producer decides what that means
//   (IMU samples: a fault; recorder: a counted loss). To drop the oldest instead, use DropOldestRing.
// Memory: kCapacity elements inside the object, in cache lines of their own, and one cache line per side.
// Cost: O(1), no read-modify-write. The other side's index is read only if its cached copy says full (or
//   empty), so that a burst moves one cache line instead of one per element.
// Elements may be move-only; they need a default constructor and stay constructed for the life of the ring.
// A popped element is not destroyed: its resources are released when its slot is written again.
//
// Source: L. Lamport, "Specifying concurrent program modules", TOPLAS 1983, with release and acquire instead
// of sequential consistency; cached indices: Lee, Bu, Chandranmenon, "A lock-free, cache-efficient shared
// ring buffer", ANCS 2009. Why it is correct: each index is written by one side. The content of a slot is
// written before the release store of head that hands it over, and read after the acquire load that saw it.
// It is overwritten only after the acquire load of a tail that was released after reading. tests/core runs
// every interleaving and every stale read that the memory model allows, for capacities 1 and 2.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#include "estimator/core/atomic_policy.hpp"

namespace swiftlet {

/// `Index` counts elements since the start. It may wrap, which needs a power of two as capacity; 64 bits do
/// not wrap within a machine's life and allow any capacity.
template <typename T, std::size_t kCapacity, typename Index = std::uint64_t,
          typename Policy = HardwareAtomics>
class SpscRing {
  static_assert(std::is_unsigned_v<Index> && kCapacity >= 1 &&
                kCapacity <= std::numeric_limits<Index>::max());
  static_assert(std::has_single_bit(kCapacity) || sizeof(Index) == 8);

 public:
  using value_type = T;

  SpscRing() = default;
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }

  /// Producer. False and counted, without effect (an argument to be moved stays valid), if full.
  [[nodiscard]] bool tryPush(const T& value) { return pushWith(value); }
  [[nodiscard]] bool tryPush(T&& value) { return pushWith(std::move(value)); }

  /// Producer. The element to fill in place, which still has its old value; nullptr, counted, if full. The
  /// consumer does not see it until commitPush; a second beginPush without it returns the same element.
  [[nodiscard]] T* beginPush() {
    if (!hasRoom()) {
      producer_.refused.add();
      return nullptr;
    }
    return &items_[producer_.head % kCapacity];
  }
  void commitPush() {
    Policy::require(distance(producer_.head, producer_.tail_seen) < kCapacity, "commit without begin");
    producer_.published.store(++producer_.head, std::memory_order_release);
  }

  /// Consumer. The oldest element, valid until pop; nullptr if empty.
  [[nodiscard]] T* front() {
    if (consumer_.head_seen == consumer_.tail) {
      consumer_.head_seen = producer_.published.load(std::memory_order_acquire);
      if (consumer_.head_seen == consumer_.tail) return nullptr;
    }
    return &items_[consumer_.tail % kCapacity];
  }
  void pop() {
    Policy::require(consumer_.head_seen != consumer_.tail, "pop without front");
    consumer_.published.store(++consumer_.tail, std::memory_order_release);
  }

  /// Consumer. False, with `out` unchanged, if empty.
  [[nodiscard]] bool tryPop(T& out) {
    T* oldest = front();
    if (oldest == nullptr) return false;
    out = std::move(*oldest);
    pop();
    return true;
  }

  /// Number of waiting elements: never too small for the producer, never too large for the consumer.
  [[nodiscard]] std::size_t size() const {
    // The tail first, with acquire, so that the head read after it is not older.
    const Index tail = consumer_.published.load(std::memory_order_acquire);
    const Index waiting = distance(producer_.published.load(std::memory_order_relaxed), tail);
    return waiting < kCapacity ? waiting : kCapacity;
  }

  /// Number of refused pushes.
  [[nodiscard]] std::uint64_t refused() const { return producer_.refused.value(); }

 private:
  struct alignas(kCacheLine) Producer {
    typename Policy::template Atomic<Index> published{0};  ///< head: number of elements pushed so far
    Index head = 0;                                        ///< the producer's own copy
    Index tail_seen = 0;                                   ///< the consumer's index when last read
    EventCount refused;
  };
  struct alignas(kCacheLine) Consumer {
    typename Policy::template Atomic<Index> published{0};  ///< tail: number of elements taken so far
    Index tail = 0;
    Index head_seen = 0;
  };

  // Small index types are promoted to int; convert back to the type that wraps.
  static Index distance(Index head, Index tail) { return static_cast<Index>(head - tail); }

  bool hasRoom() {
    if (distance(producer_.head, producer_.tail_seen) < kCapacity) return true;
    producer_.tail_seen = consumer_.published.load(std::memory_order_acquire);
    return distance(producer_.head, producer_.tail_seen) < kCapacity;
  }
  template <typename Value>
  bool pushWith(Value&& value) {
    T* slot = beginPush();
    if (slot == nullptr) return false;
    *slot = std::forward<Value>(value);
    commitPush();
    return true;
  }

  Producer producer_;
  Consumer consumer_;
  alignas(kCacheLine) std::array<T, kCapacity> items_{};
};

}  // namespace swiftlet
