#include "firmware_host/inspection/motion_findings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "drivers/recorded/imu_file.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/inspection/camera_turns.hpp"
#include "firmware_host/inspection/focal_fit.hpp"
#include "firmware_host/inspection/force_fit.hpp"
#include "firmware_host/inspection/motion_fit.hpp"
#include "firmware_host/inspection/signed_axes.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
// Log likelihood that decides: by chance e^-20, for the thousand shifts and 48 axes that are tried.
constexpr double kDecides = 20;
// In addition, the variance left with the calibration must be larger by this factor: errors of consecutive
// turns are correlated and do not average out.
constexpr double kClearlyWorse = 2;
constexpr double kSigmas = 5;
// Least share of the camera's turns that the gyro must explain for any statement about both.
constexpr double kExplained = 0.6;
// Below that share, with turns this large, camera and gyro have not seen the same motion.
constexpr double kUnrelated = 0.25;
constexpr double kLeastTurned = 0.5;  // deg per turn
constexpr std::size_t kManyTurns = 60;
// Smaller deviations are not reported: half the exposure in a dim room, for stamps at the start of the
// exposure instead of its middle; twenty times a calibration's own angular error; a refocused lens.
constexpr double kLeastShift = 0.010;  // s
constexpr double kLeastAngle = 4;      // deg
constexpr double kLeastFocal = 0.05;
// Closer to a signed permutation than the error of a mount.
constexpr double kSameAxes = 15;  // deg
// A gyro's scale error is never this large: a wrong unit or range.
constexpr double kWrongScale = 1.6;
constexpr double kLeastJitter = 0.001;  // s rms
// Gravity from images and accelerometer, for windows that agree on it.
constexpr double kGravity = 9.81;
constexpr double kGravityOff = 0.3;
constexpr std::size_t kFewestWindows = 4;
constexpr double kOtherSign = 0.2;
// Other axes must have errors smaller by this factor if the given ones fit well enough.
constexpr double kClearlyBetter = 1.25;

std::string directions(const Eigen::Matrix3d& R_cam_imu) {
  const auto text = [&](int row) {
    return fmt::format("({:.2f}, {:.2f}, {:.2f})", R_cam_imu(row, 0), R_cam_imu(row, 1), R_cam_imu(row, 2));
  };
  return "its right is " + text(0) + " and it looks along " + text(2);
}

class MotionInspector {
 public:
  MotionInspector(const Calibration& calibration, const std::vector<ImuSample>& samples,
                  const std::vector<TrackedImage>& images, std::vector<Measured>& measured)
      : calibration_(calibration),
        samples_(samples),
        images_(images),
        camera_(calibration.rig.camera[0]),
        R_calibrated_(calibration.rig.T_body_cam[0].R().transpose()),
        origin_(samples.front().stamp),
        measured_(measured),
        gyro_(samples, origin_),
        turns_(cameraTurns(images, camera_, origin_)),
        fitter_(turns_, gyro_) {}

  std::vector<Finding> operator()(const std::vector<Stamp>& even) {
    const bool gravity_expected = addForceLevel();
    const double calibrated_shift = calibration_.rig.camera_to_imu_shift.seconds();
    const std::optional<MotionFit> fit = fitter_.fit(calibrated_shift);
    if (!fit) {
      measured_.push_back(
          {"gyro beside images",
           fmt::format("too little motion to decide ({} rotations of the camera)", turns_.size())});
      return findings_;
    }
    fit_ = *fit;
    measured_.push_back({"gyro beside images",
                         fmt::format("{} rotations of {:.2f} deg rms; the gyro explains {:.1f} % of them",
                                     fit_.turns, fit_.turned_deg, 100 * fit_.explained)});
    if (fit_.explained < kExplained) {
      addUnrelated();
      return findings_;
    }
    addShift(calibrated_shift);
    addScale();
    if (addMirrored()) return findings_;
    const bool focal = addFocal();
    addAxes(focal);
    addJitter(even);
    if (gravity_expected && !focal) addForce();
    return findings_;
  }

 private:
  void addUnrelated() {
    if (fit_.explained > kUnrelated || fit_.turned_deg < kLeastTurned || fit_.turns < kManyTurns) return;
    findings_.push_back(
        {"images and IMU do not belong together",
         fmt::format("the camera rotates by {:.2f} deg rms in {} steps; the gyro explains {:.0f} % of it at "
                     "the best time shift within {:g} s and with the best axes",
                     fit_.turned_deg, fit_.turns, 100 * fit_.explained, kMaxShift),
         "Use images and samples of the same flight, stamped with one clock"});
  }

