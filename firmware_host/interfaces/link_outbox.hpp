#pragma once
// Messages that one thread sends over a link owned by another thread: an autopilot's outlet over the IMU's
// link.
//
// Only the owner reads and writes the port, so frames are never mixed. The owner never waits for the sender:
// it takes what is queued when it wakes. Each push is sent completely or not at all. Full: the push is
// refused. Unattended (the owner is not running, or its port is gone): the sender should not push; queued
// messages are dropped when the port returns. Threads: one sender (attended, push), one owner (the others).
// Memory: 12 kB inside the object.

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class LinkOutbox {
 public:
  /// The longest push: more than AutopilotLink writes in a step.
  static constexpr std::size_t kMostBytes = 1500;
  struct Bytes {
    std::array<std::uint8_t, kMostBytes> data;
    std::size_t count = 0;
    [[nodiscard]] std::span<const std::uint8_t> used() const { return std::span(data).first(count); }
  };

  LinkOutbox() : wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~LinkOutbox() { ::close(wake_); }
  LinkOutbox(const LinkOutbox&) = delete;
  LinkOutbox& operator=(const LinkOutbox&) = delete;

  // For the sender.
  [[nodiscard]] bool attended() const { return attended_.load(std::memory_order_acquire); }
  /// Whether the autopilot at the other end reports that it is PX4.
  [[nodiscard]] bool px4() const { return px4_.load(std::memory_order_relaxed); }
  /// Time that the port takes for a byte; 0: none.
  [[nodiscard]] Duration byteTime() const { return {byte_time_.load(std::memory_order_relaxed)}; }
  /// False: there is no room, or `bytes` is too long.
  [[nodiscard]] bool push(std::span<const std::uint8_t> bytes) {
    if (bytes.size() > kMostBytes) return false;
    Bytes* slot = ring_.beginPush();
    if (slot == nullptr) return false;
    std::copy(bytes.begin(), bytes.end(), slot->data.begin());
    slot->count = bytes.size();
    ring_.commitPush();
    static_cast<void>(eventfd_write(wake_, 1));
    return true;
  }

  // For the owner.
  void attend(bool attended) { attended_.store(attended, std::memory_order_release); }
  void tellPx4(bool px4) { px4_.store(px4, std::memory_order_relaxed); }
  void tellByteTime(Duration time) { byte_time_.store(time.ns, std::memory_order_relaxed); }
  /// Poll for reading: readable while something is queued.
  [[nodiscard]] int descriptor() const { return wake_; }
  /// Resets the wake-up; call before taking queued messages.
  void hush() const {
    eventfd_t pushes = 0;
    static_cast<void>(eventfd_read(wake_, &pushes));
  }
  /// The oldest queued push, valid until pop(); null: nothing is queued.
  [[nodiscard]] const Bytes* front() { return ring_.front(); }
  void pop() { ring_.pop(); }

 private:
  // Two periods of poses at the default rate, each with a text and obstacles. A link with a longer backlog is
  // too slow, and poses that waited longer are useless.
  static constexpr std::size_t kPushes = 8;

  int wake_;
  std::atomic<bool> attended_{false}, px4_{false};
  std::atomic<std::int64_t> byte_time_{0};
  SpscRing<Bytes, kPushes> ring_;
};

}  // namespace swiftlet
