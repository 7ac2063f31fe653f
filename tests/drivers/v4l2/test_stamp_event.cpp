// What the stamps of a driver mark.

#include <linux/videodev2.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/v4l2/stamp_event.hpp"

namespace swiftlet {
namespace {

/// Of uvcvideo, whose parameter holds `value`.
bool uvcStampsFirstData(const std::string& value) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("swiftlet_hwtimestamps_" + std::to_string(getpid()));
  std::ofstream(file) << value;
  const bool first_data = stampsFirstData("uvcvideo", file.c_str());
  std::filesystem::remove(file);
  return first_data;
}

TEST_CASE("uvcvideo stamps the first data unless it uses the camera's clock", "[v4l2]") {
  CHECK(uvcStampsFirstData("0\n"));
  CHECK(uvcStampsFirstData(""));
  CHECK_FALSE(uvcStampsFirstData("1\n"));
  CHECK(stampsFirstData("uvcvideo", "/no/such/parameter"));
  CHECK_FALSE(stampsFirstData("vivid", "/no/such/parameter"));
}

TEST_CASE("the event of a stamp follows the flags and the driver", "[v4l2]") {
  constexpr std::uint32_t kStart = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  constexpr std::uint32_t kEnd = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  CHECK(stampEvent(kStart, false) == StampEvent::kStartOfExposure);
  CHECK(stampEvent(kStart, true) == StampEvent::kEndOfExposure);
  CHECK(stampEvent(kEnd, false) == StampEvent::kEndOfFrame);
  CHECK(stampEvent(V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN, true) == StampEvent::kArrival);
}

}  // namespace
}  // namespace swiftlet
