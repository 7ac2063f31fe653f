#pragma once
// Full smoothing: all keyframes of a run, the IMU between them and all landmarks in one sparse Gauss-Newton
// problem without marginalization. Loop closures connect visits of the same place.
//
// Keyframes are stored as they come from the odometry, whose causal states are the initial values. `solve`
// then minimizes over the factors of the fixed-lag smoother (except rest): preintegrated IMU between
// neighbours, landmarks eliminated by their Schur complement, Cauchy weights, outliers removed. The
// calibration is the given one or an earlier estimate (setCalibration). The reduced system (15 columns per
// keyframe) is sparse and factored by CHOLMOD, or by Eigen in a build without it.
//
// Revisits: each match of a loop is a further observation of the old landmark from the new keyframe, with the
// noise of a match. The relative poses of the loops first pull the keyframes together and are then dropped,
// because they were computed from the same matches. Matches that do not fit are not used and are tried again
// twice; a loop with fewer than six fitting matches is not used. A pair of tracks counts once, whatever the
// number of loops.
//
// Frames: those of the odometry. Each epoch has its own world, held by its first keyframe; epochs joined by
// loops share the world of the earliest. Off the flight path: allocates. Memory is linear in keyframes: about
// 40 kB each at 200 features and 200 Hz, and the sparse system while solving; memoryNeeded() computes it in
// advance. A match takes 0.3 kB. A landmark seen in more than 120 keyframes is continued as a new one, so
// that only loops connect keyframes farther apart. Source: Kaess et al., "Square Root SAM", IJRR 2006;
// factors: docs/smoother.md.

#include <atomic>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/landmark.hpp"
#include "estimator/smoother/relative_pose_factor.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

/// Status text of a stopped solve.
inline constexpr const char* kFullSmoothingStopped = "full smoothing was stopped";

struct FullSmootherSettings {
  double match_sigma = 1.2;  ///< px, of a loop's match, including pixel noise
  int max_iterations = 12;
};

/// Figures of a solve, for the summary. Costs are half sums of whitened squares, robust for observations.
struct FullSmootherReport {
  int iterations = 0;
  double initial_cost = 0;  ///< at the odometry's states
  double final_cost = 0;    ///< at the last linearization
  std::size_t keyframes = 0;
  std::size_t landmarks = 0;
  std::size_t revisits = 0;       ///< loops given
  std::size_t revisits_used = 0;  ///< of these, loops whose matches were used
  std::size_t matches = 0;        ///< of the given loops, without repetitions and without unknown tracks
  std::size_t matches_used = 0;
};

class FullSmoother {
 public:
  FullSmoother(const Rig& rig, const ImuNoise& noise, const FullSmootherSettings& settings);

  /// Adds every sample, in order, before the frames that follow it. None is needed after the last keyframe.
  void addImu(const ImuSample& sample);

  /// Adds a keyframe with its state from the odometry and the noise used for it, in order of time. A new
  /// epoch starts a new, unconnected trajectory.
  void addKeyframe(const TrackedFrame& frame, const NavState& state, const NoiseInUse& noise);

  /// Adds a verified loop between two keyframes added before. kInvalidInput if there is no keyframe at a
  /// stamp, the old one is not older, or the pose or its information is not usable. Matches without track and
  /// pixel are skipped.
  Status addRevisit(const LoopRevisit& revisit);

  /// Replaces the initial poses, one per keyframe, by those of a pose graph, if the drift is large. Epochs
  /// joined by loops must share a world already. Velocities rotate with their poses. kInvalidInput if the
  /// number is not size() or a pose is not finite.
  Status setPoses(std::span<const SE3> T_world_body);

  /// Replaces the constructor's calibration by the odometry's last estimate; call after the keyframes were
  /// added. The time shift may differ from the constructor's by less than 0.1 s.
  void setCalibration(const CalibrationEstimate& calibration);

  /// Minimizes over everything added so far. kNotReady below three keyframes. kNumerical if the system cannot
  /// be factored. Any thread may set `stop`: the solve then returns kFailed with the text
  /// kFullSmoothingStopped within one factorization. After an error the states are not valid.
  Status solve(FullSmootherReport& report, const std::atomic<bool>* stop = nullptr);

