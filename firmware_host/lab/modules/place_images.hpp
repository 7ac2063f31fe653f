#pragma once
// Uses a plain folder of images together with a trajectory. Host side: allocates, throws InputError.

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

/// Whether the folder is not a log and directly contains images.
bool isPlainImageFolder(const std::string& path);

/// In the order of time. Names that are numbers are stamps: nanoseconds, or seconds if they have a decimal
/// point. If a name is not a number, or no stamp is within the trajectory, each image gets the stamp of one
/// pose, in order; InputError if their numbers differ.
std::vector<PlaceImage> stampedImages(const std::string& folder, const Trajectory& trajectory);

/// A camera without distortion; its bearings are not used.
Rig pictureRig(ImageSize size);

}  // namespace swiftlet
