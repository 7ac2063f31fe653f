#pragma once
// Passes the newest value from one thread to any number of others: a seqlock over several cells, so that a
// writer interrupted in the middle of a write does not block readers.
//
// Threads: one writer calls write; any thread calls read.
// Values: trivially copyable and small (tens of words). For others, and for values with Eigen members, use
// one Newest per reader.
// Sequence: values are numbered from 1; 0 means none. A thread never reads an older value than it read
// before.
// Memory: kCells values inside the object.
// Cost: write is wait-free, one store per word and two more; read is one load per word and two more.
// Overtaken: a read is discarded if the writer began the kCells-th write after it while it copied. With four
// cells, the default, this requires that a reader is stopped between two words for three periods of the
// writer. After kReadAttempts attempts the read returns 0, which is counted, and the reader keeps the value
// that it has.
//
// Source: H.-J. Boehm, "Can seqlocks get along with programming language memory models?", MSPC 2012: atomic
// words; instead of fences the words are release stores and acquire loads, which order at least as much.
// Why it is correct: write n stores `started_ = n`, fills cell n mod kCells with release stores, then stores
// `finished_ = n` with release. A reader that acquired n from `finished_` sees at least the words of write n.
// If it read a word of write n + kCells or later, that word's acquire makes `started_ >= n + kCells` visible
// to the following load, and the copy is discarded. With kCells = 1 this is the classic seqlock.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"
#include "estimator/core/atomic_words.hpp"

namespace swiftlet {

template <typename T, std::size_t kCells = 4, int kReadAttempts = 4, typename Policy = HardwareAtomics>
class NewestShared {
  static_assert(kCells >= 1 && kReadAttempts >= 1);

 public:
  using value_type = T;

  NewestShared() = default;
  NewestShared(const NewestShared&) = delete;
  NewestShared& operator=(const NewestShared&) = delete;

  /// Writer. Returns the value's sequence number.
  std::uint64_t write(const T& value) {
    const std::uint64_t sequence = ++written_;
    started_.store(sequence, std::memory_order_relaxed);
    cells_[sequence % kCells].store(value, std::memory_order_release);
    finished_.store(sequence, std::memory_order_release);
    return sequence;
  }

  /// Any thread. Copies the newest value and returns its sequence number; 0, with `out` unchanged, if there
  /// is none yet or every attempt was overtaken.
  [[nodiscard]] std::uint64_t read(T& out) const {
    for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
      const std::uint64_t sequence = finished_.load(std::memory_order_acquire);
      if (sequence == 0) return 0;
      const T candidate = cells_[sequence % kCells].load(std::memory_order_acquire);
      if (started_.load(std::memory_order_relaxed) < sequence + kCells) {
        out = candidate;
        return sequence;
      }
    }
    overtaken_.fetch_add(1, std::memory_order_relaxed);
    return 0;
  }

  /// Number of reads in which every attempt was overtaken.
  [[nodiscard]] std::uint64_t overtaken() const { return overtaken_.load(std::memory_order_relaxed); }

 private:
  alignas(kCacheLine) std::uint64_t written_ = 0;
  typename Policy::template Atomic<std::uint64_t> started_{0};
  typename Policy::template Atomic<std::uint64_t> finished_{0};
  alignas(kCacheLine) std::array<AtomicWords<T, Policy>, kCells> cells_{};
  alignas(kCacheLine) mutable std::atomic<std::uint64_t> overtaken_{0};
};

}  // namespace swiftlet
