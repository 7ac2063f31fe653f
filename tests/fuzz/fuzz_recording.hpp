#pragma once
// The reader of flight recordings as a fuzz target.

#include <string_view>

namespace swiftlet::fuzz {

/// `text` is the segments of a recording one after the other; each begins with the magic bytes. Read twice:
/// as it is, and with all checksums made right, so that wrong contents get past them.
void recording(std::string_view text);

}  // namespace swiftlet::fuzz
