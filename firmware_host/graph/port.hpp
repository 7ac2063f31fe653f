#pragma once
// The ends of the graph's arrows. A reader declares its end as a member of its node, with capacity, policy
// and counter. graph.cpp connects a writer's `Out` to it by `out.to(in)`. So each fact is stated once.
//
// | reader's end  | carries                         | when full
// | QueueIn<T, N> | every value, in order           | refused and counted, unless the writer asks hasRoom()
// | LatestIn<T>   | the newest value                | the older value is overwritten
// | SlotIn        | slots of a pool, lent by handle | the oldest goes back to the writer, counted
//
// Threads: the writer's node calls Out; the reader's node calls the rest of In; counters are for any thread.
// Memory: a queue's values inside it, three of a newest value. An Out to a queue keeps one value to write
// into while the queue is full. No allocation after the graph is built.
// Cost: that of the carrier in estimator/core, and a virtual call. The first of several readers is written in
// place; the others get copies.
//
// Recorded schedule: before a node's turn, its ends are given what timing decided in the recorded run: how
// many values (SampleIn::limit), which newest value (LatestIn::expect), which slot (SlotIn::tell).

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>

#include "estimator/core/atomic_policy.hpp"
#include "estimator/core/drop_oldest_ring.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/core/spsc_ring.hpp"

namespace swiftlet {

class Node;

/// How an arrow wakes its reader.
enum class Arrow : std::uint8_t {
  kWakes,     ///< the reader looks at once when the writer's turn is over
  kWaits,     ///< the reader looks when something else wakes it, or after some milliseconds
  kFeedback,  ///< like kWakes, from a node behind the reader: the reader can end before the writer
  kHint,      ///< like kWaits, from a node behind the reader
};

class In {
 public:
  /// `counter`: literal name of the loss counter in summary.json; null if nothing can be lost.
  In(Node& reader, const char* counter, Arrow arrow);
  In(const In&) = delete;
  In& operator=(const In&) = delete;
  virtual ~In() = default;

  [[nodiscard]] Node& reader() const { return reader_; }
  [[nodiscard]] const char* counter() const { return counter_; }
  [[nodiscard]] Arrow arrow() const { return arrow_; }
  [[nodiscard]] virtual std::uint64_t lost() const { return 0; }

 private:
  Node& reader_;
  const char* counter_;
  Arrow arrow_;
};

/// End of an arrow for values of one type.
template <typename T>
class InOf : public In {
 public:
  using In::In;
  /// Writer. The value to fill before commit; null if there is no room, counted.
  virtual T* begin() = 0;
  virtual void commit() = 0;
  [[nodiscard]] virtual bool hasRoom() const = 0;
  [[nodiscard]] virtual bool canRefuse() const = 0;
};

template <typename T, std::size_t kCapacity>
class QueueIn : public InOf<T> {
 public:
  using InOf<T>::InOf;

  T* begin() override { return ring_.beginPush(); }
  void commit() override { ring_.commitPush(); }
  [[nodiscard]] bool hasRoom() const override { return ring_.size() < kCapacity; }
  [[nodiscard]] bool canRefuse() const override { return true; }
  [[nodiscard]] std::uint64_t lost() const override { return ring_.refused(); }

  /// Reader. The oldest value, valid until pop; null if there is none.
  [[nodiscard]] T* front() { return ring_.front(); }
  void pop() { ring_.pop(); }
  [[nodiscard]] std::size_t size() const { return ring_.size(); }

 private:
  SpscRing<T, kCapacity> ring_;
};

template <typename T>
class LatestIn final : public InOf<T> {
 public:
  explicit LatestIn(Node& reader, Arrow arrow) : InOf<T>(reader, nullptr, arrow) {}

  T* begin() override { return &newest_.draft(); }
  void commit() override {
    newest_.publish();
    if (!kept_) return;
    newest_.refresh();
    kept_->push_back({newest_.sequence(), newest_.value()});
  }
  [[nodiscard]] bool hasRoom() const override { return true; }
  [[nodiscard]] bool canRefuse() const override { return false; }

  /// Reader. Takes the newest value and returns its number; 0: none yet.
  std::uint64_t refresh() { return kept_ ? number() : newest_.refresh(); }
  [[nodiscard]] const T& value() const {
    return kept_ && number() > 0 ? kept_->front().value : newest_.value();
  }
  [[nodiscard]] std::uint64_t number() const {
    if (!kept_) return newest_.sequence();
    return kept_->empty() || kept_->front().number != expected_ ? 0 : expected_;
  }

  // For the recorded schedule, one thread.

  /// From now on refresh() returns only the value set by expect().
  void keepAll() { kept_.emplace(); }
  /// Sets the value that refresh() returns; 0: none. False: value `number` was not sent yet.
  bool expect(std::uint64_t number) {
    while (!kept_->empty() && kept_->front().number < number) kept_->pop_front();
    if (number > 0 && (kept_->empty() || kept_->front().number != number)) return false;
    expected_ = number;
    return true;
  }

