#include "estimator/imu/rest_detector.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

constexpr Duration kBlock = Duration::fromMilliseconds(50);
// A longer silence restarts the windows, because the motion in it is unknown.
constexpr Duration kMaxSilence = Duration::fromMilliseconds(50);

// Slow band: RMS of 0.1 s means about their mean over 1 s. On the eleven EuRoC sequences 90 % are below 0.005
// rad/s and 0.07 m/s^2 when standing, idling rotors included, and 99.9 % above 0.014 and 0.053 when flying.
// The limit is kQuietFactor times the quietest window, between these bounds.
constexpr double kSlowGyroLow = 0.003;   // rad/s
constexpr double kSlowGyroHigh = 0.007;  // rad/s
constexpr double kSlowAccelLow = 0.04;   // m/s^2
constexpr double kSlowAccelHigh = 0.05;  // m/s^2
constexpr double kQuietFactor = 8.0;

// Whole band: idling rotors cause up to 0.06 rad/s and 0.9 m/s^2 (same logs); a shaker or an engine causes
// more.
constexpr double kGyroLimit = 0.06;
constexpr double kAccelLimit = 0.9;
// The short window decides alone only with the rotors off, when the scatter is the sensor's own.
constexpr double kShortGyroLimit = 0.012;
constexpr double kShortAccelLimit = 0.15;
constexpr double kShortSlowFactor = 0.8;
// At rest the newest 0.5 s may reach this multiple of the limits before the rest ends.
constexpr double kHoldFactor = 1.3;
// Wider limits if the images are still.
constexpr double kImageSlowFactor = 3.0;  // of the upper slow limits
constexpr double kImageGyroLimit = 0.1;
constexpr double kImageAccelLimit = 1.5;

// A sample that differs from the window's mean by more than this multiple of its deviation ends a rest.
constexpr double kJump = 5.0;
constexpr double kJumpGyroFloor = 0.01;   // rad/s: the last digits of coarse sensors
constexpr double kJumpAccelFloor = 0.15;  // m/s^2

// A 50 ms mean that differs from the window's mean by more than this multiple of the slow deviation ends it
// too.
constexpr double kDrift = 5.0;
constexpr double kDriftGyroFloor = 0.006;  // rad/s
constexpr double kDriftAccelFloor = 0.06;  // m/s^2

// Factor on both thresholds while the images move slowly: rotors that spin up reach 1.7 times, a take-off 3.4
// times the threshold (EuRoC V1_01, MH_05).
constexpr double kSlowSlack = 2.5;

constexpr Duration kImageLife = Duration::fromMilliseconds(300);  // older verdicts are ignored

constexpr double kUnknownBias = 0.15;   // rad/s; a larger mean rate cannot be the bias of a working sensor
constexpr double kBiasMargin = 0.005;   // rad/s beyond 3 sigma of the known bias
constexpr double kGravityMargin = 0.6;  // m/s^2: accelerometer bias and scale
constexpr double kStandingSpeed = 0.1;  // m/s beyond 3 sigma; a faster estimate is in motion
constexpr double kSurelySlow = 0.03;    // m/s; with speed + 2 sigma below it the body is not moving

double rms(const Eigen::Vector3d& squares, const Eigen::Vector3d& sum, double count) {
  const double variance = (squares / count - (sum / count).cwiseAbs2()).sum() / 3.0;
  return std::sqrt(std::max(0.0, variance));
}

}  // namespace

void RestDetector::Block::add(const Block& other) {
  if (count == 0) begin = other.begin;
  gyro += other.gyro;
  accel += other.accel;
  gyro_squares += other.gyro_squares;
  accel_squares += other.accel_squares;
  count += other.count;
}

RestDetector::RestDetector(const ImuNoise& noise)
    : noise_(noise), slow_gyro_limit_(kSlowGyroHigh), slow_accel_limit_(kSlowAccelHigh) {}

void RestDetector::reset() { *this = RestDetector(noise_); }

void RestDetector::addImu(const ImuSample& sample) {
  if (has_last_ && sample.stamp - last_ > kMaxSilence) {
    startAnew();
  }
  has_last_ = true;
  last_ = sample.stamp;
  if (state_.at_rest && images() != ImageMotion::kStill && jumps(sample)) startAnew();
  if (open_.count > 0 && sample.stamp - open_.begin >= kBlock) closeBlock();
  if (open_.count == 0) open_.begin = sample.stamp;
  open_.gyro += sample.gyro;
  open_.accel += sample.accel;
  open_.gyro_squares += sample.gyro.cwiseAbs2();
  open_.accel_squares += sample.accel.cwiseAbs2();
  open_.count += 1;
}

