#include "drivers/v4l2/sensor_node.hpp"

#include <fcntl.h>
#include <linux/v4l2-subdev.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace swiftlet {
namespace {

constexpr std::size_t kMaxMedia = 128;  // entities, interfaces, pads or links; a Jetson's graph has about 60
constexpr int kMediaDevices = 16;
constexpr int kSubdevices = 128;

template <typename T>
const T* byId(std::span<const T> all, std::uint32_t id) {
  // The kernel's structures are packed, so no reference to a member can be taken.
  const auto found = std::ranges::find_if(all, [&](const T& element) { return element.id == id; });
  return found == all.end() ? nullptr : &*found;
}

bool isInterfaceLink(const media_v2_link& link) {
  constexpr auto kType = static_cast<std::uint32_t>(MEDIA_LNK_FL_LINK_TYPE);
  return (link.flags & kType) == MEDIA_LNK_FL_INTERFACE_LINK;
}

/// The entity at the other end of an interface's link; 0: none.
std::uint32_t entityOf(const MediaGraph& graph, std::uint32_t interface) {
  const auto link = std::ranges::find_if(
      graph.links, [&](const media_v2_link& l) { return isInterfaceLink(l) && l.source_id == interface; });
  return link == graph.links.end() ? 0 : link->sink_id;
}

std::optional<NodeNumber> nodeOf(const MediaGraph& graph, std::uint32_t entity) {
  for (const media_v2_interface& interface : graph.interfaces) {
    if (interface.intf_type == MEDIA_INTF_T_V4L_SUBDEV && entityOf(graph, interface.id) == entity) {
      return NodeNumber{interface.devnode.major, interface.devnode.minor};
    }
  }
  return std::nullopt;
}

/// A media graph with its storage.
struct ReadGraph {
  std::array<media_v2_entity, kMaxMedia> entities = {};
  std::array<media_v2_interface, kMaxMedia> interfaces = {};
  std::array<media_v2_pad, kMaxMedia> pads = {};
  std::array<media_v2_link, kMaxMedia> links = {};
};

std::optional<FoundSensor> sensorIn(int media, NodeNumber video) {
  ReadGraph memory;
  media_v2_topology topology = {};
  topology.num_entities = topology.num_interfaces = topology.num_pads = topology.num_links = kMaxMedia;
  topology.ptr_entities = reinterpret_cast<std::uintptr_t>(memory.entities.data());
  topology.ptr_interfaces = reinterpret_cast<std::uintptr_t>(memory.interfaces.data());
  topology.ptr_pads = reinterpret_cast<std::uintptr_t>(memory.pads.data());
  topology.ptr_links = reinterpret_cast<std::uintptr_t>(memory.links.data());
  if (callNode(media, MEDIA_IOC_G_TOPOLOGY, &topology) != 0) return std::nullopt;
  return sensorBefore(
      {std::span(memory.entities).first(topology.num_entities),
       std::span(memory.interfaces).first(topology.num_interfaces),
       std::span(memory.pads).first(topology.num_pads), std::span(memory.links).first(topology.num_links)},
      video);
}

NodeNumber numberOf(const struct stat& status) {
  return {static_cast<std::uint32_t>(major(status.st_rdev)),
          static_cast<std::uint32_t>(minor(status.st_rdev))};
}

int openSubdevice(NodeNumber node) {
  std::array<char, 32> path = {};
  for (int i = 0; i < kSubdevices; ++i) {
    std::snprintf(path.data(), path.size(), "/dev/v4l-subdev%d", i);
    struct stat status = {};
    if (::stat(path.data(), &status) == 0 && S_ISCHR(status.st_mode) && numberOf(status) == node) {
      return ::open(path.data(), O_RDWR | O_CLOEXEC | O_NOCTTY);
    }
  }
  return -1;
}

}  // namespace

std::optional<FoundSensor> sensorBefore(const MediaGraph& graph, NodeNumber video) {
  const auto own = std::ranges::find_if(graph.interfaces, [&](const media_v2_interface& interface) {
    return interface.intf_type == MEDIA_INTF_T_V4L_VIDEO &&
           NodeNumber{interface.devnode.major, interface.devnode.minor} == video;
  });
  if (own == graph.interfaces.end()) return std::nullopt;
  // Entities upstream of the video node, nearest first.
  std::array<std::uint32_t, kMaxMedia> way{};
  std::size_t count = 0;
  way[count++] = entityOf(graph, own->id);
  for (std::size_t i = 0; i < count; ++i) {
    const media_v2_entity* entity = byId(graph.entities, way[i]);
    if (entity == nullptr) continue;
    if (entity->function == MEDIA_ENT_F_CAM_SENSOR) {
      const std::optional<NodeNumber> node = nodeOf(graph, entity->id);
      if (!node) return std::nullopt;
      FoundSensor sensor{{}, *node};
      std::snprintf(sensor.name.data(), sensor.name.size(), "%.63s", entity->name);
      return sensor;
    }
    for (const media_v2_link& link : graph.links) {
      if (isInterfaceLink(link) || (link.flags & MEDIA_LNK_FL_ENABLED) == 0) continue;
      const media_v2_pad* sink = byId(graph.pads, link.sink_id);
      const media_v2_pad* source = byId(graph.pads, link.source_id);
      if (sink == nullptr || source == nullptr || sink->entity_id != entity->id) continue;
      const std::uint32_t before = source->entity_id;
      const auto known = std::span(way).first(count);
      if (count < way.size() && std::ranges::find(known, before) == known.end()) way[count++] = before;
    }
  }
  return std::nullopt;
}

bool SensorSubdevice::openBefore(int video_fd) {
  close();
  struct stat status = {};
  if (::fstat(video_fd, &status) != 0) return false;
  std::array<char, 32> path = {};
  for (int i = 0; i < kMediaDevices && fd_ < 0; ++i) {
    std::snprintf(path.data(), path.size(), "/dev/media%d", i);
    const int media = ::open(path.data(), O_RDWR | O_CLOEXEC | O_NOCTTY);
    if (media < 0) continue;
    const std::optional<FoundSensor> found = sensorIn(media, numberOf(status));
    ::close(media);
    if (!found) continue;
    sensor_ = *found;
    fd_ = openSubdevice(found->node);
  }
  return fd_ >= 0;
}

void SensorSubdevice::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

int SensorSubdevice::width() const {
  v4l2_subdev_format format = {};
  format.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  return call(VIDIOC_SUBDEV_G_FMT, &format) == 0 ? static_cast<int>(format.format.width) : 0;
}

}  // namespace swiftlet
