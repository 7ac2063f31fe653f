#pragma once
// Real images of revisited places with what is known of them, for statistics of place recognition: the
// folder loop_closure of the data. Host side, OpenCV's types.

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/place/place_extractor.hpp"

namespace swiftlet::testing {

/// Folder of the data: SWIFTLET_DATA, else ../shared/data beside the source tree.
std::string placeDataFolder();
cv::Mat readGrey(const std::string& path);
ImageView viewOf(const cv::Mat& grey);
/// A camera without distortion for images whose calibration is not known.
CameraModel plainCamera(int width, int height);

struct PairTruth {
  std::size_t i = 0, j = 0;
  double overlap = 0;  ///< the lesser of both directions
  double overlap_max = 0;
};

/// 50 frames of a room, 20 frames apart, with depth and poses.
struct Kitchen {
  std::vector<cv::Mat> grey;
  std::vector<cv::Mat> depth;  ///< metres along z in the colour camera's pixels, 0: unknown
  std::vector<SE3> T_world_cam;
  std::vector<PairTruth> pairs;

  /// Where a pixel of image i lies in image j; false where its depth is not known or it is out of sight.
  [[nodiscard]] bool transfer(std::size_t i, const Eigen::Vector2d& pixel, std::size_t j,
                              Eigen::Vector2d& to) const;
};
/// Empty where the data are not there.
Kitchen readKitchen();

/// Whether two frames are a revisit: far apart in time, with a common view.
bool isRevisit(const PairTruth& pair);
bool isNegative(const PairTruth& pair);

struct Corridor {
  std::vector<cv::Mat> query, reference;
  std::vector<std::vector<std::size_t>> truth;  ///< references that match each query
};
Corridor readCorridor();

struct MutualMatch {
  std::size_t first, second;
  int distance;
};
/// Each other's nearest, by all distances.
std::vector<MutualMatch> mutualMatches(const std::vector<Descriptor>& a, const std::vector<Descriptor>& b);

struct Described {
  std::vector<Eigen::Vector2d> pixel;
  std::vector<int> octave;
  std::vector<Descriptor> descriptor;
};
Described describeOurs(PlaceExtractor& extractor, const CameraModel& camera, const cv::Mat& grey,
                       PlaceKeyframe& keyframe);
Described describeOpenCv(const cv::Mat& grey, int features);
/// OpenCV's corners with our descriptors: what the pattern is worth.
Described describeAtOpenCvs(const cv::Mat& grey, int features);

}  // namespace swiftlet::testing