void RestDetector::addFrame(Stamp stamp, ImageMotion motion) {
  // Images are back. They must confirm a rest, because the IMU alone cannot tell rest from constant velocity.
  const bool first = images() == ImageMotion::kUnknown && motion == ImageMotion::kUncertain;
  image_motion_ = motion;
  image_stamp_ = stamp;
  if (motion == ImageMotion::kMoving || first) end();
}

void RestDetector::setEstimate(const Eigen::Vector3d& bias_gyro, double bias_gyro_sigma, double speed,
                               double speed_sigma) {
  has_estimate_ = true;
  bias_gyro_ = bias_gyro;
  bias_gyro_sigma_ = bias_gyro_sigma;
  speed_ = speed;
  speed_sigma_ = speed_sigma;
}

ImageMotion RestDetector::images() const {
  return last_ - image_stamp_ > kImageLife ? ImageMotion::kUnknown : image_motion_;
}

bool RestDetector::shaken() const {
  return images() == ImageMotion::kInPlace || images() == ImageMotion::kSlow;
}

bool RestDetector::imagesHold() const { return images() == ImageMotion::kStill || shaken(); }

RestDetector::Window RestDetector::window(std::size_t blocks) const {
  Window w;
  const std::size_t first = block_count_ - blocks;
  Eigen::Vector3d gyro_means = Eigen::Vector3d::Zero(), gyro_squares = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_means = Eigen::Vector3d::Zero(), accel_squares = Eigen::Vector3d::Zero();
  for (std::size_t i = first; i < block_count_; i += 2) {
    Block pair = blocks_[i % kLongBlocks];
    pair.add(blocks_[(i + 1) % kLongBlocks]);
    w.sum.add(pair);
    gyro_means += pair.gyro / pair.count;
    gyro_squares += (pair.gyro / pair.count).cwiseAbs2();
    accel_means += pair.accel / pair.count;
    accel_squares += (pair.accel / pair.count).cwiseAbs2();
  }
  const auto pairs = static_cast<double>(blocks / 2);
  w.gyro = rms(w.sum.gyro_squares, w.sum.gyro, w.sum.count);
  w.accel = rms(w.sum.accel_squares, w.sum.accel, w.sum.count);
  w.slow_gyro = rms(gyro_squares, gyro_means, pairs);
  w.slow_accel = rms(accel_squares, accel_means, pairs);
  return w;
}

bool RestDetector::meansAllow(const Window& w) const {
  const Eigen::Vector3d rate = w.sum.gyro / w.sum.count;
  const double force = (w.sum.accel / w.sum.count).norm();
  if (std::abs(force - noise_.gravity) > kGravityMargin) return false;
  if (!has_estimate_) return rate.norm() < kUnknownBias;
  return (rate - bias_gyro_).norm() < 3.0 * bias_gyro_sigma_ + kBiasMargin;
}

bool RestDetector::speedAllows() const {
  return !has_estimate_ || speed_ < 3.0 * speed_sigma_ + kStandingSpeed;
}

bool RestDetector::standsByEstimate() const {
  return has_estimate_ && speed_ + 2.0 * speed_sigma_ < kSurelySlow;
}

bool RestDetector::within(const Window& w, double slow_factor, double gyro_limit, double accel_limit) const {
  return w.slow_gyro < slow_factor * slow_gyro_limit_ && w.slow_accel < slow_factor * slow_accel_limit_ &&
         w.gyro < gyro_limit && w.accel < accel_limit && meansAllow(w);
}

bool RestDetector::withinImageLimits(const Window& w) const {
  return w.slow_gyro < kImageSlowFactor * kSlowGyroHigh && w.slow_accel < kImageSlowFactor * kSlowAccelHigh &&
         w.gyro < kImageGyroLimit && w.accel < kImageAccelLimit && meansAllow(w);
}

bool RestDetector::jumps(const ImuSample& sample) const {
  const double slack = imuSlack();
  return ((sample.gyro - window_gyro_).cwiseAbs().array() > slack * jump_gyro_.array()).any() ||
         ((sample.accel - window_accel_).cwiseAbs().array() > slack * jump_accel_.array()).any();
}