  /// Upper bound of the memory of this object and solve() for everything added so far [bytes]: stored data,
  /// the system, and its factor in the keyframes' own order (the solver's is smaller).
  [[nodiscard]] std::size_t memoryNeeded() const;

  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }
  /// State of keyframe k, with the image's stamp.
  [[nodiscard]] NavState state(std::size_t k) const;
  /// The epoch in whose world the state of keyframe k is: its own, or the earliest joined to it by loops.
  [[nodiscard]] std::uint32_t world(std::size_t k) const { return worlds_.at(keyframes_[k].epoch); }

 private:
  using TrackKey = std::pair<std::uint32_t, TrackId>;  // epoch, id
  struct Keyframe {
    Stamp stamp;
    std::uint32_t epoch = 0;
    BodyState x;
    NoiseInUse noise;
    bool linked = false;  ///< by IMU to the previous keyframe
    std::vector<ImuSample> samples;
    Preintegration imu;
    ScanTurn scan;  ///< rotation during the rows of its image
  };
  struct Track {
    std::vector<Sighting> sightings;
    LandmarkPoint point;
    bool in_system = false;
  };
  /// A further observation of a track, from a loop.
  struct Match {
    TrackKey track;
    Sighting sighting;
    bool used = false;
  };
  struct Revisit {
    std::size_t old_keyframe = 0;
    std::size_t new_keyframe = 0;
    SE3 T_old_new;
    Matrix6d root_information;
    std::size_t first_match = 0;  // in matches_
    std::size_t match_count = 0;
    std::size_t repeated = 0;  // matches that are also in an earlier loop
  };
  struct System;
  class Solver;

  void placeCameras();
  void integrateLinks();
  void triangulateAll();
  void removeOutliers();
  double linearize(System& system);
  void tieAll(System& system) const;
  double linearizeTrack(const Track& track, System& system) const;
  void linearizeMotion(System& system, double& cost) const;

  void addSighting(const TrackKey& key, const Sighting& sighting);
  [[nodiscard]] bool findKeyframe(Stamp stamp, std::size_t& k) const;
  [[nodiscard]] bool findOldTrack(std::size_t keyframe, const RevisitFeature& feature, TrackKey& key);
  void addMatch(const RevisitMatch& match, Revisit& revisit);
  void joinWorlds();
  void moveWorld(std::uint32_t world, const SE3& T_to_from);
  void tieWorlds(bool by_matches);
  [[nodiscard]] bool stopped() const { return stop_ != nullptr && stop_->load(std::memory_order_relaxed); }
  Status pullTogether(Solver& solver, System& system);
  void retractAll(const Eigen::VectorXd& step);
  void fillReport(FullSmootherReport& report) const;
  void linearizeRevisits(System& system) const;
  void chooseMatches(double gate_sigmas);
  void tryMatch(Match& match, double gate_sigmas);
  void withdraw(Match& match);
  void forgetPoints();
  [[nodiscard]] std::size_t matchesInSystem(const Revisit& revisit) const;

  Rig rig_;
  ImuNoise noise_;
  SampleMonitor monitor_;
  GyroIntrinsics intrinsics_;
  FullSmootherSettings settings_;
  std::vector<Keyframe> keyframes_;
  std::map<TrackKey, Track> tracks_;
  std::vector<ImuSample> pending_imu_;
  std::vector<RigPose> poses_;
  std::vector<Revisit> revisits_;
  std::vector<Match> matches_;
  std::set<std::pair<TrackKey, TrackKey>> matched_tracks_;    // old, new
  std::set<std::pair<TrackKey, std::size_t>> matched_slots_;  // track and keyframe
  std::map<std::uint32_t, std::uint32_t> worlds_;             // epoch to the epoch whose world it shares
  TrackId next_revisit_track_;
  bool poses_given_ = false;
  const std::atomic<bool>* stop_ = nullptr;  ///< while solve() runs
};

}  // namespace swiftlet
