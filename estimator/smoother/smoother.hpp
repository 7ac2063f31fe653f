#pragma once
// Fixed-lag smoother: Gauss-Newton over a sliding window of body states.
//
// Window, in order of time: pose-only keyframes; keyframes with velocity and biases; the newest frames. A
// frame that is not a keyframe leaves by merging its two IMU intervals, without a permanent linearization. An
// old keyframe first loses velocity and biases, then its pose, both into the prior; with the pose leave the
// landmarks that it saw and no recent frame sees. Landmarks are structureless until they are promoted to
// their own columns; planes are further columns (extra_states.hpp).
//
// Data: window, landmark_table, extra_table, calibration_state, prior (together: window_problem). Operations:
// window_factors, window_solver, window_covariance, window_trim, marginalization. Frames: world (z up, origin
// and yaw of the first state), body (= IMU), cameras. SI units, pixels. Memory: 16.6 MiB, reserved by the
// constructor; no allocation afterwards. When full, the landmark not seen for longest and the oldest IMU
// samples are dropped. Cost: linear in landmarks, cubic in the dimension of the window (at most 192 columns
// by default, and 3 for each explicit landmark and plane).
//
// Sources: Leutenegger et al., "Keyframe-based visual-inertial odometry using nonlinear optimization", IJRR
// 2015 (window); Usenko et al., "Visual-Inertial Mapping with Non-Linear Factor Recovery", RA-L 2020 (what
// leaves when); Rosinol, Sattler, Pollefeys, Carlone, "Incremental Visual-Inertial 3D Mesh Generation with
// Structural Regularities", ICRA 2019 (planes).

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
  double pixel_sigma = kTrackPixelSigma;  ///< px, initial value; estimated in flight (pixel_noise.hpp)
  double horizon = 30.0;                  ///< s
  int max_recent = 4;                     ///< newest frames, keyframes or not, that keep all variables
  int max_motion_keyframes = 5;           ///< keyframes before these that keep velocity and biases
  int max_keyframes = 12;             ///< including pose-only ones; max_keyframes + max_recent < kMaxStates
  bool estimate_time_offset = false;  ///< camera to IMU clock
  bool estimate_extrinsics = false;   ///< T_body_cam of each camera
  bool estimate_gyro = false;         ///< scale and misalignment of the gyro
};

/// A plane of the window.
struct PlaneEstimate {
  Plane plane;
  /// Covariance of the last solve, in the plane's three columns; zero if the plane was not in a solve.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int points = 0;  ///< number of tied landmarks
};

class Smoother {
 public:
  Smoother(const Rig& rig, const ImuNoise& noise, const SmootherSettings& settings);

  /// Forgets all states and landmarks; keeps samples and the estimated calibration.
  void reset();
  [[nodiscard]] bool started() const { return !problem_.window.empty(); }

  /// Adds an IMU sample, in order of stamps. Add the samples before a frame before that frame.
  void addImu(const ImuSample& sample) { problem_.imu.push(sample); }
  /// Sets the noise for samples that are integrated from now on.
  void setNoise(const ImuNoise& noise) { problem_.noise = noise; }
  /// Call after reset() if the following samples have earlier stamps.
  void forgetImu() { problem_.imu.clear(); }

  /// Sets the first state, which belongs to the first frame given to `step`.
  void start(const StartState& start) { start_ = start; }

  struct StepInput {
    const TrackedFrame* frame = nullptr;
    bool imu_gap = false;    ///< samples are missing since the previous frame
    std::uint32_t rest = 0;  ///< number of the rest at the frame (RestState); 0: in motion
    /// False: the gyro's intrinsics are held in this step.
    bool estimate_gyro = true;
    int iterations = 2;  ///< largest number of iterations
    /// m, rad: stops after a step in which no pose moves by more than this. Jacobians and robust weights then
    /// change by less than the noise, and the other parts of a state are linear.
    double pose_tolerance = 1e-3;
    /// Largest number of the frame's features to use, at least 1: those with the smallest ids, which have
    /// been tracked for longest.
    int max_features = static_cast<int>(kMaxFeatures);
    /// Number of keyframes that the window keeps, between 1 and the setting; the window shrinks by at most
    /// two per step.
    int max_keyframes = static_cast<int>(kMaxStates);
  };

  /// Adds a frame and solves. The newest state, its covariance, the statistics and `window()` are then valid.
  /// The window is one frame longer, and `trim` must follow before the next step. kNotReady without a start
  /// state; kInvalidInput, without effect, if the window has not been trimmed; kFailed if the system cannot
  /// be solved: call reset(). Trim only after kOk.
  Status step(const StepInput& input);

