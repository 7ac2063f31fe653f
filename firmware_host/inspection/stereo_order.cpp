#include "firmware_host/inspection/stereo_order.hpp"

#include <fmt/format.h>

namespace swiftlet {
namespace {

constexpr int kMatcherLevels = 4;
// Some percent of the points give false matches that pass the matcher's checks; far points match both ways.
constexpr std::size_t kTimesAsMany = 3;
constexpr std::size_t kFewestMatches = 40;

}  // namespace

StereoOrder::StereoOrder(const Rig& rig) {
  if (rig.camera_count < 2 || rig.camera[0].width() != rig.camera[1].width() ||
      rig.camera[0].height() != rig.camera[1].height()) {
    return;
  }
  matcher_.emplace(rig, StereoMatcherSettings{});
}

void StereoOrder::add(const Pyramid& image0, const TrackedImage& points, const ImageView& view1) {
  Pyramid image1(view1.width, view1.height, kMatcherLevels);
  image1.build(view1);
  ++pairs_;
  for (const TrackedPoint& point : points.points) {
    Eigen::Vector2f pixel;
    ++points_;
    if (matcher_->match(image0, 0, point.pixel, image1, pixel)) ++as_given_;
    // Matching with the two images exchanged.
    if (matcher_->match(image0, 1, point.pixel, image1, pixel)) ++exchanged_;
  }
}

std::optional<Finding> StereoOrder::finding() const {
  if (exchanged_ < kFewestMatches || exchanged_ < kTimesAsMany * as_given_) return {};
  return Finding{"cameras swapped",
                 fmt::format("of {} points of camera 0, {} are found in camera 1 with the calibration as "
                             "given, and {} with the images swapped",
                             points_, as_given_, exchanged_),
                 "Swap cam0 and cam1: the images, topics or devices, or both cameras' calibrations"};
}

}  // namespace swiftlet
