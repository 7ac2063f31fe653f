#include "firmware_host/lab/modules/place_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

bool anyWithin(const std::vector<PlaceImage>& images, const Trajectory& trajectory) {
  return std::any_of(images.begin(), images.end(), [&](const PlaceImage& image) {
    return image.stamp >= trajectory.front().stamp && image.stamp <= trajectory.back().stamp;
  });
}

}  // namespace

bool isPlainImageFolder(const std::string& path) {
  if (!fs::is_directory(path) || isAslFolder(path)) return false;
  for (const auto& entry : fs::directory_iterator(path)) {
    const std::string ending = entry.path().extension().string();
    if (ending == ".png" || ending == ".jpg" || ending == ".jpeg") return true;
  }
  return false;
}

std::vector<PlaceImage> stampedImages(const std::string& folder, const Trajectory& trajectory) {
  const std::vector<std::string> files = imagesUnder(folder);
  std::vector<PlaceImage> images;
  bool stamped = true;
  for (const std::string& file : files) {
    Stamp stamp;
    stamped = parseCsvStamp(fs::path(file).stem().string(), stamp) && stamped;
    images.push_back({file, stamp});
  }
  if (stamped && anyWithin(images, trajectory)) {
    std::ranges::stable_sort(images, {}, &PlaceImage::stamp);
    return images;
  }
  if (files.size() != trajectory.size()) {
    throw InputError(
        folder, 0, "",
        fmt::format("the names of its {} images do not match the trajectory's stamps, and it has {} poses",
                    files.size(), trajectory.size()),
        "Name images by their stamps [ns], or give one pose for each image in order");
  }
  for (std::size_t i = 0; i < files.size(); ++i) images[i] = {files[i], trajectory[i].stamp};
  return images;
}

Rig pictureRig(ImageSize size) {
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] =
      CameraModel(CameraKind::kPinholeRadtan, size.width, size.height,
                  Eigen::Vector4d(size.width, size.width, 0.5 * (size.width - 1), 0.5 * (size.height - 1)),
                  Eigen::Vector4d::Zero());
  return rig;
}

}  // namespace swiftlet