 private:
  struct Kept {
    std::uint64_t number;
    T value;
  };
  Newest<T> newest_;
  std::optional<std::deque<Kept>> kept_;
  std::uint64_t expected_ = 0;
};

/// The reader borrows slots of the writer's pool, where it has the index kReader.
template <typename Pool, std::size_t kReader, std::size_t kCapacity>
class SlotIn final : public In {
 public:
  using Slot = std::remove_cvref_t<decltype(*std::declval<typename Pool::Loan>())>;
  using Loan = typename Pool::Loan;
  using In::In;

  void lendFrom(Pool& pool) { pool_ = &pool; }
  [[nodiscard]] bool connected() const { return pool_ != nullptr; }

  /// Writer. False: the reader is at its quota, counted. If the ring is full, the oldest slot is returned
  /// instead, counted too.
  bool hand(SlotHandle handle) {
    if (!pool_->tryHand(handle, kReader)) {
      miss();
      return false;
    }
    SlotHandle oldest;
    if (ring_.push(handle, oldest)) {
      pool_->takeBack(oldest, kReader);
      miss();
    }
    return true;
  }
  /// Writer. Counts an image for which no slot was available.
  void miss() { lost_.add(); }
  [[nodiscard]] std::uint64_t lost() const override { return lost_.value(); }

  /// Reader. False if nothing is queued.
  bool tryPop(Loan& loan) {
    SlotHandle handle;
    if (!ring_.tryPop(handle)) return false;
    loan = pool_->borrow(handle, kReader);
    return true;
  }
  /// Reader. The slot with this key; null if it is not there. It is held until find is called for a later key
  /// or clear is called. Older slots are returned, newer ones are kept.
  template <typename Key, typename KeyOf>
  const Slot* find(const Key& wanted, KeyOf&& keyOf) {
    if (told_) return *told_ != nullptr && keyOf(**told_) == wanted ? *told_ : nullptr;
    while (!head_ || keyOf(*head_) < wanted) {
      head_.reset();
      if (!tryPop(head_)) return nullptr;
    }
    return keyOf(*head_) == wanted ? &*head_ : nullptr;
  }
  /// Returns the slot that find kept for later, if `stale(slot)`.
  template <typename Stale>
  void forgetIf(Stale&& stale) {
    if (head_ && stale(*head_)) head_.reset();
  }
  void clear() { head_.reset(); }
  [[nodiscard]] std::size_t size() const { return ring_.size(); }

  /// Recorded schedule: what find sees from now on; null: nothing is available.
  void tell(const Slot* slot) { told_ = slot; }

 private:
  Pool* pool_ = nullptr;
  DropOldestRing<SlotHandle, kCapacity> ring_;
  Loan head_;
  std::optional<const Slot*> told_;
  EventCount lost_;
};

void connect(Node& writer, In& in);

/// A writer's end, connected to each reader named in graph.cpp.
template <typename T>
class Out {
 public:
  explicit Out(Node& writer) : writer_(writer) {}
  Out(const Out&) = delete;
  Out& operator=(const Out&) = delete;

  void to(InOf<T>& in) {
    static_cast<void>(readers_.tryPushBack(&in));
    if (in.canRefuse() && !spare_) spare_ = std::make_unique<T>();
    connect(writer_, in);
  }
  [[nodiscard]] bool connected() const { return !readers_.empty(); }
  /// At every reader.
  [[nodiscard]] bool hasRoom() const {
    for (const InOf<T>* in : readers_) {
      if (!in->hasRoom()) return false;
    }
    return true;
  }

  /// Every reader has ended.
  [[nodiscard]] bool readersDone() const {
    for (const InOf<T>* in : readers_) {
      if (!in->reader().done()) return false;
    }
    return true;
  }

  /// The value to fill before send, while connected: in the first reader that has room. It holds an older
  /// value.
  T& draft() {
    for (drafted_ = 0; drafted_ < readers_.size(); ++drafted_) {
      draft_ = readers_[drafted_]->begin();
      if (draft_ != nullptr) return *draft_;
    }
    return *spare_;
  }
  /// Sends to all readers that have room; the others have counted a loss.
  void send() {
    for (std::size_t i = drafted_ + 1; i < readers_.size(); ++i) {
      T* copy = readers_[i]->begin();
      if (copy == nullptr) continue;
      *copy = *draft_;
      readers_[i]->commit();
    }
    if (drafted_ < readers_.size()) readers_[drafted_]->commit();
  }
  void send(const T& value) {
    for (InOf<T>* in : readers_) {
      T* copy = in->begin();
      if (copy == nullptr) continue;
      *copy = value;
      in->commit();
    }
  }

 private:
  static constexpr std::size_t kMostReaders = 6;

  Node& writer_;
  FixedVector<InOf<T>*, kMostReaders> readers_;
  std::unique_ptr<T> spare_;
  std::size_t drafted_ = 0;
  T* draft_ = nullptr;
};

}  // namespace swiftlet
