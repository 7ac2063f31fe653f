#pragma once
// A plain folder of pictures as the images of a trajectory. Host side: allocates, throws InputError.

#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/camera/rig.hpp"
#include "firmware_host/lab/modules/image_folder.hpp"

namespace swiftlet {

struct PlaceImage {
  std::string path;
  Stamp stamp;
};

/// A folder that is no log and has pictures directly in it.
bool isPlainImageFolder(const std::string& path);

/// In the order of time. Names that are numbers are stamps: nanoseconds, or seconds where they have a point.
/// Where a name is none, or no stamp lies within the trajectory, each picture takes the stamp of one pose, in
/// order; InputError if there are not as many of both.
std::vector<PlaceImage> stampedImages(const std::string& folder, const Trajectory& trajectory);

/// One camera without distortion: bearings that nothing is computed from.
Rig pictureRig(ImageSize size);

}  // namespace swiftlet
