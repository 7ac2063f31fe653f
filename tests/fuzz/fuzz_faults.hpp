#pragma once
// The timeline of faults as a fuzz target.

#include <string_view>

namespace swiftlet::fuzz {

/// Read or refused; what was read is within its bounds, in order, and reads back the same.
void faults(std::string_view text);

}  // namespace swiftlet::fuzz
