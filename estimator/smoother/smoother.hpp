#pragma once
// Fixed-lag smoother: Gauss-Newton over a sliding window of body states.
//
// Window, in order of time: pose-only keyframes; keyframes with velocity and biases; the newest
// frames. A frame that is no keyframe leaves by merging its two IMU intervals (nothing is
// linearized for good); an old keyframe first loses velocity and biases, then its pose, both into
// the prior, the latter with the landmarks that it saw and no recent frame sees. Landmarks are structureless
// until they are promoted to columns of their own; planes are further columns (extra_states.hpp). States that
// the prior touches keep their first estimate as linearization point, moved with the window (window.hpp).
// The parts: window, landmark_table, extra_table, calibration_state, prior (what there is: window_problem);
// window_factors, window_solver, window_covariance, window_trim, marginalization (what is done to it).
// Frames: world (z up, origin and yaw of the first state), body (= IMU), cameras. SI units, pixels.
// Memory: 14.1 MiB, all reserved by the constructor (table in docs/smoother.md); nothing is allocated
// after it. Full is normal: the landmark not seen for longest, and the oldest IMU samples, go first.
// Cost: linear in landmarks, cubic in the window's dimension (at most 192 columns by default, and 3
// for each explicit landmark and plane).
// Sources: Leutenegger et al., "Keyframe-based visual-inertial odometry using nonlinear
// optimization", IJRR 2015 (window); Huang, Mourikis, Roumeliotis, "Observability-based rules for
// consistent EKF SLAM", IJRR 2010 (first estimates); Usenko et al., "Visual-Inertial Mapping with
// Non-Linear Factor Recovery", RA-L 2020 (what leaves when); Rosinol, Sattler, Pollefeys, Carlone,
// "Incremental Visual-Inertial 3D Mesh Generation with Structural Regularities", ICRA 2019 (planes).

#include <Eigen/Core>
#include <array>
#include <optional>

#include "estimator/camera/rig.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/track_noise.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/marginalization.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/pixel_noise.hpp"
#include "estimator/smoother/track_correlation.hpp"
#include "estimator/smoother/window_covariance.hpp"
#include "estimator/smoother/window_problem.hpp"
#include "estimator/smoother/window_solver.hpp"

namespace swiftlet {

struct SmootherSettings {
  double pixel_sigma = kTrackPixelSigma;  ///< px, to begin with: found in flight (pixel_noise.hpp)
  double horizon = 30.0;                  ///< s
  int max_recent = 4;                     ///< newest frames, keyframe or not, that stay whole
  int max_motion_keyframes = 5;           ///< keyframes behind them that keep velocity and biases
  int max_keyframes = 12;                 ///< these and the pose-only ones; with max_recent below kMaxStates
  bool estimate_time_offset = false;      ///< camera to IMU clock
  bool estimate_extrinsics = false;       ///< T_body_cam of each camera
  bool estimate_gyro = false;             ///< scale and misalignment of the gyro
};

/// A plane of the window.
struct PlaneEstimate {
  Plane plane;
  /// Of the last solve, in the plane's three columns; zero for a plane that has not been solved for.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int points = 0;  ///< tied to it
};

class Smoother {
 public:
  Smoother(const Rig& rig, const ImuNoise& noise, const SmootherSettings& settings);

  /// Forgets all states and landmarks; samples and the estimated calibration stay.
  void reset();
  [[nodiscard]] bool started() const { return !problem_.window.empty(); }

  /// One IMU sample, in order of stamps; those before a frame come before it.
  void addImu(const ImuSample& sample) { problem_.imu.push(sample); }
  /// After reset(): the samples to come have earlier stamps.
  void forgetImu() { problem_.imu.clear(); }

  /// The first state; its frame is the first that `step` gets.
  void start(const StartState& start) { start_ = start; }

  struct StepInput {
    const TrackedFrame* frame = nullptr;
    bool imu_gap = false;    ///< samples are missing since the previous frame
    std::uint32_t rest = 0;  ///< number of the rest at the frame (RestState); 0: in motion
    /// Where they are estimated, the gyro's intrinsics move with this step; else they are held.
    bool move_gyro = true;
    int iterations = 2;  ///< at most
    /// m, rad: a step in which no pose moves further is the last. It has changed Jacobians and robust weights
    /// by less than the noise shows, and the rest of a state enters linearly.
    double pose_tolerance = 1e-3;
    /// Of the frame's features, taken at most: those with the smallest ids, known for longest; at least 1.
    int max_features = static_cast<int>(kMaxFeatures);
    /// That the window keeps, between 1 and the settings'; further down it comes by two a step.
    int max_keyframes = static_cast<int>(kMaxStates);
  };

  /// Adds a frame and solves: afterwards the newest state, its covariance, the statistics and `window()`
  /// stand. The window is one frame longer then, and `trim` must follow before the next step.
  /// kNotReady without a start state; kInvalidInput, with nothing changed, when the window has not been
  /// trimmed; kFailed when the system cannot be solved: reset. Only after kOk is there something to trim.
  Status step(const StepInput& input);

  /// What leaves the window after a step: frames between keyframes, and old keyframes into the prior.
  /// `left_window` is overwritten with the keyframes that left. Changes no value of the states that stay.
  /// From here on `window()` is without what left.
  void trim(FixedVector<KeyframeState, kMaxStates>& left_window);

