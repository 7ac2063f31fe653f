#include "estimator/odometry/health_monitor.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/messages/state_sigmas.hpp"
#include "estimator/odometry/scale_check.hpp"

namespace swiftlet {
namespace {

// The position error of coasting grows with the cube of time: metres after 3 s.
constexpr double kCoastLimit = 3.0;  // s
// After a start and after a doubt: ten images at 20 Hz.
constexpr double kSettlingTime = 0.45;  // s
constexpr double kStampSlack = 1e-3;    // s: sums of frame intervals are exact to rounding
// After a disagreement in an epoch that was good, whose figures can briefly fall below the limits.
constexpr double kReconciledTime = 2.0;  // s
// The settling time doubles with each loss, until the estimate has been good for kForgivenTime.
constexpr int kMostLosses = 4;
constexpr double kForgivenTime = 10.0;  // s of good
// Figures of single frames scatter, so they are low-pass filtered.
constexpr double kAverageTime = 0.5;  // s
// 3 sigma: 0.6 m/s and 6 degrees. Healthy flights stay below a third of it.
constexpr double kVelocitySigma = 0.2;  // m/s
constexpr double kTiltSigma = 0.035;    // rad
// Smallest share of inliers among the observations of known landmarks; good flights have 87 % or more, even
// with a person in view.
constexpr double kFitShare = 0.75;
// IMU residuals of the motion, in sigmas of the noise in use, times the factor by which the pixel noise was
// increased. They are 0.1 to 0.3 if the noise model holds, and up to 1.2 with real sensors.
constexpr double kImuResidual = 2.0;
// Largest factor on the IMU's noise as found in flight; it is 5 to 10 if the gyro's true noise is 10 times
// the configured one.
constexpr double kImuFactor = 20.0;
// Far outside the limits, the estimate is useless.
constexpr double kUselessVelocitySigma = 1.0;  // m/s
constexpr double kUselessImuResidual = 5.0;
constexpr double kUselessShare = 0.3;
constexpr double kLostTime = 2.0;  // s, until the state is discarded
// One camera: a contradicted start is discarded sooner than a scale that was good before.
constexpr double kWrongStartTime = 1.0;  // s
constexpr double kWrongScaleTime = 3.0;  // s

double lowPass(double before, double now, double seconds) {
  return before + (1 - std::exp(-seconds / kAverageTime)) * (now - before);
}

bool isDisagreement(Doubt doubt) {
  return doubt == Doubt::kTracksDisagree || doubt == Doubt::kImuDisagrees || doubt == Doubt::kScaleDisagrees;
}

bool scaleOffBy(double bound, double sigmas, const FrameStatistics& statistics) {
  return std::abs(statistics.scale - 1) > bound + sigmas * statistics.scale_sigma;
}

}  // namespace

void HealthMonitor::reset() {
  health_ = Health::kInitializing;
  doubt_ = Doubt::kSettling;
  has_image_ = false;
  last_.reset();
  settled_ = 0;
  share_ = 1;
  imu_square_ = 0;
  acceleration_ = 0;
  beyond_use_ = 0;
  contradicted_ = 0;
  was_good_ = false;
  disagreed_ = false;
  good_ = 0;
  lost_ = false;
}

void HealthMonitor::average(const Evidence& evidence, double seconds) {
  const FrameStatistics& s = evidence.statistics;
  const int fit = s.inliers_mono + s.inliers_stereo;
  if (s.known >= kMinSightings)
    share_ = lowPass(share_, std::min(1.0, fit / static_cast<double>(s.known)), seconds);
  // A larger pixel noise lowers the weight of the tracks and with it the IMU's residuals; the factor corrects
  // for this.
  const double disagreement = s.imu_residual * s.noise.pixel_sigma / pixel_sigma_;
  imu_square_ = lowPass(imu_square_, disagreement * disagreement, seconds);
  if (seconds > 0) {
    acceleration_ =
        lowPass(acceleration_, (evidence.state.v_world_body - last_velocity_).norm() / seconds, seconds);
  }
}

Doubt HealthMonitor::inputDoubt(const Evidence& evidence) const {
  bool all_cameras = true;
  for (std::size_t c = 0; c < cameras_; ++c) all_cameras = all_cameras && evidence.frame.camera_present[c];
  if (!all_cameras) return Doubt::kCameraMissing;
  if (evidence.statistics.inliers_mono + evidence.statistics.inliers_stereo < kNominalSightings) {
    return Doubt::kFewSightings;
  }
  return Doubt::kNone;
}

Doubt HealthMonitor::scaleDoubt(const Evidence& evidence) const {
  if (cameras_ != 1) return Doubt::kNone;
  if (scaleOffBy(ScaleCheck::kAgrees, ScaleCheck::kAgreesSigmas, evidence.statistics))
    return Doubt::kScaleDisagrees;
  return evidence.scale_known ? Doubt::kNone : Doubt::kScaleUnknown;
}

Doubt HealthMonitor::accuracyDoubt(const Evidence& evidence) const {
  const NavState& state = evidence.state;
  if (state.v_world_body.norm() > max_speed_ || acceleration_ > max_acceleration_) return Doubt::kImplausible;
  if (share_ < kFitShare) return Doubt::kTracksDisagree;
  if (imu_square_ > kImuResidual * kImuResidual) return Doubt::kImuDisagrees;
  const ImuFactors& factors = evidence.statistics.noise.imu;
  if (std::max(factors.gyro, factors.accel) > kImuFactor) return Doubt::kImuDisagrees;
  if (velocitySigma(state) > kVelocitySigma || tiltSigma(state) > kTiltSigma) return Doubt::kUncertain;
  return scaleDoubt(evidence);
}

// Only with one camera: with two, a new start from the same data would have the same result.
bool HealthMonitor::contradicted(const FrameStatistics& statistics) const {
  if (cameras_ != 1) return false;
  if (scaleOffBy(ScaleCheck::kContradicts, ScaleCheck::kContradictsSigmas, statistics)) return true;
  return !was_good_ && (imu_square_ > kImuResidual * kImuResidual || share_ < kFitShare);
}

bool HealthMonitor::beyondUse(const NavState& state) const {
  return state.v_world_body.norm() > max_speed_ || velocitySigma(state) > kUselessVelocitySigma ||
         imu_square_ > kUselessImuResidual * kUselessImuResidual || share_ < kUselessShare;
}

double HealthMonitor::settlingTime() const {
  const double time = kSettlingTime * static_cast<double>(1 << losses_);
  return disagreed_ ? std::max(time, kReconciledTime) : time;
}

Health HealthMonitor::update(const Evidence& evidence) {
  const TrackedFrame& frame = evidence.frame;
  const FrameStatistics& statistics = evidence.statistics;
  const double seconds = last_ ? (frame.stamp - *last_).seconds() : 0;
  if (last_) interval_.add(frame.stamp - *last_);
  const double without_image = secondsWithoutImage(frame.stamp);
  const bool accepted =
      evidence.first_of_epoch || statistics.inliers_mono + statistics.inliers_stereo >= kMinSightings;
  if (!evidence.first_of_epoch) average(evidence, seconds);
  last_ = frame.stamp;
  last_velocity_ = evidence.state.v_world_body;
  if (accepted) {
    // Time without images does not count as settling.
    if (without_image <= goodAge()) settled_ += seconds;
    last_accepted_ = frame.stamp;
    has_image_ = true;
  }
  const Doubt accuracy = accuracyDoubt(evidence);
  if (accuracy != Doubt::kNone || evidence.imu_missing || without_image > goodAge()) settled_ = 0;
  // While coasting, image figures are not evaluated, but the speed limit of the vehicle is.
  if (accepted || evidence.state.v_world_body.norm() > max_speed_) {
    beyond_use_ = beyondUse(evidence.state) ? beyond_use_ + seconds : 0;
  }
  if (accepted) {
    contradicted_ = contradicted(evidence.statistics) ? contradicted_ + seconds : 0;
  }
  disagreed_ = disagreed_ || (was_good_ && isDisagreement(accuracy));
  const bool lost_before = lost_;
  lost_ = beyond_use_ > kLostTime || contradicted_ > (was_good_ ? kWrongScaleTime : kWrongStartTime);
  if (lost_ && !lost_before) losses_ = std::min(losses_ + 1, kMostLosses);
  const Doubt input = inputDoubt(evidence);
  doubt_ = without_image > goodAge() && !accepted    ? Doubt::kNoImage
           : accuracy != Doubt::kNone                ? accuracy
           : settled_ < settlingTime() - kStampSlack ? Doubt::kSettling
                                                     : input;
  if (doubt_ == Doubt::kNone) {
    health_ = Health::kGood;
    was_good_ = true;
    disagreed_ = false;
    good_ += seconds;
    if (good_ > kForgivenTime) losses_ = 0;
  } else if (health_ != Health::kInitializing) {
    health_ = beyond_use_ > 0 ? Health::kFailed : Health::kDegraded;
  } else if (doubt_ == Doubt::kCameraMissing || doubt_ == Doubt::kFewSightings) {
    health_ = Health::kDegraded;  // accurate, with less than nominal input
  }
  health_ = at(frame.stamp);
  return health_;
}

double HealthMonitor::secondsWithoutImage(Stamp stamp) const {
  return has_image_ ? (stamp - last_accepted_).seconds() : 0.0;
}

Health HealthMonitor::at(Stamp stamp) const {
  return has_image_ ? aged(health_, last_accepted_, goodAge(), stamp) : health_;
}

Health HealthMonitor::aged(Health health, Stamp last_accepted, double good_age, Stamp stamp) {
  const double age = (stamp - last_accepted).seconds();
  if (age > kCoastLimit) return Health::kFailed;
  if (age > good_age && health == Health::kGood) return Health::kDegraded;
  return health;
}

}  // namespace swiftlet
