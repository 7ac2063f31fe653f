#pragma once
// Formats, sizes and rates that a video node offers: as text for a fault, and as lists for a camera search.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_node.hpp"

namespace swiftlet {

[[nodiscard]] bool offersFormat(const VideoNode& node, std::uint32_t fourcc);
/// "GREY YUYV MJPG H264": supported formats first. These three functions write at most `size` bytes including
/// the final 0, cut at a blank, and do not allocate.
void writeFormats(const VideoNode& node, char* out, std::size_t size);
/// "640x480 752x480": the sizes of one format.
void writeSizes(const VideoNode& node, std::uint32_t fourcc, char* out, std::size_t size);
/// "10 20 30": the frame rates of one format and size.
void writeRates(const VideoNode& node, std::uint32_t fourcc, int width, int height, char* out,
                std::size_t size);
/// The lowest frame rate of one format and size that is not below `at_least`; empty if there is none.
[[nodiscard]] std::optional<double> slowestOffered(const VideoNode& node, std::uint32_t fourcc, int width,
                                                   int height, double at_least);

struct FormatOffer {
  std::string fourcc;
  bool taken = false;              ///< a format in kPixelFormats
  std::vector<std::string> sizes;  ///< "752x480", or "16x16 to 1920x1080"
};

struct CameraListing {
  std::string path;
  std::string driver;
  std::string card;
  std::string bus;
  std::vector<FormatOffer> formats;
  DeviceFault fault;  ///< why it could not be queried (no rights), or that it is not a camera
};

/// Every /dev/video* by number, including those that are not cameras. Allocates; not for flight.
std::vector<CameraListing> listCameras();

}  // namespace swiftlet
