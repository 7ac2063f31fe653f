#pragma once
// Inverse distances of a place keyframe's features: from the stereo pair's second image, and from the
// odometry's landmarks.
//
// Stereo: a feature's ray is cut at inverse distances from 0 to 1 / min_distance and projected into camera 1
// through its own lens model, one pixel apart at half resolution; at each the patch of camera 0, warped by
// the rotation between the cameras and both lenses, is compared by zero-mean normalized correlation. The best
// place must be clearly better than its rivals; it is refined in camera 1 to a part of a pixel (Lucas, Kanade
// 1981, two unknown shifts, mean removed) and must stay near the epipolar curve. The inverse distance is the
// one whose projection is nearest, its sigma that of the match over the pixels that a unit of inverse
// distance moves.
//
// Landmarks: distance from camera 0 to the smoother's point. Their sigma is the smoother's (along the first
// sighting's ray), not below a part of the inverse distance: it knows nothing of its own linearization.
//
// No allocation after construction. Stereo: 10 us per feature on 752 x 480, 11 cm baseline; memory: two
// images of half the size each.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

struct StereoDepthSettings {
  double min_distance = 0.4;      ///< m
  double pixel_sigma = 0.2;       ///< px, of a match along the epipolar curve
  double epipolar_gate = 1.5;     ///< px
  float min_correlation = 0.75F;  ///< at full resolution
  float rival_lead = 0.05F;  ///< a rival with a correlation less than this below the best makes it unsafe
};

class StereoDepth {
 public:
  /// `rig` has two cameras; images are of their sizes.
  explicit StereoDepth(const Rig& rig, const StereoDepthSettings& settings = {});

  /// Sets inverse_depth and its sigma of the features that camera 1 sees safely; leaves those of the others,
  /// and features whose depth is known better already. `found` counts the former. kInvalidInput: image sizes.
  Status fill(const ImageView& image0, const ImageView& image1, PlaceKeyframe& keyframe, std::size_t& found);

 private:
  struct HalfImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
    [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
  };
  struct Match {
    double inverse_depth = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  };
  [[nodiscard]] bool warpAt(const Eigen::Vector2d& pixel, double inverse_depth, Eigen::Matrix2d& warp) const;
  [[nodiscard]] bool search(const PlaceFeature& feature, const Eigen::Vector3d& bearing, Match& match) const;
  [[nodiscard]] bool refine(const ImageView& image0, const ImageView& image1, const PlaceFeature& feature,
                            Match& match) const;
  [[nodiscard]] bool inverseDepthOf(const Eigen::Vector3d& bearing, const Match& match, double& inverse_depth,
                                    double& sigma) const;

  Rig rig_;
  StereoDepthSettings settings_;
  SE3 T_1_0_;
  std::array<HalfImage, 2> half_;
};

class LandmarkDepth {
 public:
  explicit LandmarkDepth(double min_relative_sigma = 0.01) : min_relative_sigma_(min_relative_sigma) {}

  /// Sets inverse_depth and its sigma of the features whose landmark is in the window, where it is known
  /// better than before. `frame` finds the pose: WindowPose::frame_index. kNotReady: the window has not
  /// started, or does not hold that frame; kInvalidInput: another epoch.
  Status fill(const SmoothedWindow& window, const SE3& T_body_cam0, PlaceKeyframe& keyframe,
              std::size_t& found);

 private:
  double min_relative_sigma_;
  std::array<std::uint16_t, kMaxLandmarks> order_{};  ///< landmarks by id
};

}  // namespace swiftlet
