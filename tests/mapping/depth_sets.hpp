#pragma once
// Stereo pairs with true disparity: real ones of the data folder's stereo_gt, and rendered flights, rectified
// here, with their depth images as the truth. And how far disparities are from it.

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "mapping/depth/disparity_image.hpp"

namespace swiftlet::depth_sets {

/// Largest true disparity that counts [px]: that of a search of 64.
inline constexpr float kLargestDisparity = 63;

struct StereoSet {
  std::string name;
  cv::Mat left;
  cv::Mat right;
  cv::Mat truth;  ///< CV_32F, px; 0: unknown
};

/// All but aloe, whose disparities are greater. Empty when the folder is not there.
std::vector<StereoSet> realSets();

/// `count` pairs, evenly spread over a log with depth images. Empty when it is not there.
std::vector<StereoSet> renderedSets(const std::string& log, std::size_t count);

/// Shares of the pixels with a true disparity of at most kLargestDisparity.
struct DisparityScore {
  double pixels = 0;
  double wrong_or_missing = 0;  ///< more than 2 px off, or none
  double given = 0;
  double wrong = 0;          ///< of those given, more than 2 px off
  double mean_error = 0;     ///< of those that are not, |error| [px]
  double bias = 0;           ///< of those that are not, error [px]
  double within_sigma[3]{};  ///< of those that are not, |error| at most 1, 2, 3 sigma
};

/// `disparity`: CV_32F, negative where there is none. `sigma`: likewise, or empty. Columns left of
/// `first_column` do not count.
DisparityScore score(const cv::Mat& disparity, const cv::Mat& sigma, const cv::Mat& truth,
                     int first_column = 0);

cv::Mat disparityOf(const DisparityImage& image);
cv::Mat sigmaOf(const DisparityImage& image);

/// Truth, disparity and error side by side, to look at.
cv::Mat drawDisparity(const cv::Mat& disparity, const StereoSet& set);

}  // namespace swiftlet::depth_sets
