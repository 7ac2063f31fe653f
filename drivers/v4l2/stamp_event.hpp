#pragma once
// The event that the stamp of a V4L2 buffer marks: as its flags say, except for drivers whose flags are
// wrong.

#include <cstdint>
#include <string_view>

#include "drivers/image/camera_source.hpp"

namespace swiftlet {

/// Parameter of the module uvcvideo: 0, the default, stamps with the host's clock.
inline constexpr const char* kUvcHardwareStamps = "/sys/module/uvcvideo/parameters/hwtimestamps";

/// Whether the driver stamps the arrival of a frame's first data, whatever its flags say. uvcvideo flags all
/// buffers as stamped at the start of exposure, but without hwtimestamps uvc_video_decode_start() stamps them
/// with uvc_video_get_time() at the first payload, and uvc_video_clock_update() leaves the stamp.
/// `parameter`: the file of hwtimestamps. Reads one file.
bool stampsFirstData(std::string_view driver, const char* parameter = kUvcHardwareStamps);

/// `flags`: of v4l2_buffer. `first_data`: stampsFirstData().
StampEvent stampEvent(std::uint32_t flags, bool first_data);

}  // namespace swiftlet
