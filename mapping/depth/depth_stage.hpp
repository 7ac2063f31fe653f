#pragma once
// Raw stereo pair to depth image: rectification, semi-global matching, depth with its standard deviation.
//
// Depth z = f b / d and sigma_z = z^2 / (f b) sigma_d, in metres along the axis of the rectified camera 0;
// sigma_d is from the matcher. Pixels nearer than `min_depth` have no depth. There is no upper limit, because
// a far surface proves that the space in front of it is free. Errors: kInvalidInput (an image missing or of
// another size, a rig that cannot be rectified, an output of another size); the output is then unchanged and
// the step counted. Memory: fixed by the constructor, 38 bytes a pixel and the matcher's strips. Time grows
// with pixels x disparities. One thread, no clock, deterministic. docs/depth.md.

#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/depth/depth_buffer.hpp"
#include "mapping/depth/semi_global_matcher.hpp"
#include "mapping/depth/stereo_rectification.hpp"

namespace swiftlet {

struct DepthSettings {
  MatcherSettings matcher;
  double min_depth = 0.2;  ///< m
  /// Nearest depth [m] that the pair should measure: if the matcher's disparities do not reach it, more are
  /// searched, up to the maximum. A vehicle must see obstacles at a distance of a metre.
  double wanted_nearest = 1.0;
};

struct DepthEffort {
  /// Number of disparities searched, at most the settings', in steps of 32. Time is proportional. Objects
  /// nearer than f b / disparities get no depth or a wrong one.
  int disparities = 32 * kMaxDisparityVectors;
};

struct DepthCounters {
  std::uint64_t images = 0;          ///< depth images delivered
  std::uint64_t refused = 0;         ///< steps with kInvalidInput
  std::uint64_t pixels = 0;          ///< of the delivered images
  std::uint64_t measured = 0;        ///< of these, with a depth
  std::uint64_t out_of_range = 0;    ///< measured, but nearer than min_depth
  std::uint64_t label_images = 0;    ///< warped
  std::uint64_t labels_refused = 0;  ///< of a wrong size
};

class DepthStage {
 public:
  explicit DepthStage(const Rig& rig, const DepthSettings& settings = {});

  /// Not ok if the rig cannot be rectified; every step is then refused.
  [[nodiscard]] const Status& status() const { return rectification_.status(); }
  [[nodiscard]] const StereoRectification& rectification() const { return rectification_; }
  /// A buffer of the right size for step().
  [[nodiscard]] DepthBuffer makeBuffer() const;

  /// `left`, `right`: raw images of cameras 0 and 1. Clears the output's labels.
  Status step(const ImageView& left, const ImageView& right, Stamp stamp, const DepthEffort& effort,
              DepthBuffer& out);

  /// Adds labels in camera 0's raw geometry to the output of a step.
  Status addLabels(const ImageView& labels, DepthBuffer& out);

  /// Depth [m] of the largest disparity. Nearer surfaces get no depth or a wrong one.
  [[nodiscard]] double nearestDepth() const;
  [[nodiscard]] const DisparityImage& disparity() const { return disparity_; }
  [[nodiscard]] const DepthCounters& counters() const { return counters_; }

 private:
  void fillDepth(DepthBuffer& out);

  DepthSettings settings_;
  StereoRectification rectification_;
  SemiGlobalMatcher matcher_;
  std::vector<std::uint8_t> left_;
  std::vector<std::uint8_t> right_;
  DisparityImage disparity_;
  std::vector<std::uint32_t> uncovered_;  ///< rectified pixels of camera 0 without a raw pixel
  DepthCounters counters_;
};

}  // namespace swiftlet
