#pragma once
// Exposure and gain for odometry: what the next images of a rig are to be taken with, from the newest one.
//
// - Metering, on every 8th row: the mean grey goes to kTargetMean, unless more than kSaturatedShare of the
//   pixels would come near white; then those decide.
// - Motion blur: the exposure is at most kBlur / (focal turn_rate), so that more light comes from the gain.
//   Only where the gain is at its end too the exposure grows, up to kDarkBlur.
// - A request acts kActingDelay images later. An image is judged by the setting that it was taken with, and
//   what was asked for since counts: nothing winds up while requests are on their way.
// - Exposures are asked for in the camera's own steps, and the gain makes up for the rest.
// - Steps: none within kDeadband, at most 10 % an image near the target, up to 40 % far from it.
//
// Units: gain in times of the sensor's least gain; light is exposure times gain [s].
// Threads: one. Memory: the object's own, no allocation. Cost: some 10 us at 752 x 480, of meterImage().
// Sources: blur weighed against noise, and prediction by the light that a setting gives: M.-A. Begin, I.
// Hunter, "Auto-Exposure Algorithm for Enhanced Mobile Robot Localization in Challenging Light Conditions",
// Sensors 22 (2022) 835. The mean as the target: Roboception's rc_visard, 0.25 to 0.75 of white. Gradients in
// place of it: Z. Zhang, C. Forster, D. Scaramuzza, "Active Exposure Control for Robust Visual Odometry in
// HDR Environments", ICRA 2017; that needs the camera's response, which a driver does not tell.

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
  double most_gain = 1;  ///< times the least; 1: the gain cannot be set
  double step = 0;       ///< s, of which exposures are multiples; 0: any
};

/// By how much brighter the image ought to be: 2 is twice the light, 1 is right. Within 0.1 and 10.
[[nodiscard]] double meterImage(const ImageView& image);

class ExposureControl {
 public:
  static constexpr double kTargetMean = 102;       ///< grey, 0.4 of white
  static constexpr double kSaturatedShare = 0.05;  ///< of pixels: lamps and windows
  static constexpr double kBlur = 1.5;             ///< px; tracking loses little below 2
  static constexpr double kDarkBlur = 4;           ///< px; blurred is better than black
  /// rad/s, of a vehicle that does not turn: 1 m/s at 3 m moves pixels as fast.
  static constexpr double kLeastTurnRate = 0.3;
  static constexpr double kDeadband = 0.1;  ///< of the light
  /// An image that came when a request went out is followed by one that is being exposed already.
  static constexpr std::uint64_t kActingDelay = 2;

  ExposureControl() = default;
  /// `focal` [px] of the camera, `period` of its images; `start`: what is in force.
  ExposureControl(const ExposureRange& range, double focal, Duration period, const ExposureSetting& start);

  /// After image `frame` (numbers rise, holes may be) with `missing` light, of meterImage(), and the
  /// vehicle's turn rate [rad/s]: what to ask for.
  ExposureSetting update(std::uint64_t frame, double missing, double turn_rate);
  /// In place of update(): another camera's control decided.
  void follow(std::uint64_t frame, const ExposureSetting& asked);

  /// What image `frame` was taken with, of the last kRemembered requests.
  [[nodiscard]] ExposureSetting inForce(std::uint64_t frame) const;
  [[nodiscard]] const ExposureSetting& asked() const { return newest().setting; }

 private:
  static constexpr std::size_t kRemembered = 8;
  struct Request {
    std::uint64_t frame = 0;  ///< the first that is taken with it
    ExposureSetting setting;
  };

  [[nodiscard]] const Request& newest() const { return requests_[count_ % kRemembered]; }
  [[nodiscard]] ExposureSetting split(double light) const;
  void moveBound(double turn_rate);
  void remember(std::uint64_t frame, const ExposureSetting& setting);

  ExposureRange range_;
  double focal_ = 1;
  double turn_decay_ = 0;  ///< an image
  double turn_rate_ = kLeastTurnRate;
  double bound_ = 0;  ///< s, exposure at kBlur
  double light_ = 0;  ///< s, that is wanted; what was asked for is less by a part of a step
  std::size_t count_ = 0;
  std::array<Request, kRemembered> requests_{};
};

}  // namespace swiftlet
