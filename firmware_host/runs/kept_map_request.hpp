#pragma once
// Options of a run that concern kept maps.

#include <string>

#include "drivers/input/input_error.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct KeptMapRequest {
  std::string keep;     ///< new folder for this run's places, graph and volume; empty: none; closes loops
  std::string in;       ///< folder of a kept map in which the run is located; sets loop.in_map
  bool extend = false;  ///< continue the map; sets loop.extend_map

  /// InputError if the run is located in a kept map that is not extended, and a map is to be kept.
  void apply(Settings& settings) const {
    if (!in.empty()) settings.loop.in_map = in;
    if (extend) settings.loop.extend_map = true;
    if (!keep.empty() && !settings.loop.in_map.empty() && !settings.loop.extend_map) {
      throw InputError(keep, 0, "--keep-map", "--in-map without --extend only localizes",
                       "Add --extend to continue the map in a new folder, or omit --keep-map");
    }
    if (!keep.empty() || !settings.loop.in_map.empty()) settings.loop.enabled = true;
  }
};

}  // namespace swiftlet
