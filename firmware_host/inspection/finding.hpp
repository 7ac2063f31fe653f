#pragma once
// A mistake in units, axes, clocks or calibration that the data of a log or of live devices show.

#include <string>

namespace swiftlet {

struct Finding {
  std::string what;      ///< the mistake, a few words
  std::string evidence;  ///< what the data say beside what they should say, with units
  std::string remedy;    ///< what to change

  [[nodiscard]] std::string line() const { return what + ": " + evidence + ". " + remedy + "."; }
};

/// What the data say, beside what the calibration says.
struct Measured {
  std::string what;
  std::string found;
};

}  // namespace swiftlet
