#pragma once
// Sets of images with poses that revisit places, for the figures of loop verification: real ones of the data
// folder, and flights that `swiftlet simulate` wrote.

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "mapping/place/place_keyframe.hpp"

namespace swiftlet::loop_sets {

struct Shot {
  std::array<cv::Mat, 2> grey;  ///< camera 1's is empty where there is none
  cv::Mat depth;                ///< float, m along z, 0 unknown; empty where there is none
  SE3 T_world_body;
  double seconds = 0;
};

enum class PairKind { kRevisit, kApart, kUnclear };

struct ImageSet {
  std::string name;
  Rig rig;
  /// Pinhole of the depth images, and where they stand on the body.
  Eigen::Vector4d depth_camera = Eigen::Vector4d::Zero();
  SE3 T_body_depth;
  bool has_truth = true;
  double exclude_seconds = 10;  ///< nearer in time is no revisit
  std::vector<Shot> shots;
  /// Of the pair (i, j), i < j.
  std::vector<std::vector<PairKind>> kind;
};

/// Folder of the data: SWIFTLET_DATA, else ../shared/data beside the source tree.
std::string dataFolder();

/// Nothing where the files are not there.
std::optional<ImageSet> readKimera(const std::string& data);
std::optional<ImageSet> readKitchen(const std::string& data);
std::optional<ImageSet> readDbowDemo(const std::string& data);
/// An EuRoC folder with truth, every n-th image of it. Revisits: both see at least 40 % of the other's
/// surface and are at least `min_seconds` apart; pairs less apart in time are unclear. The surface is that of
/// depth0 where every image taken has one, else of truth/mesh.ply; without either (real flights) that of
/// stereo depths at corners, where nothing tells what hides behind another thing.
std::optional<ImageSet> readFlight(const std::string& folder, double min_seconds, int every);

/// Features of OpenCV's ORB, for comparison.
void extractOrb(const ImageSet& set, std::size_t shot, int features, PlaceKeyframe& keyframe);

/// Inverse depths from the depth image, where there is one.
void fillFromDepthImage(const ImageSet& set, std::size_t shot, PlaceKeyframe& keyframe);

/// The true inverse distance that camera 0 sees at a pixel; 0 unknown.
double trueInverseDistance(const ImageSet& set, std::size_t shot, const Eigen::Vector2d& pixel);

}  // namespace swiftlet::loop_sets
