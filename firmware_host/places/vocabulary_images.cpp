#include "firmware_host/places/vocabulary_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "drivers/calibration/input_error.hpp"
#include "drivers/recorded/image_decoder.hpp"
#include "firmware_host/report/progress.hpp"
#include "mapping/place/place_extractor.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// Larger pictures are refused before memory is asked for them.
constexpr int kMaxSide = 16384;  // px

std::vector<std::string> imagesIn(const std::string& folder, int every) {
  std::vector<std::string> all;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string ending = at->path().extension().string();
    if (ending == ".png" || ending == ".jpg" || ending == ".jpeg") all.push_back(at->path().string());
  }
  if (error) {
    throw InputError(folder, 0, "", "cannot be read (" + error.message() + ")", "Give a folder of images");
  }
  if (all.empty()) throw InputError(folder, 0, "", "no .png or .jpg in it", "Give a folder of images");
  std::sort(all.begin(), all.end());
  std::vector<std::string> chosen;
  for (std::size_t i = 0; i < all.size(); i += static_cast<std::size_t>(every)) chosen.push_back(all[i]);
  return chosen;
}

/// Decodes whatever size a picture has.
class AnySize {
 public:
  bool read(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), {});
    ImageSize found;
    DecodeResult result = decoder_.decode(bytes_, size_, pixels_.data(), found);
    if (result == DecodeResult::kWrongSize && found.width > 0 && found.height > 0 &&
        found.width <= kMaxSide && found.height <= kMaxSide) {
      size_ = found;
      pixels_.resize(static_cast<std::size_t>(size_.width) * static_cast<std::size_t>(size_.height));
      result = decoder_.decode(bytes_, size_, pixels_.data(), found);
    }
    return result == DecodeResult::kOk;
  }
  [[nodiscard]] ImageView view() const { return {pixels_.data(), size_.width, size_.height, size_.width}; }

 private:
  ImageDecoder decoder_;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(1);
  ImageSize size_{1, 1};
};

}  // namespace

TrainingImages describeImages(const std::vector<std::string>& folders, int every, int features) {
  std::vector<std::string> files;
  for (const std::string& folder : folders) {
    const std::vector<std::string> some = imagesIn(folder, every);
    files.insert(files.end(), some.begin(), some.end());
  }
  TrainingImages out;
  PlaceExtractorSettings settings;
  settings.features = features;
  std::unique_ptr<PlaceExtractor> extractor;
  CameraModel camera;
  const TrackedFrame no_tracks;
  const auto keyframe = std::make_unique<PlaceKeyframe>();
  AnySize image;
  Progress progress("describing images", files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    progress.update(i);
    if (!image.read(files[i])) {
      fmt::print(stderr, "warning: {}: not a readable image, left out\n", files[i]);
      continue;
    }
    const ImageView view = image.view();
    if (!extractor || camera.width() != view.width || camera.height() != view.height) {
      extractor = std::make_unique<PlaceExtractor>(view.width, view.height, settings);
      // Bearings are not used: any camera without distortion does.
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
