#pragma once
// A vector whose capacity is part of its type: elements are inside the object, nothing is allocated. Being
// full is a normal state: `tryPushBack` returns false and the caller applies its policy.

#include <array>
#include <cassert>
#include <cstddef>

namespace swiftlet {

template <typename T, std::size_t kCapacity>
class FixedVector {
 public:
  using value_type = T;

  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool full() const { return size_ == kCapacity; }

  /// Appends. The caller must know that there is room; if there is none, nothing changes.
  void pushBack(const T& value) {
    assert(!full());
    if (!full()) items_[size_++] = value;
  }
  /// Appends. False, without effect, if full.
  [[nodiscard]] bool tryPushBack(const T& value) {
    if (full()) return false;
    items_[size_++] = value;
    return true;
  }
  void clear() { size_ = 0; }
  void popBack() {
    assert(size_ > 0);
    --size_;
  }
  /// Keeps the first `size` elements, or grows; new elements have the old content of their slots.
  void resize(std::size_t size) {
    assert(size <= kCapacity);
    size_ = size;
  }
  /// Inserts before element `index` and keeps the order of the others. The caller knows that there is room.
  /// O(size).
  void insert(std::size_t index, const T& value) {
    assert(!full() && index <= size_);
    if (full()) return;
    for (std::size_t i = size_++; i > index; --i) items_[i] = items_[i - 1];
    items_[index] = value;
  }
  /// Removes element `index` and keeps the order of the others. O(size).
  void erase(std::size_t index) {
    assert(index < size_);
    for (std::size_t i = index + 1; i < size_; ++i) items_[i - 1] = items_[i];
    --size_;
  }

  T& operator[](std::size_t index) {
    assert(index < size_);
    return items_[index];
  }
  const T& operator[](std::size_t index) const {
    assert(index < size_);
    return items_[index];
  }
  T& front() { return (*this)[0]; }
  const T& front() const { return (*this)[0]; }
  T& back() { return (*this)[size_ - 1]; }
  const T& back() const { return (*this)[size_ - 1]; }
  T* data() { return items_.data(); }
  const T* data() const { return items_.data(); }
  T* begin() { return items_.data(); }
  T* end() { return items_.data() + size_; }
  const T* begin() const { return items_.data(); }
  const T* end() const { return items_.data() + size_; }

 private:
  std::array<T, kCapacity> items_{};
  std::size_t size_ = 0;
};

}  // namespace swiftlet
