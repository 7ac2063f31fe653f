#pragma once
// A fixed pool of slots for large messages (images): written once by one thread, lent to several readers by
// handle, and free again when the last reader releases it. A slow reader can hold at most its quota and thus
// never takes the slots that others need.
//
// Threads: one writer calls tryAcquire, fill, tryHand, takeBack, finish; reader r (0 .. kReaders - 1, one
//   thread each) calls borrow and release; any thread may read the counters.
// Life of a slot: tryAcquire, fill, for each reader tryHand and a push of the handle into that reader's ring,
//   finish. Each reader borrows what it pops, and the end of the loan releases it. The release and acquire of
//   the ring order filling before reading. If the ring refuses a handle or DropOldestRing returns it, the
//   reader never got it and the writer takes it back.
// Quota: slots handed to a reader and not yet released, waiting in its ring or on loan. At the quota tryHand
//   refuses and counts; other readers get the slot as usual. Behind a DropOldestRing of capacity C a reader
//   with L loans at a time needs C + L + 1, because the newest slot is handed before the oldest comes back.
// Full: with kSlots >= slotsFor(quotas), tryAcquire cannot fail while the writer holds no other slot. With
//   fewer it may return an invalid handle, which is counted.
// Misuse: a slot has one bit per holder and a generation that every acquisition increments. Double releases,
//   borrowing after release and handles of earlier lives of a slot are detected exactly: an assertion in
//   debug builds; ignored and counted in flight, without effect on other loans. (With 32 bits of generation,
//   a handle would have to be kept for 2^32 lives of its slot to be mistaken.)
// Memory: kSlots values inside the object, one cache line per slot and per reader.
// Cost: tryAcquire O(kSlots) loads, the others O(1) with one atomic read-modify-write. All are wait-free
//   (before ARMv8.1 up to the hardware's repeats).
//
// Why it is correct: only the writer sets a slot's bits, and only while it holds the slot; only reader r
// clears bit r (the writer does so for handles that r never got). A reader's release, acquired by the writer
// that finds no holder, orders all reading before the next filling; the releases of several readers form one
// release sequence. A reader's count of releases is stored after its bit is cleared and read before the quota
// is checked, so if the quota lets the writer hand out another slot, the writer sees that slot free.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"

namespace swiftlet {

/// Identifies a slot in one of its lives; trivially copyable, passed through rings. Invalid by default.
struct SlotHandle {
  static constexpr std::uint32_t kNone = 0xffffffffU;
  std::uint32_t slot = kNone;
  std::uint32_t generation = 0;

  [[nodiscard]] constexpr bool valid() const { return slot != kNone; }
  constexpr bool operator==(const SlotHandle&) const = default;
};

template <typename T, std::size_t kSlots, std::size_t kReaders, typename Policy = HardwareAtomics>
class SlotPool {
  static_assert(kSlots >= 1 && kSlots < SlotHandle::kNone && kReaders >= 1 && kReaders <= 31);

 public:
  using Quotas = std::array<std::uint32_t, kReaders>;

  /// A reader's loan of a slot, released by the destructor. Empty if the handle was invalid.
  class Loan {
   public:
    Loan() = default;
    Loan(Loan&& other) noexcept : pool_(other.pool_), handle_(other.handle_), reader_(other.reader_) {
      other.pool_ = nullptr;
    }
    Loan& operator=(Loan&& other) noexcept {
      if (this != &other) {
        reset();
        pool_ = other.pool_;
        handle_ = other.handle_;
        reader_ = other.reader_;
        other.pool_ = nullptr;
      }
      return *this;
    }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    ~Loan() { reset(); }

    /// Releases the slot now.
    void reset() {
      if (pool_ == nullptr) return;
      pool_->release(handle_, reader_);
      pool_ = nullptr;
    }
    explicit operator bool() const { return pool_ != nullptr; }
    [[nodiscard]] SlotHandle handle() const { return handle_; }
    const T& operator*() const { return pool_->slots_[handle_.slot]; }
    const T* operator->() const { return &**this; }

   private:
    friend class SlotPool;
    Loan(SlotPool& pool, SlotHandle handle, std::size_t reader)
        : pool_(&pool), handle_(handle), reader_(reader) {}

    SlotPool* pool_ = nullptr;
    SlotHandle handle_;
    std::size_t reader_ = 0;
  };

  explicit SlotPool(const Quotas& quotas) : quotas_(quotas) {}
  SlotPool(const SlotPool&) = delete;
  SlotPool& operator=(const SlotPool&) = delete;

  [[nodiscard]] static constexpr std::size_t capacity() { return kSlots; }
  /// Number of slots with which acquiring never fails: all quotas, and one that the writer fills.
  [[nodiscard]] static constexpr std::size_t slotsFor(const Quotas& quotas) {
    std::size_t slots = 1;
    for (const std::uint32_t quota : quotas) slots += quota;
    return slots;
  }
  /// Slot `index`, to reserve its memory before the threads start.
  [[nodiscard]] T& slot(std::size_t index) { return slots_[index]; }

