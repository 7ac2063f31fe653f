#include "drivers/simulated/calibration_session.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Streams of the random generator; the corners of image k have kCornerStream + 2 k + camera.
constexpr std::uint64_t kHandStream = 72;
constexpr std::uint64_t kStampStream = 73;
constexpr std::uint64_t kCornerStream = 1000;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kRadians = std::numbers::pi / 180;
constexpr double kHandKnots = 0.04;     // s; short enough to represent the hand's tremor
constexpr double kSessionMargin = 0.5;  // s of motion beyond both ends, for the spline's support
constexpr double kImageMargin = 0.1;    // s of IMU data before the first image and after the last
constexpr double kRestRamp = 1.0;       // s from motion to rest
constexpr double kMostSlant = 80;       // deg between the line of sight and the board's normal

// The person's motion. Slow part: around the board, nearer and farther, and the board's position in the
// image.
constexpr double kRoundLow = 0.04;       // Hz
constexpr double kRoundHigh = 0.12;      // Hz
constexpr double kTilt = 32 * kRadians;  // about each axis: 45 degrees together
constexpr double kRoll = 40 * kRadians;
constexpr double kPlace = 0.7;  // of half the image
constexpr double kFarOverNear = 2.2;
// Fast part: rotation about and translation along the three axes of the camera, each dominant in turn.
constexpr double kSwingLow = 0.5;   // Hz
constexpr double kSwingHigh = 1.1;  // Hz
constexpr double kSwingTurn = 14 * kRadians;
constexpr double kSwingShift = 0.10;  // m
constexpr double kSwingRound = 20;    // s in which each axis is dominant once
// Tremor of the hand.
constexpr double kTrembleLow = 1.5;      // Hz
constexpr double kTrembleHigh = 4;       // Hz
constexpr double kTrembleTurn = 1.5e-3;  // rad
constexpr double kTrembleShift = 4e-4;   // m

double restShare(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (x * (6.0 * x - 15.0) + 10.0);
}

// 1 in motion, 0 at rest.
double moving(const std::vector<TimeSpan>& rests, double t) {
  double share = 1;
  for (const TimeSpan& rest : rests) {
    share *= 1 - restShare((t - rest.begin + kRestRamp) / kRestRamp) + restShare((t - rest.end) / kRestRamp);
  }
  return share;
}

// Two sines of random frequency and phase, within -1 and 1.
class Wave {
 public:
  Wave(Random& random, double low_hz, double high_hz) {
    for (int i = 0; i < 2; ++i) {
      omega_[i] = kTurn * random.uniform(low_hz, high_hz);
      phase_[i] = random.uniform(0, kTurn);
    }
  }
  double operator()(double t) const {
    return 0.65 * std::sin(omega_[0] * t + phase_[0]) + 0.35 * std::sin(omega_[1] * t + phase_[1]);
  }

 private:
  Eigen::Vector2d omega_;
  Eigen::Vector2d phase_;
};

class Wave3 {
 public:
  Wave3(Random& random, double low_hz, double high_hz)
      : x_(random, low_hz, high_hz), y_(random, low_hz, high_hz), z_(random, low_hz, high_hz) {}
  Eigen::Vector3d operator()(double t) const { return {x_(t), y_(t), z_(t)}; }

 private:
  Wave x_;
  Wave y_;
  Wave z_;
};

// Weights of the three axes: each is dominant in turn.
Eigen::Vector3d emphasis(double t) {
  Eigen::Vector3d share;
  for (int axis = 0; axis < 3; ++axis) {
    share[axis] = 0.4 + 0.6 * std::max(0.0, std::cos(kTurn * (t / kSwingRound - axis / 3.0)));
  }
  return share;
}

// Poses in board axes of a frame between the cameras, with the axes of camera 0.
class HandMotion {
 public:
  HandMotion(Random& random, const Rig& rig, const CalibrationTarget& target, Turning turning)
      : lens_(rig.camera[0]),
        turning_(turning),
        tilt_x_(random, kRoundLow, kRoundHigh),
        tilt_y_(random, kRoundLow, kRoundHigh),
        roll_(random, kRoundLow, kRoundHigh),
        place_x_(random, kRoundLow, kRoundHigh),
        place_y_(random, kRoundLow, kRoundHigh),
        distance_(random, kRoundLow, kRoundHigh),
        swing_turn_(random, kSwingLow, kSwingHigh),
        swing_shift_(random, kSwingLow, kSwingHigh),
        tremble_turn_(random, kTrembleLow, kTrembleHigh),
        tremble_shift_(random, kTrembleLow, kTrembleHigh) {
    const Eigen::Vector3d extent = target.corner(target.cornerCount() - 1 - (target.hasTags() ? 1 : 0));
    centre_ = 0.5 * extent;
    const double half_width = 0.5 * extent.head<2>().maxCoeff();
    // Smallest distance: the board fills most of the image's width, the distance is at least 0.4 of the
    // board's width, and both cameras see it.
    const double middle = 0.5 * (lens_.height() - 1);
    const Eigen::Vector3d left = rayAt({0, middle});
    const Eigen::Vector3d right = rayAt({lens_.width() - 1.0, middle});
    const double across = std::atan2(right.x(), right.z()) - std::atan2(left.x(), left.z());
    const double angle = std::min(0.42 * across, 50 * kRadians);
    near_ = std::max({half_width / std::tan(angle), 0.8 * half_width, 1.5 * rig.baseline()});
  }