  /// Removes states from the window after a step: frames between keyframes, and old keyframes, which go into
  /// the prior. Overwrites `left_window` with the keyframes that left. The values of the remaining states do
  /// not change; `window()` is then without the states that left.
  void trim(FixedVector<KeyframeState, kMaxStates>& left_window);

  /// Values and links of all states, in order of time.
  [[nodiscard]] const Window& states() const { return problem_.window; }
  /// After a trim: the number of keyframes that stay; they are the first of these states.
  [[nodiscard]] std::size_t settled() const {
    const auto recent = static_cast<std::size_t>(settings_.max_recent);
    return problem_.window.size() > recent ? problem_.window.size() - recent : 0;
  }

  /// The newest state; valid after the first step.
  [[nodiscard]] const WindowState& newest() const { return problem_.window.newest(); }
  [[nodiscard]] const FrameStatistics& statistics() const { return statistics_; }
  /// px, noise of the next frame's observations; kept by reset().
  [[nodiscard]] double pixelSigma() const { return pixel_noise_.sigma(); }
  /// Marginal covariance of the newest state, error-state order.
  [[nodiscard]] const Matrix15d& covariance() const { return covariance_.newest(); }
  /// Sets the health of the newest frame, which is recorded with it.
  void setHealth(Health health) {
    if (started()) problem_.window.newest().health = health;
  }
  /// The calibration, given or estimated, with sigmas. Cost with an estimate: up to 13 triangular solves.
  [[nodiscard]] CalibrationEstimate calibration();
  /// Time offset in t_imu = t_image + offset: from the calibration, or estimated.
  [[nodiscard]] Duration timeOffset() const {
    return Duration::fromSeconds(problem_.calibration.timeOffset());
  }

  /// Covariance of the motion between two poses of the window, T_i_j = T_world_i^-1 T_world_j, in j's error
  /// state (phi, p of T_i_j, rotation on the right), from their joint marginal. Indices as in `window()`.
  /// False for a state that left since the solve. Cost: 12 triangular solves.
  [[nodiscard]] bool relativeCovariance(std::size_t i, std::size_t j,
                                        Eigen::Matrix<double, 6, 6>& covariance) {
    return covariance_.relative(problem_.window[i], problem_.window[j], covariance);
  }

  /// Poses in order of time, and the landmarks of the last solve that are not at infinity.
  void window(SmoothedWindow& out) const;

  // Extra states: call after a step's trim and before the next step. reset() removes them all.

  /// Promotes a landmark to its own columns, starting at its triangulated position, until no frame sees it.
  /// Refused: kInvalidInput without such a landmark, kNotReady if it was not in the last solve, kDegenerate
  /// at infinity or if its depth is uncertain by more than 10 % (1 sigma), kCapacityReached with
  /// kMaxExplicitLandmarks. Ok if it is already promoted.
  Status promote(TrackId id) { return problem_.extras.promote(id); }
  [[nodiscard]] bool promoted(TrackId id) const { return problem_.extras.promoted(id); }

  /// Adds a plane without information; `plane` is its initial value. Its factors are used from the step at
  /// which they determine its normal (extra_table.hpp). It leaves with the next step unless a point is tied
  /// to it by then, and later with the last tied point. Empty if kMaxPlanes are held.
  std::optional<PlaneId> addPlane(const Plane& plane) { return problem_.extras.addPlane(plane); }
  /// Ties a promoted landmark to a plane with `sigma` [m]. Refused: kInvalidInput without such a landmark or
  /// plane, or if they are already tied; kCapacityReached with kMaxExtraFactors.
  Status addPointOnPlane(TrackId id, PlaneId plane, double sigma) {
    return problem_.extras.addPointOnPlane(id, plane, sigma);
  }
  /// Sets or replaces the direction of a plane, with `sigma` [rad]. Refused as above.
  Status addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma) {
    return problem_.extras.addPlaneDirection(plane, direction, sigma);
  }
  /// Removes a tie; its part of the prior stays. No effect without such a tie.
  void removePointOnPlane(TrackId id, PlaneId plane) { problem_.extras.removePointOnPlane(id, plane); }
  /// Removes a plane with its factors; its part of the prior stays.
  void removePlane(PlaneId plane);
  /// The plane with its covariance; empty if there is none. Cost: three triangular solves.
  [[nodiscard]] std::optional<PlaneEstimate> plane(PlaneId plane);
  [[nodiscard]] std::size_t explicitLandmarks() const { return problem_.extras.count(ExtraKind::kLandmark); }
  [[nodiscard]] std::size_t planes() const { return problem_.extras.count(ExtraKind::kPlane); }

  /// Outputs the keyframes still in the window, oldest first.
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
