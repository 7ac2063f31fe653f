#include "drivers/image/camera_source.hpp"

#include <utility>

namespace swiftlet {

CapturedFrame& CapturedFrame::operator=(CapturedFrame&& other) noexcept {
  if (this == &other) return *this;
  release();
  image = other.image;
  stamp = other.stamp;
  event = other.event;
  arrival = other.arrival;
  sequence = other.sequence;
  buffer_ = other.buffer_;
  generation_ = other.generation_;
  source_ = std::exchange(other.source_, nullptr);
  return *this;
}

void CapturedFrame::release() {
  if (source_ != nullptr && generation_ == source_->generation_) source_->giveBack(buffer_);
  source_ = nullptr;
  image = {};
}

DeviceFault CameraSource::setExposure(const ExposureSetting& /*setting*/) {
  return deviceFault(DeviceFaultKind::kUnsupported, 0, "the exposure time cannot be set");
}

void CameraSource::lend(CapturedFrame& frame, std::uint32_t buffer) {
  frame.source_ = this;
  frame.buffer_ = buffer;
  frame.generation_ = generation_;
  ++counters_.frames;
}

void CameraSource::warn(const DeviceFault& fault) {
  if (!fault.ok() && warning_count_ < warnings_.size()) warnings_[warning_count_++] = fault;
}

}  // namespace swiftlet
