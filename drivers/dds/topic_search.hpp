#pragma once
// Message for a user whose topic has no publisher: the types published under its name, and similar names.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/dds/dds_domain.hpp"

namespace swiftlet {

/// "no publisher of sensor_msgs/msg/Image on /cam/image; near: /camera/image, ...": at most three names of
/// that type, the nearest first; or the message that `name` has another type.
[[nodiscard]] std::string missingTopic(std::span<const PublishedTopic> published, std::string_view type,
                                       std::string_view name);

}  // namespace swiftlet
