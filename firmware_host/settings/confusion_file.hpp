#pragma once
// Reads how often a segmentation confuses labels, from the file named by map.confusion.

#include <optional>
#include <string>

#include "firmware_host/settings/settings.hpp"
#include "mapping/volume/confusion_model.hpp"

namespace swiftlet {

/// Lines `true,predicted,probability` (`#` starts a comment), labels from 1 to 31. The probabilities of one
/// true label sum to 1; pairs that are not listed have probability 0. A true label without any line is
/// recognized with probability `right`, and the other labels share the rest equally. InputError with line,
/// field and remedy.
ConfusionModel readConfusion(const std::string& path, float right);

/// Reads the file named by map.confusion; empty if none is named.
std::optional<ConfusionModel> confusionOf(const Settings& settings);

}  // namespace swiftlet
