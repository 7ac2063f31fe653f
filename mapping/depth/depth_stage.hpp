#pragma once
// A raw stereo pair to a depth image: rectification, semi-global matching, depth with its standard deviation.
//
// Depth z = f b / d and sigma_z = z^2 / (f b) sigma_d, in the rectified camera 0's frame (metres along its
// axis); sigma_d from the matcher. Pixels nearer than `min_depth` or beyond `max_depth` have none.
// Errors: kInvalidInput (an image missing or of another size, a rig that cannot be rectified, an output of
// another size): the output is untouched, the step counted. Memory: fixed by the constructor, 38 bytes a
// pixel and the matcher's strips; time by pixels x disparities. One thread, no clock, deterministic.
// docs/depth.md.

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
  double max_depth = 10;   ///< m
};

struct DepthEffort {
  /// Searched, at most the settings'; in steps of 32. Time is proportional. With less, what is nearer than
  /// f b / disparities gets no or wrong depths.
  int disparities = 32 * kMaxDisparityVectors;
};

struct DepthCounters {
  std::uint64_t images = 0;          ///< given out
  std::uint64_t refused = 0;         ///< steps with kInvalidInput
  std::uint64_t pixels = 0;          ///< of the images given out
  std::uint64_t measured = 0;        ///< of these, with a depth
  std::uint64_t out_of_range = 0;    ///< measured, but nearer or farther than asked for
  std::uint64_t label_images = 0;    ///< warped
  std::uint64_t labels_refused = 0;  ///< of another size
};

class DepthStage {
 public:
  explicit DepthStage(const Rig& rig, const DepthSettings& settings = {});

  /// Not ok where the rig cannot be rectified: every step is refused then.
  [[nodiscard]] const Status& status() const { return rectification_.status(); }
  [[nodiscard]] const StereoRectification& rectification() const { return rectification_; }
  /// For the output of steps.
  [[nodiscard]] DepthBuffer makeBuffer() const;

  /// `left`, `right`: raw images of cameras 0 and 1. The output's labels are taken away.
  Status step(const ImageView& left, const ImageView& right, Stamp stamp, const DepthEffort& effort,
              DepthBuffer& out);

  /// Labels in camera 0's raw geometry into the output of a step.
  Status addLabels(const ImageView& labels, DepthBuffer& out);

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
  std::vector<std::uint32_t> uncovered_;  ///< rectified pixels of camera 0 without a raw one
  DepthCounters counters_;
};

}  // namespace swiftlet
