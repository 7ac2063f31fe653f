#pragma once
// Words for the enumerations of the messages, as they stand in files.

#include <string_view>

#include "estimator/messages/odometry_output.hpp"

namespace swiftlet {

std::string_view healthName(Health health);
std::string_view eventName(EventKind kind);

}  // namespace swiftlet
