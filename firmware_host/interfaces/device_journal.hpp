#pragma once
// Faults of one device in flight, from its thread to the log: each fault is noted once when it appears and
// once when it ends. A working device can also have a defect, for example lost data. Fixed memory; a full
// journal counts what it loses.

#include <atomic>
#include <cstdint>
#include <string>

#include "drivers/device/device_fault.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct DeviceEvent {
  Stamp stamp;
  DeviceFault fault;    ///< ok: the end of what stood
  bool defect = false;  ///< of a device that works
};

class DeviceJournal {
 public:
  /// `name`: as the user knows the device, "camera 0 (/dev/video0)".
  explicit DeviceJournal(std::string name) : name_(std::move(name)) {}

  // Of the device's thread.
  /// Noted where it is another fault than the one that stands.
  void fault(Stamp now, const DeviceFault& fault) {
    // What went is not there while it is looked for: nothing new.
    const bool still_gone =
        standing_ == DeviceFaultKind::kUnplugged && fault.kind == DeviceFaultKind::kMissing;
    if (standing_ == fault.kind || still_gone) return;
    standing_ = fault.kind;
    faults_.fetch_add(1, std::memory_order_relaxed);
    static_cast<void>(events_.tryPush({now, fault, false}));
  }
  /// Ends the current fault, if any.
  void works(Stamp now) {
    if (standing_ == DeviceFaultKind::kNone) return;
    standing_ = DeviceFaultKind::kNone;
    static_cast<void>(events_.tryPush({now, {}, false}));
  }
  /// For a working device: noted if the defect differs from the current one.
  void defect(Stamp now, const DeviceFault& what) {
    if (defect_ == what.kind) return;
    defect_ = what.kind;
    faults_.fetch_add(1, std::memory_order_relaxed);
    static_cast<void>(events_.tryPush({now, what, true}));
  }
  /// Ends the current defect, if any.
  void sound(Stamp now) {
    if (defect_ == DeviceFaultKind::kNone) return;
    defect_ = DeviceFaultKind::kNone;
    static_cast<void>(events_.tryPush({now, {}, true}));
  }
  /// A line that ends nothing and needs no end: a setting that the device took otherwise.
  void note(Stamp now, const DeviceFault& what) { static_cast<void>(events_.tryPush({now, what, false})); }
  [[nodiscard]] DeviceFaultKind standing() const { return standing_; }

  // Of the log's thread.
  [[nodiscard]] bool next(DeviceEvent& event) { return events_.tryPop(event); }
  [[nodiscard]] std::string text(const DeviceEvent& event) const {
    if (!event.fault.ok()) return describe(event.fault, name_);
    return name_ + (event.defect ? ": normal again" : ": works again");
  }

  // Of any.
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint64_t faults() const { return faults_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t lost() const { return events_.refused(); }

 private:
  /// The log looks every few milliseconds; a device fails and returns a few times a second at most.
  static constexpr std::size_t kEvents = 64;

  std::string name_;
  DeviceFaultKind standing_ = DeviceFaultKind::kNone;
  DeviceFaultKind defect_ = DeviceFaultKind::kNone;
  SpscRing<DeviceEvent, kEvents> events_;
  std::atomic<std::uint64_t> faults_{0};
};

}  // namespace swiftlet
