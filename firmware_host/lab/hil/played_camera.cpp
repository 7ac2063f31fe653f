#include "firmware_host/lab/hil/played_camera.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {

DeviceFault PlayedCamera::open(const std::string& output, const std::string& capture, int width, int height) {
  output_ = output;
  capture_ = capture;
  width_ = width;
  height_ = height;
  next_ = reader_.image(index_);
  return player_.open(output, capture, width, height);
}

void PlayedCamera::begin(const FrameGrid& grid, Stamp now, std::int64_t last_slot) {
  grid_ = grid;
  last_slot_ = last_slot;
  // The first instant that leaves time for two images.
  slot_ = std::min<std::int64_t>((now - grid.first).ns / grid.period.ns + 2, 0);
  streamed_ = slot_;
}

DeviceFault PlayedCamera::step(Stamp now) {
  if (DeviceFault fault = followFaults(now - grid_.first); !fault.ok()) return fault;
  if (DeviceFault fault = damageNext(now); !fault.ok()) return fault;
  watchSlips(now);
  // At most two images wait: the next is written in the second half of the period before the last waiting
  // one.
  while (!ended() && now >= grid_.instant(slot_) - Duration{grid_.period.ns * 3 / 2}) {
    const bool late = now >= grid_.instant(slot_);
    if (unplugged_ || stalled_ || late) {
      while (next_ && grid_.slotOf(next_->stamp) <= slot_) next_ = reader_.image(index_);
      if (!unplugged_ && !stalled_) ++counters_.late;
      ++slot_;
      streamed_ = slot_;
      continue;
    }
    if (!player_.wantsImage()) break;
    if (DeviceFault fault = showSlot(); !fault.ok()) return fault;
    ++slot_;
  }
  // Further images push out those that the driver holds back.
  if (ended() && !unplugged_ && !stalled_ && player_.wantsImage()) return player_.showDark(0);
  return {};
}

DeviceFault PlayedCamera::showSlot() {
  if (slot_ < 0) return player_.showDark(0);
  while (next_ && grid_.slotOf(next_->stamp) < slot_) next_ = reader_.image(index_);
  const Duration time = grid_.instant(slot_) - grid_.first;
  const bool here = next_ && grid_.slotOf(next_->stamp) == slot_;
  const bool frozen = faults_.active(device_, PlannedFaultKind::kFreeze, time) != nullptr;
  if (here && !(frozen && shown_)) {
    shown_ = std::move(next_);
  } else if (!here) {
    ++counters_.missing;
  }
  if (here) next_ = reader_.image(index_);
  ++counters_.shown;
  if (const PlannedFault* dark = faults_.active(device_, PlannedFaultKind::kDark, time)) {
    return player_.showDark(static_cast<int>(std::lround(dark->value)));
  }
  if (!shown_) return player_.showDark(0);
  return player_.show({shown_->pixels.data(), shown_->width, shown_->height, shown_->width});
}

DeviceFault PlayedCamera::followFaults(Duration time) {
  const bool gone = faults_.active(device_, PlannedFaultKind::kUnplug, time) != nullptr;
  if (gone && !unplugged_) {
    unplugged_ = true;
    return player_.unplug();
  }
  if (!gone && unplugged_) {
    // The node returns when its last user closes it.
    if (!reopen()) return {};
    unplugged_ = false;
  }
  if (unplugged_) return {};
  const bool still = faults_.active(device_, PlannedFaultKind::kStall, time) != nullptr;
  if (still == stalled_) return {};
  // Images that waited in the driver are outdated.
  if (!still && !reopen()) return {};
  stalled_ = still;
  return player_.stall(still);
}

bool PlayedCamera::reopen() {
  player_.close();
  if (!player_.open(output_, capture_, width_, height_).ok()) return false;
  streamed_ = slot_;
  return true;
}

DeviceFault PlayedCamera::damageNext(Stamp now) {
  if (unplugged_ || stalled_ || now < grid_.first) return {};
  const std::int64_t next = (now - grid_.first).ns / grid_.period.ns + 1;
  const std::int64_t left = (grid_.instant(next) - now).ns;
  if (next == decided_ || left > grid_.period.ns * 3 / 8 || left < grid_.period.ns / 8) return {};
  decided_ = next;
  const PlannedFault* drop =
      faults_.active(device_, PlannedFaultKind::kDrop, grid_.instant(next) - grid_.first);
  if (drop == nullptr || !faults_.strikes(*drop, static_cast<std::uint64_t>(next))) return {};
  return player_.damage();
}

/// The driver releases an image half a period after its instant: at three quarters, the number of released
/// images must equal the number of instants.
void PlayedCamera::watchSlips(Stamp now) {
  if (unplugged_ || stalled_ || now < grid_.instant(streamed_)) return;
  // Rounded down also before the first slot.
  const std::int64_t since = (now - grid_.first).ns;
  const std::int64_t slot = since / grid_.period.ns - (since < 0 ? 1 : 0);
  const std::int64_t part = (now - grid_.instant(slot)).ns;
  if (slot == looked_ || part < grid_.period.ns * 5 / 8 || part > grid_.period.ns * 7 / 8) return;
  looked_ = slot;
  if (ended() || !player_.wantsImage()) return;
  const auto waiting = static_cast<std::int64_t>(player_.waiting());
  if (waiting != slot_ - 1 - slot) ++counters_.slipped;
}

}  // namespace swiftlet
