#pragma once
// Which images of a board a calibration uses: two cameras' views of one moment, and of all moments those that
// tell most.

#include <array>
#include <cstddef>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_bundle.hpp"

namespace swiftlet {

struct Moment {
  Stamp stamp;
  std::array<const BoardView*, kMaxCameras> seen{};  ///< null: this camera does not see the board
};

struct Moments {
  std::vector<Moment> all;  ///< by stamp
  /// s, median over the images of camera 0 with an image of camera 1 in the same frame interval; 0: one
  /// camera.
  double stamp_difference = 0;
};

/// Views of both cameras whose stamps differ by less than a millisecond are one moment; views with few
/// corners are left out. `views` must outlive the result.
[[nodiscard]] Moments pairViews(const std::vector<BoardView>& views, std::size_t camera_count);

/// At most `count` that differ most in where and how the board lies in the images: each next one is the
/// farthest from those taken.
[[nodiscard]] std::vector<const Moment*> spreadMoments(const std::vector<const Moment*>& moments,
                                                       const std::array<CameraModel, kMaxCameras>& sizes,
                                                       std::size_t count);

/// Adds the views of `candidates`, posed in the frame of the bundle, that raise the determinant of the
/// globals' information most, one after the other, until there are `count`. Views whose corners are far from
/// where the bundle's lenses see them (`most_rms` px) are left out. Source: Sebastiani, Wynn, "Maximum
/// Entropy Sampling and Optimal Bayesian Experimental Design", 2000.
void chooseInformative(const CalibrationTarget& target, const std::vector<Moment>& candidates,
                       double most_rms, std::size_t count, CameraBundle& bundle);

}  // namespace swiftlet