  /// Whether the size of the accelerometer's readings fits gravity.
  bool addForceLevel() {
    const ForceLevel force = forceLevel(samples_);
    if (force.hasGravity()) return true;
    if (force.inG()) {
      findings_.push_back(
          {"accelerometer in g",
           fmt::format("the median of its readings is {:.3f}, and the sensor is at rest", force.median),
           "Multiply the accelerometer's readings by 9.80665: swiftlet reads m/s^2"});
    } else if (force.median < kGravity) {
      findings_.push_back(
          {"accelerometer without gravity",
           fmt::format("the median of its readings is {:.2f} m/s^2, a tenth is below {:.2f}", force.median,
                       force.low),
           "Provide raw readings, not linear acceleration, from which gravity was subtracted"});
    } else {
      findings_.push_back(
          {"accelerometer of another unit or range",
           fmt::format("the median of its readings is {:.4g} m/s^2", force.median),
           "Provide m/s^2, scaled for the measurement range that the accelerometer is set to"});
    }
    return false;
  }

  [[nodiscard]] bool decides(double gain) const {
    return gain > std::max(kDecides, fit_.gainOf(kClearlyWorse));
  }

  void addShift(double calibrated) {
    const double off = fit_.shift - calibrated;
    measured_.push_back(
        {"time shift",
         fmt::format("estimated from the log {:+.1f} ms (sigma {:.1f} ms), calibration {:+.1f} ms",
                     1e3 * fit_.shift, 1e3 * fit_.shift_sigma, 1e3 * calibrated)});
    if (std::abs(off) < std::max(kLeastShift, kSigmas * fit_.shift_sigma)) return;
    if (!decides(fitter_.gainOverShift(fit_, calibrated))) return;
    findings_.push_back(
        {std::abs(off) < 0.2 ? "image stamps shifted" : "image stamps of another clock",
         fmt::format("the gyro shows the images' rotations {:.4g} ms {} than their stamps (sigma {:.1f} ms); "
                     "the calibration gives {:.4g} ms",
                     1e3 * std::abs(fit_.shift), fit_.shift > 0 ? "later" : "earlier", 1e3 * fit_.shift_sigma,
                     1e3 * calibrated),
         fmt::format("Stamp images and samples with one clock, or set timeshift_cam_imu to {:.4f} s",
                     fit_.shift)});
  }

  void addScale() {
    measured_.push_back(
        {"gyro", fmt::format("{:.4g} times its readings are the camera's rotations", fit_.scale)});
    if (fit_.scale < kWrongScale && fit_.scale > 1 / kWrongScale) return;
    unit_ = fit_.scale;
    const double in_degrees = fit_.scale * kDegrees;
    if (in_degrees < kWrongScale && in_degrees > 1 / kWrongScale) {
      findings_.push_back(
          {"gyro in deg/s",
           fmt::format("the camera rotates by {:.4f} times the gyro's readings; pi / 180 is 0.0175",
                       fit_.scale),
           "Multiply the gyro's readings by pi / 180: swiftlet reads rad/s"});
      unit_ = 1 / kDegrees;
      return;
    }
    findings_.push_back({"gyro of another unit or range",
                         fmt::format("the camera rotates by {:.4g} times the gyro's readings", fit_.scale),
                         "Provide rad/s, scaled for the measurement range that the gyro is set to"});
  }

  bool addMirrored() {
    if (!decides(fit_.mirror_gain)) return false;
    double angle = 0;
    const Eigen::Matrix3d axes = nearestSignedAxes(fit_.mirrored.transpose() * R_calibrated_, angle);
    findings_.push_back(
        {"IMU axes left-handed",
         fmt::format("the gyro's rotations are mirrored relative to the camera's{}",
                     angle * kDegrees < kSameAxes
                         ? fmt::format("; relative to the calibration it gives {}", axesText(axes))
                         : std::string()),
         "Swap or negate axes of gyro and accelerometer so that x, y, z are right-handed as in the sensor's "
         "data sheet"});
    return true;
  }

