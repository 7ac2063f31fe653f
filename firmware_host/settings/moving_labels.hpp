#pragma once
// Checks map.moving_labels; every command with a map calls it first.

#include "drivers/input/input_error.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

/// InputError if the text is no list of labels.
inline void checkMovingLabels(const MapSettings& settings) {
  if (labelMask(settings.moving_labels)) return;
  throw InputError("map.moving_labels", 0, "", "\"" + settings.moving_labels + "\" is not a list of labels",
                   "Write numbers from 1 to 31 separated by commas, for example 10,12");
}

}  // namespace swiftlet
