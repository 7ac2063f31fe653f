#pragma once
// A queue of fixed capacity from one thread to one other: wait-free on both sides, first in first out.
//
// Threads: one producer calls tryPush, beginPush, commitPush; one consumer calls front, pop, tryPop;
//   size() is for both (for a third thread it is an estimate); refused() is for anyone.
// Full: the push is refused and counted, nothing waiting is lost: the producer decides what that means
//   (IMU samples: a fault; recorder: a counted loss). Where the oldest should go instead: DropOldestRing.
// Memory: kCapacity elements inside the object, in lines of their own, and one cache line a side.
// Cost: O(1), no read-modify-write; the other side's index is read only when the copy of it that was kept
//   from last time says full (or empty), so that a burst moves one cache line and not one an element.
// Elements may be move-only; they need a default constructor and stay constructed for the ring's life.
// A popped element is not destroyed: what it owns is let go when its slot is written again.
//
// Source: L. Lamport, "Specifying concurrent program modules", TOPLAS 1983, with release and acquire in
// place of sequential consistency; cached indices: Lee, Bu, Chandranmenon, "A lock-free, cache-efficient
// shared ring buffer", ANCS 2009.
// Why it is right: each index is written by one side. A slot's content is written before the release
// store of head that hands it over and read after the acquire load that saw it; it is overwritten only
// after the acquire load of a tail that was released when the reading was done. Every interleaving and
// every stale read that the memory model allows is run in tests/core for capacities 1 and 2.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#include "estimator/core/atomic_policy.hpp"

namespace swiftlet {

/// `Index` counts elements since the start and may wrap, hence the power of two; 64 bits do not wrap
/// within a machine's life and allow any capacity.
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

  /// Producer. False, counted, and nothing changed (an argument to be moved stays whole) when full.
  [[nodiscard]] bool tryPush(const T& value) { return pushWith(value); }
  [[nodiscard]] bool tryPush(T&& value) { return pushWith(std::move(value)); }

  /// Producer, writing in place: the element to fill, which holds what it held before; nullptr, counted,
  /// when full. Unseen by the consumer until commitPush; beginning again without it gives the same element.
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

  /// Consumer. The oldest element, its own until pop; nullptr when empty.
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

  /// Consumer. False, and `out` untouched, when empty.
  [[nodiscard]] bool tryPop(T& out) {
    T* oldest = front();
    if (oldest == nullptr) return false;
    out = std::move(*oldest);
    pop();
    return true;
  }

  /// Elements waiting: never less than there are for the producer, never more for the consumer.
  [[nodiscard]] std::size_t size() const {
    // The tail first, and acquired: the head read after it cannot be an older one.
    const Index tail = consumer_.published.load(std::memory_order_acquire);
    const Index waiting = distance(producer_.published.load(std::memory_order_relaxed), tail);
    return waiting < kCapacity ? waiting : kCapacity;
  }

  /// Pushes that found the ring full.
  [[nodiscard]] std::uint64_t refused() const { return producer_.refused.value(); }

 private:
  struct alignas(kCacheLine) Producer {
    typename Policy::template Atomic<Index> published{0};  ///< head: elements handed over so far
    Index head = 0;                                        ///< the producer's own copy
    Index tail_seen = 0;                                   ///< what it last read of the consumer's
    EventCount refused;
  };
  struct alignas(kCacheLine) Consumer {
    typename Policy::template Atomic<Index> published{0};  ///< tail: elements taken so far
    Index tail = 0;
    Index head_seen = 0;
  };

  // Small index types are promoted to int: back to the type that wraps.
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
