// What a build without GStreamer says of a pipeline.

#include <catch2/catch.hpp>
#include <string>

#include "drivers/gstreamer/pipeline_source.hpp"

namespace swiftlet {
namespace {

TEST_CASE("A build without GStreamer says how to get one with it", "[gstreamer]") {
  PipelineSettings settings;
  settings.text = "videotestsrc";
  PipelineSource source(settings);
  const DeviceFault fault = source.open();
  CHECK(fault.kind == DeviceFaultKind::kUnsupported);
  CHECK_THAT(std::string(fault.text()), Catch::Contains("-DSWIFTLET_WITH_GSTREAMER=ON and build again"));
  CapturedFrame frame;
  CHECK(!source.next(frame).ok());
  CHECK(!frame.valid());
  CHECK(!source.isOpen());
}

}  // namespace
}  // namespace swiftlet
