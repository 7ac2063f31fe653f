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
  DeviceFault fault;    ///< ok: the current fault has ended
  bool defect = false;  ///< reported by a device that works
};

class DeviceJournal {
 public:
  /// `name`: as the user knows the device, "camera 0 (/dev/video0)".
  explicit DeviceJournal(std::string name) : name_(std::move(name)) {}

  // For the device's thread.
  /// Notes the fault unless it is the current one.
  void fault(Stamp now, const DeviceFault& fault) {
    // While an unplugged device is searched for, it is missing: still the same fault.
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
  /// Notes an event that has no end, for example a setting that the device applied differently.
  void note(Stamp now, const DeviceFault& what) { static_cast<void>(events_.tryPush({now, what, false})); }
  [[nodiscard]] DeviceFaultKind standing() const { return standing_; }

  // For the log's thread.
  [[nodiscard]] bool next(DeviceEvent& event) { return events_.tryPop(event); }
  [[nodiscard]] std::string text(const DeviceEvent& event) const {
    if (!event.fault.ok()) return describe(event.fault, name_);
    return name_ + (event.defect ? ": normal again" : ": works again");
  }

  // For any thread.
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint64_t faults() const { return faults_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t lost() const { return events_.refused(); }

 private:
  /// The log reads every few milliseconds; a device fails and recovers a few times a second at most.
  static constexpr std::size_t kEvents = 64;

  std::string name_;
  DeviceFaultKind standing_ = DeviceFaultKind::kNone;
  DeviceFaultKind defect_ = DeviceFaultKind::kNone;
  SpscRing<DeviceEvent, kEvents> events_;
  std::atomic<std::uint64_t> faults_{0};
};

}  // namespace swiftlet