  void addAxes(bool focal) {
    const Eigen::Vector3d off = logSo3(Eigen::Matrix3d(fit_.R_cam_imu * R_calibrated_.transpose()));
    const double degrees = off.norm() * kDegrees;
    if (focal && degrees < kSameAxes) return;
    const bool both = fit_.information.determinant() > 0;
    const double sigma =
        both ? std::sqrt(off.normalized().dot(fit_.information.inverse() * off.normalized())) * kDegrees
             : 180;
    measured_.push_back(
        {"camera 0 in the IMU's axes",
         fmt::format("estimated from the log: {}; the calibration differs by {:.1f} deg (sigma {:.1f} deg)",
                     directions(fit_.R_cam_imu), degrees, std::min(sigma, 180.0))});
    if (sigma > kLeastAngle || degrees < std::max(kLeastAngle, kSigmas * sigma)) return;
    if (!decides(fitter_.gainOverAxes(fit_, R_calibrated_))) return;
    turned_ = true;
    // The identity is more likely a missing value than a wrong one.
    if (R_calibrated_.isIdentity(1e-6)) {
      findings_.push_back({"camera and IMU with identity extrinsics",
                           fmt::format("the calibrated rotation between them is the identity; according to "
                                       "the gyro, camera 0 is rotated by {:.0f} deg: in the IMU's axes {}",
                                       degrees, directions(fit_.R_cam_imu)),
                           "Calibrate the rig and set T_BS or T_cam_imu"});
      return;
    }
    double angle = 0;
    const Eigen::Matrix3d axes = nearestSignedAxes(fit_.R_cam_imu.transpose() * R_calibrated_, angle);
    if (angle * kDegrees < kSameAxes && !axes.isIdentity(1e-6)) {
      findings_.push_back(
          {"IMU axes exchanged or negated",
           fmt::format("relative to the calibration, the gyro gives {}; camera 0 is rotated by {:.0f} deg "
                       "from its calibrated orientation",
                       axesText(axes), degrees),
           "Provide the IMU's axes as they were when the rig was calibrated, or calibrate again"});
      return;
    }
    findings_.push_back({"camera turned against its calibration",
                         fmt::format("according to the gyro, camera 0 is rotated by {:.1f} deg (sigma {:.1f} "
                                     "deg) from its calibrated orientation: in the IMU's axes {}",
                                     degrees, sigma, directions(fit_.R_cam_imu)),
                         "Calibrate the rig again, or use the calibration of this rig"});
  }

  /// Angle between the camera's estimated and calibrated orientations.
  [[nodiscard]] double turnedDegrees() const {
    return logSo3(Eigen::Matrix3d(fit_.R_cam_imu * R_calibrated_.transpose())).norm() * kDegrees;
  }

  bool addFocal() {
    // A wrong focal length changes the estimated axes by some degrees.
    const Eigen::Matrix3d axes = turnedDegrees() > kSameAxes ? fit_.R_cam_imu : R_calibrated_;
    const auto focal = fitFocal(images_, turns_, gyro_, fit_, unit_ * axes, camera_);
    if (!focal) return false;
    measured_.push_back(
        {"focal length",
         fmt::format("estimated from the log {:.1f} px (sigma {:.1f} px), calibration {:.1f} px",
                     focal->ratio * camera_.focal(), focal->sigma * camera_.focal(), camera_.focal())});
    if (std::abs(std::log(focal->ratio)) < std::max(kLeastFocal, kSigmas * focal->sigma) ||
        focal->gain < kDecides)
      return false;
    findings_.push_back({"wrong focal length",
                         fmt::format("the gyro's rotations fit the images with {:.1f} px, {:.2f} times the "
                                     "{:.1f} px of the calibration",
                                     focal->ratio * camera_.focal(), focal->ratio, camera_.focal()),
                         "Use the calibration of this camera at this image size"});
    return true;
  }

