#pragma once
// Selects images of a board for calibration: pairs two cameras' views of one moment, and chooses the most
// informative moments.

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
  /// s, median over the images of camera 0 with an image of camera 1 less than half the image period away;
  /// 0: none.
  double stamp_difference = 0;
};

/// Views of both cameras whose stamps differ by less than a millisecond form one moment; views with few
/// corners are omitted. `views` must outlive the result.
[[nodiscard]] Moments pairViews(const std::vector<BoardView>& views, std::size_t camera_count);

/// At most `count` moments that differ most in the board's position and orientation in the images: each next
/// one is the farthest from those chosen.
[[nodiscard]] std::vector<const Moment*> spreadMoments(const std::vector<const Moment*>& moments,
                                                       const std::array<CameraModel, kMaxCameras>& sizes,
                                                       std::size_t count);

/// Adds those views of `candidates`, posed in the frame of the bundle, that increase the determinant of the
/// globals' information most, one after the other, until there are `count`. Views whose corners are more than
/// `most_rms` px from the bundle's prediction are omitted. Source: Sebastiani, Wynn, "Maximum Entropy
/// Sampling and Optimal Bayesian Experimental Design", 2000.
void chooseInformative(const CalibrationTarget& target, const std::vector<Moment>& candidates,
                       double most_rms, std::size_t count, CameraBundle& bundle);

}  // namespace swiftlet
