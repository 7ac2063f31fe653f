#include "drivers/bag/qos_text.hpp"

namespace swiftlet {

std::string ros2Type(std::string_view type) {
  const std::size_t slash = type.find('/');
  return std::string(type.substr(0, slash)) + "/msg" + std::string(type.substr(slash));
}

std::string qosText(bool latched) {
  // With an empty text a player uses its defaults: reliable, volatile, the last 10.
  if (!latched) return "";
  // Values of rmw's enumerations: keep last, reliable, transient local, automatic. The longest duration means
  // "never".
  constexpr std::string_view kNever = "    sec: 9223372036\n    nsec: 854775807\n";
  std::string text = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n";
  for (const char* name : {"deadline", "lifespan"})
    text += std::string("  ") + name + ":\n" + std::string(kNever);
  text += "  liveliness: 1\n  liveliness_lease_duration:\n" + std::string(kNever);
  return text + "  avoid_ros_namespace_conventions: false";
}

}  // namespace swiftlet