  void addJitter(const std::vector<Stamp>& even) {
    std::vector<double> times;
    double sum = 0;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      const double off = (images_[i].stamp - even[i]).seconds();
      sum += off * off;
      times.push_back((even[i] - origin_).seconds());
    }
    const double rms = std::sqrt(sum / static_cast<double>(images_.size()));
    if (rms < kLeastJitter) return;
    const MotionFitter::Evenness evenness = fitter_.evenness(fit_, times);
    measured_.push_back(
        {"image stamps", fmt::format("{:.1f} ms rms from an even clock; the camera's rotations attribute "
                                     "{:.0f} % (sigma {:.0f} %) of it to the stamps",
                                     1e3 * rms, 100 * evenness.share, 100 * evenness.sigma)});
    // At least half of it, with certainty.
    if (evenness.share - 2 * evenness.sigma < 0.5 || evenness.share < kSigmas * evenness.sigma) return;
    findings_.push_back(
        {"image stamps jitter",
         fmt::format("they deviate {:.1f} ms rms from an even clock, and the gyro shows that the images were "
                     "taken evenly ({:.0f} % of the deviation is in the stamps, sigma {:.0f} %)",
                     1e3 * rms, 100 * evenness.share, 100 * evenness.sigma),
         "Stamp images at capture, not at arrival: use the driver's hardware stamps or a trigger line"});
  }

  void addForce() {
    SE3 T_body_cam = calibration_.rig.T_body_cam[0];
    if (turned_) T_body_cam = SE3(Eigen::Matrix3d(fit_.R_cam_imu.transpose()), T_body_cam.translation);
    std::vector<ImuSample> samples = samples_;
    for (ImuSample& sample : samples) sample.gyro *= unit_;
    const Eigen::Vector3d offset = -T_body_cam.R() * fit_.offset;
    const Duration shift = Duration::fromSeconds(fit_.shift);
    const ForceFitter fitter(images_, samples, camera_, T_body_cam, shift, offset);
    const ForceFit force = fitter.fit(Eigen::Matrix3d::Identity());
    if (force.windows < kFewestWindows) return;
    measured_.push_back({"gravity by images and accelerometer",
                         fmt::format("{:.2f} m/s^2 from {} motion segments, error {:.2f} px", force.gravity,
                                     force.windows, force.error)});
    ForceFit best = force;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
    for (const Eigen::Matrix3d& tried : signedAxes()) {
      const ForceFit other = fitter.fit(tried);
      if (other.windows < kFewestWindows || other.error >= best.error || !agrees(other)) continue;
      best = other;
      axes = tried;
    }
    // A flight need not distinguish all axes: the smallest change that explains it is reported.
    if (axes.isIdentity(1e-6)) return;
    if (agrees(force) && (best.error * kClearlyBetter > force.error || !best.beats(force))) return;
    const Eigen::Matrix3d opposite = -Eigen::Matrix3d::Identity();
    const ForceFit negated = fitter.fit(opposite);
    if (agrees(negated) && !best.beats(negated)) {
      best = negated;
      axes = opposite;
    }
    // If the motion is too slow to determine the sign, it does not distinguish axes either.
    if (!axes.isApprox(opposite) && !best.beats(force)) return;
    if (axes.isApprox(opposite)) {
      findings_.push_back(
          {"accelerometer negated",
           fmt::format("in {} of {} motion segments the images accelerate against its readings; negated, the "
                       "readings fit, with gravity of {:.2f} m/s^2",
                       force.negative, force.windows, best.gravity),
           "Negate the accelerometer: at rest it reads +9.81 m/s^2 along the axis that points up"});
      return;
    }
    findings_.push_back(
        {"accelerometer axes exchanged or negated",
         fmt::format("relative to the gyro and the images it gives {}: corrected, the images fit to {:.2f} "
                     "px with gravity of {:.2f} m/s^2; uncorrected, to {:.2f} px with {:.2f} m/s^2",
                     axesText(axes.transpose()), best.error, best.gravity, force.error, force.gravity),
         "Provide the accelerometer in the gyro's axes"});
  }

  /// Nearly all windows have the expected sign, and gravity has its size.
  static bool agrees(const ForceFit& force) {
    return static_cast<double>(force.negative) <= kOtherSign * static_cast<double>(force.windows) &&
           std::abs(force.gravity - kGravity) < kGravityOff * kGravity;
  }

  const Calibration& calibration_;
  const std::vector<ImuSample>& samples_;
  const std::vector<TrackedImage>& images_;
  const CameraModel& camera_;
  const Eigen::Matrix3d R_calibrated_;
  const Stamp origin_;
  std::vector<Measured>& measured_;
  const GyroIntegral gyro_;
  const std::vector<CameraTurn> turns_;
  MotionFitter fitter_;
  MotionFit fit_;
  bool turned_ = false;
  double unit_ = 1;
  std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> motionFindings(const Calibration& calibration, const std::vector<ImuSample>& samples,
                                    const std::vector<TrackedImage>& images, const std::vector<Stamp>& even,
                                    std::vector<Measured>& measured) {
  if (samples.empty()) return {};
  return MotionInspector(calibration, samples, images, measured)(even);
}

}  // namespace swiftlet
