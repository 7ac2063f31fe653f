#pragma once
// The reader of keyframes.swk as a fuzz target, and full smoothing over what it lets through.

#include <string_view>

namespace swiftlet::fuzz {

/// Read twice: as it is, and with all checksums made right, so that wrong contents get past them.
void keyframes(std::string_view text);

}  // namespace swiftlet::fuzz
