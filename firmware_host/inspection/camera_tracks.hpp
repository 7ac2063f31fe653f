#pragma once
// Follows corners through the images of one camera without knowledge of motion, lens or clock: the
// measurements for the checks of inspection.hpp.
//
// Memory: two pyramids, and 12 bytes per point (some 1.5 KB per image). Cost: about 1.5 ms for 752 x 480.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/frontend/corners.hpp"
#include "estimator/frontend/pyramid.hpp"

namespace swiftlet {

struct TrackedPoint {
  std::uint32_t track = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

struct TrackedImage {
  Stamp stamp;
  bool follows = false;              ///< tracks continue from the previous image
  std::vector<TrackedPoint> points;  ///< ordered by track
  std::size_t kept = 0;              ///< points whose track is also in the previous image
  float flow = 0;                    ///< px, median displacement of these
  float light = 1;                   ///< median ratio of their brightness to that in the previous image
};

class CameraTracks {
 public:
  /// `follows`: the image directly follows the previous one; otherwise all tracks end.
  void add(Stamp stamp, const ImageView& image, bool follows);
  [[nodiscard]] const std::vector<TrackedImage>& images() const { return images_; }
  /// Pyramid of the newest image.
  [[nodiscard]] const Pyramid& newest() const { return pyramid_[newest_]; }

 private:
  void follow(TrackedImage& image);
  void fill(TrackedImage& image);

  std::vector<TrackedImage> images_;
  std::vector<Pyramid> pyramid_;
  std::vector<CornerDetector> detector_;
  std::size_t newest_ = 0;
  std::uint32_t next_track_ = 0;
  Eigen::Vector2f drift_ = Eigen::Vector2f::Zero();  ///< px, median of the step before: the next one's guess
};

struct TrackPair {
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
};
/// Tracks that are in both images.
std::vector<TrackPair> commonTracks(const TrackedImage& from, const TrackedImage& to);

}  // namespace swiftlet
