#pragma once
// A mistake in units, axes, clocks or calibration that the data of a log or of live devices show.

#include <string>

namespace swiftlet {

struct Finding {
  std::string what;      ///< the mistake, in a few words
  std::string evidence;  ///< what the data show and what is expected, with units
  std::string remedy;    ///< what to change

  [[nodiscard]] std::string line() const { return what + ": " + evidence + ". " + remedy + "."; }
};

/// A value measured from the data, compared with the calibration.
struct Measured {
  std::string what;
  std::string found;
};

}  // namespace swiftlet
