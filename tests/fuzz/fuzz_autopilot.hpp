#pragma once
// What comes from an autopilot, into the link that tells it of the estimate, and into what is said to one
// that is the IMU: any bytes, in several pieces.

#include <string_view>

namespace swiftlet::fuzz {

/// What is sent meanwhile are whole frames at the set rate; TIMESYNC requests are answered and nothing else
/// is. Readings are finite, and no more is asked than one message's rate.
void autopilotStream(std::string_view text);

}  // namespace swiftlet::fuzz
