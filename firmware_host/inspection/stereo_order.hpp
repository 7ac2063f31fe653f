#pragma once
// Detects exchanged camera images. Corners of one image are searched for in the other, with the calibration
// as given and with the images exchanged: points in front of both cameras are found only in the right order.

#include <cstddef>
#include <optional>

#include "drivers/calibration/calibration.hpp"
#include "estimator/frontend/pyramid.hpp"
#include "estimator/frontend/stereo_matcher.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"
#include "firmware_host/inspection/finding.hpp"

namespace swiftlet {

class StereoOrder {
 public:
  /// Checks only if both cameras have images of the same size.
  explicit StereoOrder(const Rig& rig);

  [[nodiscard]] bool wantsMore() const { return matcher_ && pairs_ < kPairs; }
  /// `image0`, `points`: the newest image of camera 0; `image1`: the image of camera 1 at the same time.
  void add(const Pyramid& image0, const TrackedImage& points, const ImageView& image1);
  [[nodiscard]] std::optional<Finding> finding() const;

 private:
  static constexpr std::size_t kPairs = 20;

  std::optional<StereoMatcher> matcher_;
  std::size_t pairs_ = 0;
  std::size_t points_ = 0;
  std::size_t as_given_ = 0;  ///< points found in the given order
  std::size_t exchanged_ = 0;
};

}  // namespace swiftlet
