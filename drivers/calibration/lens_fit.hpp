#pragma once
// Converts any lens of a calibration file to one of the estimator's two models
// (estimator/camera/camera_model.hpp): exactly if one model contains the lens, else to the closest lens.
//
// Method: rays are followed from the optical axis to the image's border in all directions. A direction ends
// early where the source model folds back or has no value, so the rays cover the part of the image where the
// source can be inverted. Both target models are fitted to the rays' pixels by least squares, with equal
// weight for each pixel of the image (Levenberg-Marquardt; More, "The Levenberg-Marquardt algorithm:
// implementation and theory", 1978). A fit is valid only if the target can be inverted at every ray; the one
// with the smaller RMS is used.
//
// The RMS, not the maximum, decides whether a fit is refused. The maximum lies in the outermost corners:
// calibration boards hardly reach them, so the source itself is uncertain there (two good calibrations of
// EuRoC's cameras differ by 0.4 to 0.6 px in the median and by 40 px in the corners), and few features are
// there. The maximum is reported.
//
// Errors: InputError. Host side only: allocates, takes some tens of ms per lens.

#include <string>

#include "drivers/calibration/source_lens.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// Features are tracked to 0.5 to 1 px; a lens error below half of that has hardly any effect in flight.
inline constexpr double kMaxLensRms = 0.3;  // px over the covered region

struct LensFit {
  CameraModel model;
  bool exact = false;  ///< the target model contains the source: only rounding errors
  double rms = 0;      ///< [px] over the covered region
  double max = 0;      ///< [px] over the covered region
  double covered = 1;  ///< share of the image in which the source can be inverted
  /// "ds as equidistant: 0.012 px RMS, 0.04 px at most"; empty if exact.
  std::string words;
};

/// The closest lens of the estimator's models, whatever its error. `place`: the lens in its file. InputError
/// if the source has no inverse in most of the image.
[[nodiscard]] LensFit fitLens(const SourceLens& source, const InputPlace& place);

/// Like fitLens(), but refuses an RMS above kMaxLensRms and warns if the source covers only a part of the
/// image.
[[nodiscard]] LensFit convertLens(const SourceLens& source, const InputPlace& place, Warnings& warnings);

}  // namespace swiftlet
