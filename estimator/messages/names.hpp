#pragma once
// Words for the enumerations of the messages, as they stand in files.

#include <optional>
#include <string_view>

#include "estimator/messages/odometry_output.hpp"

namespace swiftlet {

std::string_view healthName(Health health);
/// None: no word of these.
std::optional<Health> healthNamed(std::string_view name);
std::string_view eventName(EventKind kind);
std::string_view doubtName(Doubt doubt);

}  // namespace swiftlet
