#pragma once
// What comes from an autopilot, into the link that tells it of the estimate: any bytes, in several pieces.

#include <string_view>

namespace swiftlet::fuzz {

/// What is sent meanwhile are whole frames at the set rate; TIMESYNC requests are answered and nothing else
/// is.
void autopilotStream(std::string_view text);

}  // namespace swiftlet::fuzz
