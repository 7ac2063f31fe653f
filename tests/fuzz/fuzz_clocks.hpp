#pragma once
// Clock maps and trigger association as fuzz targets: any stamps in any order.

#include <string_view>

namespace swiftlet::fuzz {

/// `text` is commands of one byte, each followed by what it takes. Nothing overflows; stamps that are handed
/// out rise; a matched frame lies near its edge.
void clocks(std::string_view text);

}  // namespace swiftlet::fuzz
