#pragma once
// Any lens of a calibration file as one of the estimator's two (estimator/camera/camera_model.hpp): the same
// lens where one model contains the other, else the closest one.
//
// Method: rays are followed from the optical axis to the image's border in directions all around. A direction
// ends early where the source model folds back or has no value, so that the rays cover the image as far as
// the source can be inverted. Both target models are fitted to the rays' pixels by least squares, each pixel
// of the image with equal weight (Levenberg-Marquardt; More, "The Levenberg-Marquardt algorithm:
// implementation and theory", 1978). A fit counts only where the target can be inverted at every ray; the one
// with the smaller RMS is taken.
//
// The RMS decides whether a fit is refused, not the maximum. The maximum lies in the outermost corners:
// boards hardly reach them, so the source is a guess there itself (two good calibrations of EuRoC's cameras
// differ by 0.4 to 0.6 px in the median and by 40 px in the corners), and few features are there. The maximum
// is shown.
//
// Errors: InputError. Host side only: allocates, takes some tens of ms a lens.

#include <string>

#include "drivers/calibration/source_lens.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// A feature is tracked to 0.5 to 1 px; a lens that is off by less than half of it hardly shows in a flight.
inline constexpr double kMaxLensRms = 0.3;  // px over the covered region

struct LensFit {
  CameraModel model;
  bool exact = false;  ///< the target model contains the source: no residual but rounding
  double rms = 0;      ///< [px] over the covered region
  double max = 0;      ///< [px] over the covered region
  double covered = 1;  ///< share of the image in which the source can be inverted
  /// "ds as equidistant: 0.012 px RMS, 0.04 px at most"; empty if exact.
  std::string words;
};

/// The closest lens of the estimator's, however far it is. `place`: the lens in its file. InputError when the
/// source has no inverse in most of the image.
[[nodiscard]] LensFit fitLens(const SourceLens& source, const InputPlace& place);

/// The same, refused above kMaxLensRms; warns where the source covers a part of the image alone.
[[nodiscard]] LensFit convertLens(const SourceLens& source, const InputPlace& place, Warnings& warnings);

}  // namespace swiftlet
