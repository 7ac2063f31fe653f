#pragma once
// Small steps that the camera tests share.

#include <poll.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "drivers/v4l2/camera_device.hpp"

namespace swiftlet::stream {

inline CameraDeviceSettings settings(const std::string& path, const char* format = "GREY", int width = 752,
                                     int height = 480, double rate = 20) {
  CameraDeviceSettings s;
  s.setPath(path.c_str());
  s.setFormat(format);
  s.width = width;
  s.height = height;
  s.rate = rate;
  return s;
}

/// The next frame within `ms`; not valid, and `fault` set where one came, else.
inline DeviceFault wait(CameraDevice& camera, CapturedFrame& frame, int ms = 1000) {
  pollfd waiting = {camera.fd(), POLLIN, 0};
  ::poll(&waiting, 1, ms);
  return camera.next(frame);
}

inline std::vector<std::uint8_t> grey(const RawImage& image) {
  GreyReader reader;
  reader.reserve(image.format, image.width, image.height, false);
  std::vector<std::uint8_t> out;
  for (const ImageView& view : reader.read(image)) {
    for (int y = 0; y < view.height; ++y) out.insert(out.end(), view.row(y), view.row(y) + view.width);
  }
  return out;
}

/// One frame of a camera that is opened for it; empty when it does not come.
inline std::vector<std::uint8_t> oneGrey(const CameraDeviceSettings& s) {
  CameraDevice camera;
  const DeviceFault fault = camera.open(s);
  INFO(describe(fault, s.path.data()));
  REQUIRE(fault.ok());
  CapturedFrame frame;
  for (int i = 0; i < 3 && !frame.valid(); ++i) REQUIRE(wait(camera, frame).ok());
  REQUIRE(frame.valid());
  return grey(frame.image);
}

}  // namespace swiftlet::stream