bool RestDetector::drifts(const Block& block) const {
  const double slack = imuSlack();
  return (block.gyro / block.count - window_gyro_).cwiseAbs().maxCoeff() > slack * drift_gyro_ ||
         (block.accel / block.count - window_accel_).cwiseAbs().maxCoeff() > slack * drift_accel_;
}

// Factor by which a reading must differ more than usual to end a rest.
double RestDetector::imuSlack() const { return shaken() ? kSlowSlack : 1.0; }

void RestDetector::closeBlock() {
  blocks_[block_count_ % kLongBlocks] = open_;
  ++block_count_;
  if (state_.at_rest && images() != ImageMotion::kStill && drifts(open_)) end();
  if (state_.at_rest) rest_.add(open_);
  open_ = Block{};
  if (block_count_ < kImageBlocks) return;

  const ImageMotion images = this->images();
  const Window image_window = window(kImageBlocks);
  const bool by_images = images == ImageMotion::kStill && speedAllows() && withinImageLimits(image_window);
  if (block_count_ < kShortBlocks) {
    if (by_images && !state_.at_rest) begin(image_window);
    return;
  }
  const Window short_window = window(kShortBlocks);
  const double gyro_count = short_window.sum.count;
  window_gyro_ = short_window.sum.gyro / gyro_count;
  window_accel_ = short_window.sum.accel / gyro_count;
  const auto jump = [&](const Eigen::Vector3d& squares, const Eigen::Vector3d& mean, double floor) {
    const Eigen::Vector3d variance = (squares / gyro_count - mean.cwiseAbs2()).cwiseMax(0.0);
    return Eigen::Vector3d((kJump * variance.cwiseSqrt()).cwiseMax(floor));
  };
  jump_gyro_ = jump(short_window.sum.gyro_squares, window_gyro_, kJumpGyroFloor);
  jump_accel_ = jump(short_window.sum.accel_squares, window_accel_, kJumpAccelFloor);

  drift_gyro_ = std::max(kDrift * short_window.slow_gyro, kDriftGyroFloor);
  drift_accel_ = std::max(kDrift * short_window.slow_accel, kDriftAccelFloor);

  if (state_.at_rest) {
    const bool holds = imagesHold() ? withinImageLimits(short_window)
                                    : within(short_window, kHoldFactor, kImageGyroLimit, kImageAccelLimit);
    if (!holds) end();
  }
  if (block_count_ >= kLongBlocks) updateLimits(window(kLongBlocks));
  const bool quiet = within(short_window, kShortSlowFactor, kShortGyroLimit, kShortAccelLimit);
  const Window long_window = block_count_ >= kLongBlocks ? window(kLongBlocks) : short_window;
  const bool long_quiet = block_count_ >= kLongBlocks && within(long_window, 1.0, kGyroLimit, kAccelLimit);
  const bool imu_may = images == ImageMotion::kUnknown || images == ImageMotion::kInPlace ||
                       (imagesHold() && standsByEstimate());
  if (!state_.at_rest && by_images) {
    begin(image_window);
  } else if (!state_.at_rest && imu_may && speedAllows() && (quiet || long_quiet)) {
    begin(quiet ? short_window : long_window);
  }
  if (state_.at_rest) {
    state_.duration = (last_ - rest_.begin).seconds();
    state_.mean_gyro = rest_.gyro / rest_.count;
    state_.mean_accel = rest_.accel / rest_.count;
  }
}

void RestDetector::begin(const Window& w) {
  rest_ = w.sum;
  state_.at_rest = true;
  state_.number = ++rests_;
  state_.since = w.sum.begin;
  state_.duration = (last_ - rest_.begin).seconds();
  state_.mean_gyro = rest_.gyro / rest_.count;
  state_.mean_accel = rest_.accel / rest_.count;
}

void RestDetector::startAnew() {
  end();
  block_count_ = 0;
  open_ = Block{};
}

void RestDetector::end() {
  state_.at_rest = false;
  state_.number = 0;
  state_.duration = 0;
}

void RestDetector::updateLimits(const Window& w) {
  slow_gyro_limit_ = std::clamp(kQuietFactor * w.slow_gyro, kSlowGyroLow, slow_gyro_limit_);
  slow_accel_limit_ = std::clamp(kQuietFactor * w.slow_accel, kSlowAccelLow, slow_accel_limit_);
}

}  // namespace swiftlet