  SE3 operator()(double t) const {
    const double around = turning_ == Turning::kNone ? 0.5 : 1;  // otherwise the board leaves the image
    const Eigen::Quaterniond side = expSo3(around * kTilt * tilt_y_(t) * Eigen::Vector3d::UnitY()) *
                                    expSo3(around * kTilt * tilt_x_(t) * Eigen::Vector3d::UnitX());
    const double distance = near_ * std::pow(kFarOverNear, 0.5 * (1 + distance_(t)));
    const Eigen::Quaterniond facing(0, 1, 0, 0);  // x right, y down, looking at the board
    Eigen::Quaterniond R_board_mid = facing;
    if (turning_ != Turning::kNone) {
      const Eigen::Vector3d ray = rayAt({0.5 * (lens_.width() - 1) * (1 + kPlace * place_x_(t)),
                                         0.5 * (lens_.height() - 1) * (1 + kPlace * place_y_(t))});
      const Eigen::Quaterniond aside = Eigen::Quaterniond::FromTwoVectors(ray, Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d turn =
          kSwingTurn * emphasis(t).cwiseProduct(swing_turn_(t)) + kTrembleTurn * tremble_turn_(t);
      R_board_mid =
          side * facing * expSo3(kRoll * roll_(t) * Eigen::Vector3d::UnitZ()) * aside * expSo3(turn);
    }
    const double reach = std::min(kSwingShift, 0.3 * near_);
    const Eigen::Vector3d shift = reach * emphasis(t + 0.5 * kSwingRound).cwiseProduct(swing_shift_(t)) +
                                  kTrembleShift * tremble_shift_(t);
    return {R_board_mid, centre_ + side * Eigen::Vector3d(0, 0, distance) + R_board_mid * shift};
  }

 private:
  [[nodiscard]] Eigen::Vector3d rayAt(const Eigen::Vector2d& pixel) const {
    Eigen::Vector3d ray;
    if (!lens_.unproject(pixel, ray)) throw std::invalid_argument("rig: the lens does not cover its image");
    return ray;
  }

  CameraModel lens_;
  Turning turning_;
  Wave tilt_x_, tilt_y_, roll_, place_x_, place_y_, distance_;
  Wave3 swing_turn_, swing_shift_, tremble_turn_, tremble_shift_;
  Eigen::Vector3d centre_;
  double near_ = 0;
};

// Turns each pose about its z axis such that no angular rate about it remains.
void takeRollAway(std::vector<SE3>& poses) {
  double angle = 0;
  Eigen::Quaterniond before = poses.front().rotation;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Quaterniond now = poses[i].rotation;
    angle -= logSo3(before.conjugate() * now).z();
    before = now;
    poses[i] = SE3(now * expSo3(angle * Eigen::Vector3d::UnitZ()), poses[i].translation);
  }
}

}  // namespace

CalibrationSession::CalibrationSession(const CalibrationRig& rig, const CalibrationTarget& target,
                                       const SessionSettings& settings)
    : rig_(rig), target_(target), settings_(settings) {
  const double last = settings.duration - kImageMargin;
  image_count_ = static_cast<int>(std::floor((last - kImageMargin) * settings.camera_rate + 1e-9)) + 1;
  if (!(settings.camera_rate > 0) || image_count_ < 1) {
    throw std::invalid_argument("duration: too short for an image");
  }
  move();
  ImuSimulationSettings imu;
  imu.noise = rig.noise;
  imu.gyro_matrix = settings.imu_axes * rig.gyro_matrix;
  imu.accel_matrix = settings.imu_axes * rig.accel_matrix;
  imu.seed = settings.seed;
  imu_ = simulateImu(trajectory_, imu, settings.start, settings.duration);
}

