#include "drivers/v4l2/stamp_event.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <unistd.h>

namespace swiftlet {

bool stampsFirstData(std::string_view driver, const char* parameter) {
  if (driver != "uvcvideo") return false;
  const int file = ::open(parameter, O_RDONLY | O_CLOEXEC);
  if (file < 0) return true;
  char digit = '0';  // an unsigned number, without leading zeros
  const bool is_set = ::read(file, &digit, 1) == 1 && digit != '0';
  ::close(file);
  return !is_set;
}

StampEvent stampEvent(std::uint32_t flags, bool first_data) {
  if ((flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
    return StampEvent::kArrival;
  // The first row's readout starts when its exposure ends.
  if (first_data) return StampEvent::kEndOfExposure;
  return (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
             ? StampEvent::kStartOfExposure
             : StampEvent::kEndOfFrame;
}

}  // namespace swiftlet
