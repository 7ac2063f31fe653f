#pragma once
// What a fuzz target asks of the code under it: where it does not hold, the input is kept.

#include <cstdlib>

namespace swiftlet::fuzz {

inline void demand(bool holds) {
  if (!holds) std::abort();
}

}  // namespace swiftlet::fuzz
