#pragma once
// Controls exposure and gain of a rig's next images, from the newest image, for odometry.
//
// - Metering, on every 8th row: the mean grey value is controlled to kTargetMean, unless more than
//   kSaturatedShare of the pixels would be nearly white; then these decide.
// - Motion blur: the exposure is limited to kBlur / (focal turn_rate); more light comes from the gain. If the
//   gain is at its limit too, the exposure may grow up to kDarkBlur.
// - A request takes effect kActingDelay images later. An image is metered with the settings that it was taken
//   with, and pending requests are taken into account, so the control does not wind up.
// - Exposures are multiples of the camera's step; the gain compensates for the remainder.
// - Changes: none within kDeadband, at most 10 % per image near the target, up to 40 % far from it.
//
// Units: gain is relative to the sensor's least gain; light is exposure times gain [s].
// Threads: one. Memory: the object's own, no allocation. Cost: some 10 us at 752 x 480, of meterImage().
// Sources: trade-off of blur and noise, and prediction by light: M.-A. Begin, I. Hunter, "Auto-Exposure
// Algorithm for Enhanced Mobile Robot Localization in Challenging Light Conditions", Sensors 22 (2022) 835.
// Mean as target: Roboception's rc_visard, 0.25 to 0.75 of white. Alternative by gradients: Z. Zhang, C.
// Forster, D. Scaramuzza, "Active Exposure Control for Robust Visual Odometry in HDR Environments", ICRA
// 2017; it needs the camera's response function, which drivers do not provide.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ExposureSetting {
  Duration exposure;
  double gain = 1;  ///< times the least
  [[nodiscard]] constexpr bool operator==(const ExposureSetting&) const = default;
};

struct ExposureRange {
  Duration shortest;
  Duration longest;
  double most_gain = 1;  ///< relative to the least gain; 1: the gain cannot be set
  double step = 0;       ///< s, exposures are multiples of it; 0: any exposure
};

/// Factor on the light for a correct image: 2 is twice the light, 1 is correct. Limited to 0.1 to 10.
[[nodiscard]] double meterImage(const ImageView& image);

class ExposureControl {
 public:
  static constexpr double kTargetMean = 102;       ///< grey, 0.4 of white
  static constexpr double kSaturatedShare = 0.05;  ///< of pixels: lamps and windows
  static constexpr double kBlur = 1.5;             ///< px; tracking hardly degrades below 2
  static constexpr double kDarkBlur = 4;           ///< px; a blurred image is better than a black one
  /// rad/s, assumed at least, also for vehicles that do not turn: 1 m/s at 3 m moves pixels as fast.
  static constexpr double kLeastTurnRate = 0.3;
  static constexpr double kDeadband = 0.1;  ///< of the light
  /// When a request is sent, the next image is already being exposed.
  static constexpr std::uint64_t kActingDelay = 2;

  ExposureControl() = default;
  /// `focal`: focal length of the camera [px]. `period`: of its images. `start`: the present settings.
  ExposureControl(const ExposureRange& range, double focal, Duration period, const ExposureSetting& start);

  /// The settings to request after image `frame` (numbers ascend, gaps are allowed), with the factor
  /// `missing` of meterImage() and the vehicle's turn rate [rad/s].
  ExposureSetting update(std::uint64_t frame, double missing, double turn_rate);
  /// Instead of update(), if the control of another camera decided.
  void follow(std::uint64_t frame, const ExposureSetting& asked);

  /// The settings that image `frame` was taken with, among the last kRemembered requests.
  [[nodiscard]] ExposureSetting inForce(std::uint64_t frame) const;
  [[nodiscard]] const ExposureSetting& asked() const { return newest().setting; }

 private:
  static constexpr std::size_t kRemembered = 8;
  struct Request {
    std::uint64_t frame = 0;  ///< the first image taken with it
    ExposureSetting setting;
  };

  [[nodiscard]] const Request& newest() const { return requests_[count_ % kRemembered]; }
  [[nodiscard]] ExposureSetting split(double light) const;
  void moveBound(double turn_rate);
  void remember(std::uint64_t frame, const ExposureSetting& setting);

  ExposureRange range_;
  double focal_ = 1;
  double turn_decay_ = 0;  ///< per image
  double turn_rate_ = kLeastTurnRate;
  double bound_ = 0;  ///< s, exposure at kBlur
  double light_ = 0;  ///< s, wanted light; the requested light is smaller by a part of a step
  std::size_t count_ = 0;
  std::array<Request, kRemembered> requests_{};
};

}  // namespace swiftlet
