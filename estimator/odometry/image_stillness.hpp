#pragma once
// Classifies image motion for rest detection, independently of the frame rate.
//
// Tracks are compared with a reference frame instead of the previous frame, so slow drift accumulates until
// it exceeds tracking noise. With d the displacement since the reference in radians, noise included, and t
// the elapsed time:
//  moving     displacement of 3 mrad or more, at least 0.5 px; the current frame becomes the reference
//  still      d / t below 0.4 mrad/s for 0.25 s: 2 cm/s at a distance of 50 m
//  in place   shaking without moving: after 1 s, d low-passed over 0.5 s drifts by less than 0.4 mrad/s
//  slow       d / t below 5 mrad/s: 1.5 cm/s at 3 m
//  uncertain  d / t above that: more time is needed
//  unknown    too few tracks
// The displacement is the second largest of the medians of the four image quadrants. Forward motion moves all
// four; a passing person moves one.
// Memory: 40 kB. Cost: about 10 us per frame.

#include <array>

#include "estimator/camera/rig.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/imu/rest_detector.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

class ImageStillness {
 public:
  explicit ImageStillness(const Rig& rig) : rig_(rig) {}

  ImageMotion update(const TrackedFrame& frame);

 private:
  struct Motions {
    FixedVector<float, kMaxFeatures> x;
    FixedVector<float, kMaxFeatures> y;
  };

  void takeReference(const TrackedFrame& frame);
  struct Moved {
    double now = -1;    ///< px since the reference; negative: unknown
    double drift = -1;  ///< px, low-passed, since a second after the reference; negative: unknown
  };
  /// Displacement in camera `c`.
  Moved moved(const TrackedFrame& frame, std::size_t c);

  Rig rig_;
  Stamp since_;
  FixedVector<TrackedFeature, kMaxFeatures> reference_;  // by ascending id
  Stamp last_;
  Stamp last_not_still_;
  std::array<Motions, 4> quadrants_;
  std::array<Eigen::Vector2d, 4> means_;    ///< px since the reference, low-passed
  std::array<Eigen::Vector2d, 4> settled_;  ///< means_ at kSettled
};

}  // namespace swiftlet
