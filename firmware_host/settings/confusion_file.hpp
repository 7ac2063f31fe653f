#pragma once
// How often a segmentation takes one label for another, as a file: what map.confusion names.

#include <optional>
#include <string>

#include "firmware_host/settings/settings.hpp"
#include "mapping/volume/confusion_model.hpp"

namespace swiftlet {

/// Lines `true,said,probability` (`#` starts a comment), labels from 1 to 31. The probabilities of one true
/// label sum to 1; pairs that are not listed have probability 0. A true label without any line is recognized
/// with probability `right`, and the other labels share the rest equally. InputError with line, field and
/// remedy.
ConfusionModel readConfusion(const std::string& path, float right);

/// Of the file that map.confusion names; empty if it names none.
std::optional<ConfusionModel> confusionOf(const Settings& settings);

}  // namespace swiftlet
