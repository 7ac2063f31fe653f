#pragma once
// The descriptors of image files, to train a vocabulary from.
//
// Host side: allocates, throws InputError.

#include <cstddef>
#include <string>
#include <vector>

#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

struct TrainingImages {
  std::vector<Descriptor> descriptors;
  std::vector<std::size_t> ends;  ///< one past each image's last
};

/// All .png, .jpg and .jpeg under the folders, every `every`-th of each folder in the order of their names.
/// InputError for a folder that cannot be read or holds none; images that cannot be decoded are named on
/// stderr and left out.
TrainingImages describeImages(const std::vector<std::string>& folders, int every, int features);

}  // namespace swiftlet
