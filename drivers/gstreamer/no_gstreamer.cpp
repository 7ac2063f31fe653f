// Replaces pipeline_source.cpp in builds without GStreamer.

#include <utility>

#include "drivers/gstreamer/pipeline_source.hpp"

namespace swiftlet {

struct PipelineSource::Pipeline {};

PipelineSource::PipelineSource(PipelineSettings settings) : settings_(std::move(settings)) {}
PipelineSource::~PipelineSource() = default;

DeviceFault PipelineSource::open() {
  return deviceFault(
      DeviceFaultKind::kUnsupported, 0,
      "built without GStreamer: install libgstreamer1.0-dev and libgstreamer-plugins-base1.0-dev, "
      "configure with -DSWIFTLET_WITH_GSTREAMER=ON and build again");
}

int PipelineSource::fd() const { return -1; }
DeviceFault PipelineSource::next(CapturedFrame& /*frame*/) { return open(); }
void PipelineSource::giveBack(std::uint32_t /*buffer*/) {}
void PipelineSource::shut() {}

}  // namespace swiftlet
