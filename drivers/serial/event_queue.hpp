#pragma once
// A FIFO queue of fixed capacity within one thread; a full queue refuses. Memory: inside the object.

#include <array>
#include <cstddef>

namespace swiftlet {

template <typename T, std::size_t kCapacity>
class EventQueue {
 public:
  /// False, without any change, if the queue is full.
  [[nodiscard]] bool push(const T& value) {
    if (size_ == kCapacity) return false;
    items_[(first_ + size_++) % kCapacity] = value;
    return true;
  }
  [[nodiscard]] bool pop(T& value) {
    if (size_ == 0) return false;
    value = items_[first_];
    first_ = (first_ + 1) % kCapacity;
    --size_;
    return true;
  }

 private:
  std::array<T, kCapacity> items_ = {};
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace swiftlet
