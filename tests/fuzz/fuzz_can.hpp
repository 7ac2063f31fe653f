#pragma once
// The decoder of DroneCAN transfers as a fuzz target.

#include <string_view>

namespace swiftlet::fuzz {

/// `text` is frames one after the other: a byte for kind, node and time, a byte for the length, the data.
/// Then the same bytes as payloads of transfers that are right, so that wrong contents get past the checksum.
void dronecan(std::string_view text);

}  // namespace swiftlet::fuzz
