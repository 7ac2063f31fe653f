#pragma once
// Finds the image sensor of a video node by walking the kernel's media graph upstream. For raw cameras,
// exposure and gain are controls of the sensor's own subdevice.
//
// Memory: 30 kB of stack while a graph is read; no allocation. A graph with more than 128 entities,
// interfaces, pads or links is not read. Source: linux/media.h; the kernel's Documentation,
// media/mediactl/media-ioc-g-topology.rst.

#include <linux/media.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/v4l2/control_port.hpp"

namespace swiftlet {

struct MediaGraph {
  std::span<const media_v2_entity> entities;
  std::span<const media_v2_interface> interfaces;
  std::span<const media_v2_pad> pads;
  std::span<const media_v2_link> links;
};

struct NodeNumber {
  std::uint32_t major = 0;
  std::uint32_t minor = 0;
  [[nodiscard]] constexpr bool operator==(const NodeNumber&) const = default;
};

/// A sensor's name, such as "imx219 10-0010", and its node.
struct FoundSensor {
  std::array<char, 64> name = {};
  NodeNumber node;
};

/// The sensor whose images reach `video` over enabled links; empty: no sensor, or one without a node.
[[nodiscard]] std::optional<FoundSensor> sensorBefore(const MediaGraph& graph, NodeNumber video);

class SensorSubdevice : public ControlPort {
 public:
  SensorSubdevice() = default;
  ~SensorSubdevice() override { close(); }

  /// False: no sensor was found upstream of this video node, or its node cannot be opened.
  bool openBefore(int video_fd);
  void close();

  int call(unsigned long request, void* argument) const override { return callNode(fd_, request, argument); }
  [[nodiscard]] const char* name() const { return sensor_.name.data(); }
  /// Width of the sensor's images [px]; 0: unknown.
  [[nodiscard]] int width() const;

 private:
  int fd_ = -1;
  FoundSensor sensor_;
};

}  // namespace swiftlet