  /// Writer. Acquires a free slot; an invalid handle, counted, if there is none. Takes the first free slot,
  /// so that a run that needs few slots stays in few pages and in the cache.
  [[nodiscard]] SlotHandle tryAcquire() {
    for (std::size_t index = 0; index < kSlots; ++index) {
      const std::uint64_t state = states_[index].word.load(std::memory_order_acquire);
      if (holdersOf(state) != 0) continue;
      const std::uint32_t generation = generationOf(state) + 1;
      // A plain store, because no other thread changes the word of a free slot.
      states_[index].word.store(pack(generation, kWriterBit), std::memory_order_relaxed);
      return {static_cast<std::uint32_t>(index), generation};
    }
    exhausted_.add();
    return {};
  }
  /// Writer. The slot's value, to be filled before the first handle is pushed and not touched afterwards.
  [[nodiscard]] T& fill(SlotHandle handle) {
    Policy::require(holds(handle, kWriterBit), "fill of a slot that the writer does not hold");
    return slots_[handle.slot];
  }
  /// Writer. Lends the slot to `reader`; false, counted, if the reader is at its quota.
  [[nodiscard]] bool tryHand(SlotHandle handle, std::size_t reader) {
    if (!permitted(holds(handle, kWriterBit) && reader < kReaders && !heldBy(handle, reader))) return false;
    if (handed_[reader] - readers_[reader].released.load(std::memory_order_acquire) >= quotas_[reader]) {
      refused_[reader].add();
      return false;
    }
    ++handed_[reader];
    states_[handle.slot].word.fetch_or(bitOf(reader), std::memory_order_relaxed);
    return true;
  }
  /// Writer. Undoes tryHand for a handle that the reader will not get.
  void takeBack(SlotHandle handle, std::size_t reader) {
    if (!permitted(heldBy(handle, reader))) return;
    --handed_[reader];
    states_[handle.slot].word.fetch_and(~std::uint64_t{bitOf(reader)}, std::memory_order_relaxed);
  }
  /// Writer. Releases its own hold; the slot is free when the last reader has released it.
  void finish(SlotHandle handle) {
    if (!permitted(holds(handle, kWriterBit))) return;
    states_[handle.slot].word.fetch_and(~std::uint64_t{kWriterBit}, std::memory_order_relaxed);
  }

  /// Reader. Borrows the slot of a popped handle until the loan ends.
  [[nodiscard]] Loan borrow(SlotHandle handle, std::size_t reader) {
    if (!permitted(heldBy(handle, reader))) return {};
    return Loan(*this, handle, reader);
  }
  /// Reader. Releases a handle without a loan, for a skipped frame.
  void release(SlotHandle handle, std::size_t reader) {
    if (!permitted(heldBy(handle, reader))) return;
    states_[handle.slot].word.fetch_and(~std::uint64_t{bitOf(reader)}, std::memory_order_release);
    readers_[reader].released.store(++readers_[reader].count, std::memory_order_release);
  }

  /// Writer, or `reader` itself. Whether `reader` holds this life of the slot.
  [[nodiscard]] bool heldBy(SlotHandle handle, std::size_t reader) const {
    return holds(handle, bitOf(reader));
  }

  /// Approximate number of slots held by anyone.
  [[nodiscard]] std::size_t inUse() const {
    std::size_t count = 0;
    for (const State& state : states_)
      count += holdersOf(state.word.load(std::memory_order_relaxed)) != 0 ? 1U : 0U;
    return count;
  }
  /// Number of refused tryHand calls because `reader` was at its quota.
  [[nodiscard]] std::uint64_t refused(std::size_t reader) const { return refused_[reader].value(); }
  /// Number of acquisitions that found no free slot.
  [[nodiscard]] std::uint64_t exhausted() const { return exhausted_.value(); }
  /// Number of calls with a handle that the caller does not hold: programming errors.
  [[nodiscard]] std::uint64_t misused() const { return misused_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint32_t kWriterBit = 1U << kReaders;

  struct alignas(kCacheLine) State {
    typename Policy::template Atomic<std::uint64_t> word{0};  ///< high bits: generation; low bits: holders
  };
  struct alignas(kCacheLine) Reader {
    typename Policy::template Atomic<std::uint64_t> released{0};
    std::uint64_t count = 0;  ///< the reader's own copy
  };

  static constexpr std::uint32_t bitOf(std::size_t reader) { return 1U << reader; }
  static constexpr std::uint32_t holdersOf(std::uint64_t state) { return static_cast<std::uint32_t>(state); }
  static constexpr std::uint32_t generationOf(std::uint64_t state) {
    return static_cast<std::uint32_t>(state >> 32U);
  }
  static constexpr std::uint64_t pack(std::uint32_t generation, std::uint32_t holders) {
    return (std::uint64_t{generation} << 32U) | holders;
  }

  /// Exact for the thread that owns the bit, because no other thread clears it.
  bool holds(SlotHandle handle, std::uint32_t bit) const {
    if (handle.slot >= kSlots) return false;
    const std::uint64_t state = states_[handle.slot].word.load(std::memory_order_relaxed);
    return generationOf(state) == handle.generation && (holdersOf(state) & bit) != 0;
  }
  bool permitted(bool holds) {
    Policy::require(holds, "a slot's handle used by who does not hold it");
    if (!holds) misused_.fetch_add(1, std::memory_order_relaxed);
    return holds;
  }

  std::array<State, kSlots> states_{};
  std::array<Reader, kReaders> readers_{};
  std::array<T, kSlots> slots_{};
  // The writer's own.
  Quotas quotas_;
  std::array<std::uint64_t, kReaders> handed_{};
  std::array<EventCount, kReaders> refused_{};
  EventCount exhausted_;
  std::atomic<std::uint64_t> misused_{0};
};

}  // namespace swiftlet