  /// Values and links of all states, in order of time.
  [[nodiscard]] const Window& states() const { return problem_.window; }
  /// After a trim: of these, the first so many are keyframes that stay.
  [[nodiscard]] std::size_t settled() const {
    const auto recent = static_cast<std::size_t>(settings_.max_recent);
    return problem_.window.size() > recent ? problem_.window.size() - recent : 0;
  }

  /// Not before the first step.
  [[nodiscard]] const WindowState& newest() const { return problem_.window.newest(); }
  [[nodiscard]] const FrameStatistics& statistics() const { return statistics_; }
  /// px, of the next frame's sightings; kept by reset().
  [[nodiscard]] double pixelSigma() const { return pixel_noise_.sigma(); }
  /// Marginal covariance of the newest state, error-state order.
  [[nodiscard]] const Matrix15d& covariance() const { return covariance_.newest(); }
  /// The verdict on the newest frame, to be recorded with it.
  void setHealth(Health health) {
    if (started()) problem_.window.newest().health = health;
  }
  /// As given, or as estimated, with sigmas. Cost with an estimate: up to 13 triangular solves.
  [[nodiscard]] CalibrationEstimate calibration();
  /// t_imu = t_image + offset: the calibration's, or its estimate.
  [[nodiscard]] Duration timeOffset() const {
    return Duration::fromSeconds(problem_.calibration.timeOffset());
  }

  /// Covariance of the motion between two poses of the window, T_i_j = T_world_i^-1 T_world_j, in j's error
  /// state (phi, p of T_i_j, rotation on the right), from their joint marginal. Positions as in
  /// `window()`. False for a state that has left since the solve. Cost: 12 triangular solves.
  [[nodiscard]] bool relativeCovariance(std::size_t i, std::size_t j,
                                        Eigen::Matrix<double, 6, 6>& covariance) {
    return covariance_.relative(problem_.window[i], problem_.window[j], covariance);
  }

  /// Poses in order of time, and the landmarks of the last solve that are not at infinity.
  void window(SmoothedWindow& out) const;

  // Extra states: after a step's trim, before the next step. All of it is forgotten by reset().

  /// Gives a landmark columns of its own, from its triangulated position on, until no frame sees it any more.
  /// Refused: kInvalidInput without such a landmark, kNotReady when it took no part in the last solve,
  /// kDegenerate at infinity or when its depth is known to less than 10 % (1 sigma), kCapacityReached with
  /// kMaxExplicitLandmarks. One that is promoted already stays so: ok.
  Status promote(TrackId id) { return problem_.extras.promote(id); }
  [[nodiscard]] bool promoted(TrackId id) const { return problem_.extras.promoted(id); }

  /// A new plane, without any information: `plane` is where to start from. Its factors count from the step on
  /// at which they determine its normal (extra_table.hpp). It leaves with the next step unless a point is
  /// tied to it by then, and later when the last point tied to it has left. None when kMaxPlanes are held.
  std::optional<PlaneId> addPlane(const Plane& plane) { return problem_.extras.addPlane(plane); }
  /// Ties a promoted landmark to a plane, `sigma` m. Refused: kInvalidInput without such a landmark or plane,
  /// or when they are tied already; kCapacityReached with kMaxExtraFactors.
  Status addPointOnPlane(TrackId id, PlaneId plane, double sigma) {
    return problem_.extras.addPointOnPlane(id, plane, sigma);
  }
  /// `sigma` rad. Replaces the direction that it has. Refused as above.
  Status addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma) {
    return problem_.extras.addPlaneDirection(plane, direction, sigma);
  }
  /// Unties; what left into the prior with frames of the past stays there. No effect without such a tie.
  void removePointOnPlane(TrackId id, PlaneId plane) { problem_.extras.removePointOnPlane(id, plane); }
  /// Forgets a plane with its factors; what the prior knows through it stays.
  void removePlane(PlaneId plane);
  /// Cost: three triangular solves.
  [[nodiscard]] std::optional<PlaneEstimate> plane(PlaneId plane);
  [[nodiscard]] std::size_t explicitLandmarks() const { return problem_.extras.count(ExtraKind::kLandmark); }
  [[nodiscard]] std::size_t planes() const { return problem_.extras.count(ExtraKind::kPlane); }

  /// The keyframes still in the window, oldest first.
  void flush(FixedVector<KeyframeState, kMaxStates>& left_window);

 private:
  void addState(const StepInput& input);
  void linkState(WindowState& state, const WindowState& previous, bool gap) const;
  [[nodiscard]] TrackId newestIdTaken(const TrackedFrame& frame, int max_features);
  void addSightings(const TrackedFrame& frame, int max_features);
  void updateStatistics();
  void updateTrackCorrelation();

  SmootherSettings settings_;
  PixelNoise pixel_noise_;
  TrackCorrelation track_correlation_;
  WindowProblem problem_;
  NormalEquations system_;
  WindowSolver solver_;
  WindowCovariance covariance_;
  Marginalization marginalization_;
  std::optional<StartState> start_;
  bool trim_due_ = false;
  int max_keyframes_ = 0;                     // of the last step
  FixedVector<TrackId, kMaxFeatures> taken_;  // scratch of newestIdTaken()
  FrameStatistics statistics_;
};

}  // namespace swiftlet
