#pragma once
// Statistics that have a short form in the plain set of tests and their full form in the long one: the same
// checks over fewer seeds, cuts or runs. SWIFTLET_LONG=1 asks for the full form; CTest sets it for tests
// labelled long.

#include <cstdlib>
#include <string_view>

namespace swiftlet {

inline bool longRun() {
  const char* chosen = std::getenv("SWIFTLET_LONG");
  return chosen != nullptr && std::string_view(chosen) == "1";
}

template <typename T>
T longOr(T full, T brief) {
  return longRun() ? full : brief;
}

}  // namespace swiftlet
