#pragma once
// How often a segmentation takes one label for another, as a file: what map.confusion names.

#include <optional>
#include <string>

#include "firmware_host/settings/settings.hpp"
#include "mapping/volume/confusion_model.hpp"

namespace swiftlet {

/// Lines `true,said,probability` (`#` begins a remark), labels from 1 to 31. The probabilities of one true
/// label sum to 1; what is not listed of it is never said. A true label that is not listed at all is said
/// with probability `right`, the others alike in its place. InputError with line, field and remedy.
ConfusionModel readConfusion(const std::string& path, float right);

/// Of the file that map.confusion names; empty where it names none.
std::optional<ConfusionModel> confusionOf(const Settings& settings);

}  // namespace swiftlet
