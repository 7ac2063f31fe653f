#pragma once
// Names of the messages' enumerators in files.

#include <optional>
#include <string_view>

#include "estimator/messages/odometry_output.hpp"

namespace swiftlet {

std::string_view healthName(Health health);
/// Empty if the text is none of these names.
std::optional<Health> healthNamed(std::string_view name);
std::string_view eventName(EventKind kind);
std::string_view doubtName(Doubt doubt);

}  // namespace swiftlet
