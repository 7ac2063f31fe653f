#pragma once
// The secret that viewers must know if the live view is served beyond loopback.

#include <cstddef>
#include <string>
#include <string_view>

#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

/// Environment variable with the user's own token, for services, whose printed address is not read at each
/// start.
inline constexpr const char* kViewTokenVariable = "SWIFTLET_VIEW_TOKEN";
inline constexpr std::size_t kLeastToken = 16;  ///< characters of a user's own token

/// Empty on loopback; otherwise the user's own token, or 128 random bits from the kernel as hexadecimal
/// digits. InputError naming the variable if its token is too short or has characters that are not allowed in
/// an address.
std::string viewToken(const ViewAddress& address);

/// Compares in a time that does not depend on where the tokens differ.
[[nodiscard]] bool sameToken(std::string_view expected, std::string_view given);

}  // namespace swiftlet
