#pragma once
// Are the images of the two cameras exchanged? Corners of one are looked for in the other as the calibration
// has it, and with the images exchanged: points in front of both cameras are found one way only.

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
  /// Looks only where both cameras have images of one size.
  explicit StereoOrder(const Rig& rig);

  [[nodiscard]] bool wantsMore() const { return matcher_ && pairs_ < kPairs; }
  /// The newest image of camera 0 with its points, and that of camera 1 of the same time.
  void add(const Pyramid& image0, const TrackedImage& points, const ImageView& image1);
  [[nodiscard]] std::optional<Finding> finding() const;

 private:
  static constexpr std::size_t kPairs = 20;

  std::optional<StereoMatcher> matcher_;
  std::size_t pairs_ = 0;
  std::size_t points_ = 0;
  std::size_t as_given_ = 0;  ///< points found
  std::size_t exchanged_ = 0;
};

}  // namespace swiftlet
