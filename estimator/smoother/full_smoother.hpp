#pragma once
// Full smoothing: every keyframe of a run, all IMU between them and all landmarks in one sparse
// Gauss-Newton problem, nothing marginalized.
//
// Keyframes are kept as they come from the odometry (its causal states are the initial values);
// `solve` then minimizes over the fixed-lag smoother's factors (but rest): preintegrated IMU between
// neighbours, landmarks eliminated by their Schur complement, Cauchy weights, outliers removed. The
// calibration is the given one. The reduced system (15 columns a keyframe) is sparse and factored by
// CHOLMOD, or by Eigen in a build without it.
// Frames: as the odometry's; each epoch keeps its own world, held by its first keyframe.
// Off the flight path: it allocates. Memory grows with the run up to `max_keyframes` (some 40 kB each
// at 200 features and 200 Hz, and the sparse system while it solves); beyond it further keyframes are
// refused (kCapacityReached) and the rest of the run is not in the map.
// Source: Kaess et al., "Square Root SAM", IJRR 2006; the factors are those of docs/smoother.md.

#include <cstdint>
#include <map>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/landmark.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

struct FullSmootherSettings {
  double pixel_sigma = 0.6;          ///< px
  std::size_t max_keyframes = 4000;  ///< 11 minutes at 6 a second
  int max_iterations = 12;
};

/// Figures of a solve, for the summary. Costs are half sums of whitened squares, robust for sightings.
struct FullSmootherReport {
  int iterations = 0;
  double initial_cost = 0;  ///< at the odometry's states
  double final_cost = 0;    ///< at the last linearization
  std::size_t keyframes = 0;
  std::size_t landmarks = 0;
};

class FullSmoother {
 public:
  FullSmoother(const Rig& rig, const ImuNoise& noise, const FullSmootherSettings& settings);

  /// Every sample, in order, before the frames that follow it.
  void addImu(const ImuSample& sample) { pending_imu_.push_back(sample); }

  /// A keyframe with the odometry's state for it, in order of time. A new epoch starts a new, unconnected
  /// trajectory. kCapacityReached beyond max_keyframes.
  Status addKeyframe(const TrackedFrame& frame, const NavState& state);

  /// Minimizes over everything added so far. kNotReady below three keyframes; kNumerical when the
  /// system cannot be factored (the states stay as they were).
  Status solve(FullSmootherReport& report);

  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }
  /// State of keyframe k, with the image's stamp.
  [[nodiscard]] NavState state(std::size_t k) const;

 private:
  struct Keyframe {
    Stamp stamp;
    std::uint32_t epoch = 0;
    BodyState x;
    bool linked = false;  ///< by IMU to the keyframe before
    std::vector<ImuSample> samples;
    Preintegration imu;
  };
  struct Track {
    std::vector<Sighting> sightings;
    LandmarkPoint point;
    bool in_system = false;
  };
  struct System;

  void placeCameras();
  void integrateLinks();
  void triangulateAll();
  void removeOutliers();
  double linearize(System& system);
  double linearizeTrack(const Track& track, System& system) const;
  void linearizeMotion(System& system, double& cost) const;

  Rig rig_;
  ImuNoise noise_;
  FullSmootherSettings settings_;
  std::vector<Keyframe> keyframes_;
  std::map<std::pair<std::uint32_t, TrackId>, Track> tracks_;
  std::vector<ImuSample> pending_imu_;
  std::vector<RigPose> poses_;
};

}  // namespace swiftlet
