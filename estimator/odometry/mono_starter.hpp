#pragma once
// The start with one camera: keeps frames until velocity, tilt and scale can be solved.
//
// One camera does not observe scale until the body accelerates, so the first frames wait here, at most
// `kMonoPatience`. They are then given to the smoother one after the other from the solved first state, as if
// they had just arrived. At rest the velocity is known, and no frame has to wait.
// Memory: 64 frames, 0.9 MiB, reserved by the constructor. Cost: one solve of mono_start.hpp per frame while
// waiting.

#include <Eigen/Core>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/mono_start.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

/// Longest wait for a certain scale; then the best estimate is used.
inline constexpr Duration kMonoPatience = Duration::fromMilliseconds(2600);

class MonoStarter {
 public:
  MonoStarter(const Rig& rig, const ImuNoise& noise);

  void reset();

  /// Keeps a frame; drops the oldest if full.
  void push(const TrackedFrame& frame);

  [[nodiscard]] std::size_t size() const { return count_; }
  /// Kept frame k, oldest first.
  [[nodiscard]] const TrackedFrame& frame(std::size_t k) const {
    return frames_[(begin_ + k) % frames_.size()];
  }

  /// Solves from the kept frames, without samples before `earliest`. True if the scale is known well enough
  /// or kMonoPatience is over since the first frame after reset(); `start` is then the state at the oldest.
  /// Otherwise `waiting_for` tells what is missing.
  bool trySolve(const ImuBuffer& imu, Stamp earliest, const StartPrior& prior, double pixel_sigma,
                StartState& start, const char*& waiting_for);

 private:
  [[nodiscard]] std::size_t gatherTracks(std::span<const std::size_t> chosen, const ImuBuffer& imu,
                                         const Eigen::Vector3d& bias_gyro);

  Rig rig_;
  ImuNoise noise_;
  std::vector<TrackedFrame> frames_;
  Stamp waits_since_;
  std::size_t begin_ = 0;
  std::size_t count_ = 0;
  std::vector<BearingTrack> tracks_;
  std::vector<TrackId> track_ids_;
  std::vector<Preintegration> from_first_;
};

}  // namespace swiftlet
