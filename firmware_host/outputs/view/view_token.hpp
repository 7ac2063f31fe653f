#pragma once
// The secret that a viewer has to know where the live view is served beyond loopback.

#include <cstddef>
#include <string>
#include <string_view>

#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

/// Names a token of the user's own: for a service, whose printed address nobody reads at each start.
inline constexpr const char* kViewTokenVariable = "SWIFTLET_VIEW_TOKEN";
inline constexpr std::size_t kLeastToken = 16;  ///< characters of one's own

/// Empty on loopback; else the user's own, or 128 random bits of the kernel's in hexadecimal digits.
/// InputError naming the variable where its token is short, or has characters that an address has not.
std::string viewToken(const ViewAddress& address);

/// In a time that does not depend on where they differ.
[[nodiscard]] bool sameToken(std::string_view expected, std::string_view given);

}  // namespace swiftlet
