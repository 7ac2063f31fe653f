#include "firmware_host/lab/modules/vocabulary_images.hpp"

#include <fmt/format.h>

#include <memory>

#include "firmware_host/lab/modules/image_folder.hpp"
#include "firmware_host/realtime/progress.hpp"
#include "mapping/place/place_extractor.hpp"

namespace swiftlet {

TrainingImages describeImages(const std::vector<std::string>& folders, int every, int features) {
  std::vector<std::string> files;
  for (const std::string& folder : folders) {
    const std::vector<std::string> all = imagesUnder(folder);
    for (std::size_t i = 0; i < all.size(); i += static_cast<std::size_t>(every)) files.push_back(all[i]);
  }
  TrainingImages out;
  PlaceExtractorSettings settings;
  settings.features = features;
  std::unique_ptr<PlaceExtractor> extractor;
  CameraModel camera;
  const TrackedFrame no_tracks;
  const auto keyframe = std::make_unique<PlaceKeyframe>();
  ImageFile image;
  Progress progress("describing images", files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    progress.update(i);
    if (!image.read(files[i])) {
      fmt::print(stderr, "warning: {}: not a readable image, skipped\n", files[i]);
      continue;
    }
    const ImageView view = image.view();
    if (!extractor || camera.width() != view.width || camera.height() != view.height) {
      extractor = std::make_unique<PlaceExtractor>(view.width, view.height, settings);
      // Bearings are not used, so any camera without distortion will do.
      camera = CameraModel(CameraKind::kPinholeRadtan, view.width, view.height,
                           Eigen::Vector4d(view.width, view.width, 0.5 * view.width, 0.5 * view.height),
                           Eigen::Vector4d::Zero());
    }
    if (!extractor->extract(view, camera, no_tracks, *keyframe).ok()) continue;
    for (const PlaceFeature& f : keyframe->features) out.descriptors.push_back(f.descriptor);
    out.ends.push_back(out.descriptors.size());
  }
  progress.finish();
  return out;
}

}  // namespace swiftlet
