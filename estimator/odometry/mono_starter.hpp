#pragma once
// The start with one camera: keeps frames until velocity, tilt and scale can be solved.
//
// With one camera, scale is not observable until the body accelerates, so the first frames wait here, at most
// `kMonoPatience`. They are then passed to the smoother one after the other from the solved first state, as
// if they had just arrived. At rest the velocity is known, and no frame has to wait. Memory: 64 frames, 0.9
// MiB, reserved by the constructor. If they are full before the patience has passed, every second frame is
// dropped (keyframes are kept), and of later frames only every second one is kept, so the frames span the
// whole wait at any frame rate. Cost: one solve of mono_start.hpp per kept frame while waiting.

#include <Eigen/Core>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/mono_start.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

/// Longest wait for an accurate scale; then the best estimate is used.
inline constexpr Duration kMonoPatience = Duration::fromMilliseconds(2600);

class MonoStarter {
 public:
  MonoStarter(const Rig& rig, const ImuNoise& noise);

  void reset();
  void setNoise(const ImuNoise& noise) { noise_ = noise; }

  /// Keeps a frame, unless it is skipped because of a high frame rate. Drops the oldest if full.
  void push(const TrackedFrame& frame);

  [[nodiscard]] std::size_t size() const { return count_; }
  /// Kept frame k, oldest first.
  [[nodiscard]] const TrackedFrame& frame(std::size_t k) const {
    return frames_[(begin_ + k) % frames_.size()];
  }

  /// Solves with the kept frames and the calibration as estimated so far, without samples before `earliest`.
  /// Call after each push. True if the scale is accurate enough or kMonoPatience has passed since the first
  /// frame after reset(); `start` is then the state at the oldest kept frame. Otherwise `waiting_for` tells
  /// what is missing.
  bool trySolve(const ImuBuffer& imu, Stamp earliest, const StartPrior& prior,
                const CalibrationEstimate& calibration, double pixel_sigma, StartState& start,
                const char*& waiting_for);

 private:
  [[nodiscard]] std::size_t gatherTracks(std::span<const std::size_t> chosen, const ImuBuffer& imu,
                                         const Eigen::Vector3d& bias_gyro, const GyroIntrinsics& gyro);

  void thinOut();

  Rig rig_;  ///< with the calibration of the last trySolve()
  ImuNoise noise_;
  std::vector<TrackedFrame> frames_;
  Stamp waits_since_;
  std::size_t begin_ = 0;
  std::size_t count_ = 0;
  std::size_t stride_ = 1;      ///< every n-th frame is kept
  std::size_t since_kept_ = 0;  ///< frames since the last kept one
  bool newest_kept_ = false;    ///< the last frame pushed is the newest kept one
  std::vector<BearingTrack> tracks_;
  std::vector<TrackId> track_ids_;
  std::vector<Preintegration> from_first_;
};

}  // namespace swiftlet