void CalibrationSession::move() {
  Random random(settings_.seed, kHandStream);
  // About upright on a wall: y up, z out of the wall.
  constexpr double kLean = 10 * kRadians;
  const double lean_x = kLean * random.uniform(-1, 1);
  const double lean_z = kLean * random.uniform(-1, 1);
  T_world_board_ = SE3(expSo3({0.5 * std::numbers::pi + lean_x, 0, 0}) * expSo3({0, 0, lean_z}), {0, 0, 1.2});

  const HandMotion motion(random, rig_.rig, target_, settings_.turning);
  const SE3 T_cam0_mid(Eigen::Quaterniond::Identity(), 0.5 * rig_.rig.T_cam1_cam0().inverse().translation);
  const SE3 T_mid_body = (rig_.rig.T_body_cam[0] * T_cam0_mid).inverse();
  std::vector<SE3> poses;
  constexpr int kSubsteps = 8;
  const auto count = static_cast<int>(std::ceil((settings_.duration + 2 * kSessionMargin) / kHandKnots));
  double motion_time = 0;  // stands still at rest
  for (int i = 0; i < count; ++i) {
    poses.push_back(motion(motion_time));
    for (int k = 0; k < kSubsteps; ++k) {
      const double t = kHandKnots * (i + (k + 0.5) / kSubsteps) - kSessionMargin;
      motion_time += kHandKnots / kSubsteps * moving(settings_.rests, t);
    }
  }
  if (settings_.turning == Turning::kNoRoll) takeRollAway(poses);
  for (SE3& pose : poses) pose = T_world_board_ * pose * T_mid_body;
  trajectory_ =
      SplineTrajectory(kHandKnots * SplineTrajectory::kCentreOffset - kSessionMargin, kHandKnots, poses);
}

double CalibrationSession::imageTime(int k) const { return kImageMargin + k / settings_.camera_rate; }

Stamp CalibrationSession::imageStamp(int k) const {
  const double t = imageTime(k);
  Random random(settings_.seed, kStampStream + static_cast<std::uint64_t>(k) * 2);
  const double jitter = settings_.stamp_jitter > 0 ? settings_.stamp_jitter * random.normal() : 0;
  return settings_.start + Duration::fromSeconds(t * (1 + settings_.clock_drift) + jitter) +
         settings_.clock_offset - rig_.rig.camera_to_imu_shift;
}

bool CalibrationSession::see(double seconds, std::size_t camera, const Eigen::Vector3d& p_world,
                             Eigen::Vector2d& pixel) const {
  const CameraModel& lens = rig_.rig.camera[camera];
  const double most_slant = std::cos(kMostSlant * kRadians);
  double row_time = 0;
  constexpr int kMostRounds = 30;       // each reduces the error to some hundredths
  constexpr double kExactTime = 1e-13;  // s
  for (int round = 0; round < kMostRounds; ++round) {
    const SE3 T_world_cam = trajectory_.pose(seconds + row_time) * rig_.rig.T_body_cam[camera];
    if (!lens.project(T_world_cam.inverse() * p_world, pixel)) return false;
    const Eigen::Vector3d to_camera = (T_world_cam.translation - p_world).normalized();
    if (to_camera.dot(T_world_board_.rotation * Eigen::Vector3d::UnitZ()) < most_slant) return false;
    const double before = row_time;
    row_time = rig_.rig.rowTime(camera, pixel.y());
    if (std::abs(row_time - before) < kExactTime) return lens.inImage(pixel, settings_.border);
  }
  return false;
}

BoardView CalibrationSession::exactView(int k, std::size_t camera) const {
  BoardView view;
  view.stamp = imageStamp(k);
  view.camera = camera;
  const double seconds = imageTime(k);
  const int together = target_.hasTags() ? 4 : 1;  // a tag is seen as a whole
  std::vector<BoardCorner> seen;
  for (int first = 0; first < target_.cornerCount(); first += together) {
    seen.clear();
    for (int id = first; id < first + together; ++id) {
      Eigen::Vector2d pixel;
      if (!see(seconds, camera, T_world_board_ * target_.corner(id), pixel)) break;
      seen.push_back({id, pixel});
    }
    if (static_cast<int>(seen.size()) == together) {
      view.corners.insert(view.corners.end(), seen.begin(), seen.end());
    }
  }
  return view;
}

std::vector<BoardView> CalibrationSession::exactViews(int k) const {
  std::vector<BoardView> views;
  for (std::size_t camera = 0; camera < rig_.rig.camera_count; ++camera)
    views.push_back(exactView(k, camera));
  return views;
}

std::vector<BoardView> CalibrationSession::views(int k) const {
  std::vector<BoardView> views = exactViews(k);
  for (BoardView& view : views) {
    Random random(settings_.seed, kCornerStream + 2 * static_cast<std::uint64_t>(k) + view.camera);
    for (BoardCorner& corner : view.corners) {
      const double nx = random.normal();
      const double ny = random.normal();
      corner.pixel += settings_.corner_sigma[view.camera] * Eigen::Vector2d(nx, ny);
    }
  }
  return views;
}

}  // namespace swiftlet
