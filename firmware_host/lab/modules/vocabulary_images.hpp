#pragma once
// Descriptors of image files, for training a vocabulary.
//
// Host side: allocates, throws InputError.

#include <cstddef>
#include <string>
#include <vector>

#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

struct TrainingImages {
  std::vector<Descriptor> descriptors;
  std::vector<std::size_t> ends;  ///< index after each image's last descriptor
};

/// All .png, .jpg and .jpeg files under the folders, every `every`-th of each folder in the order of their
/// names. InputError if a folder cannot be read or has none. Images that cannot be decoded are named on
/// stderr and skipped.
TrainingImages describeImages(const std::vector<std::string>& folders, int every, int features);

}  // namespace swiftlet
