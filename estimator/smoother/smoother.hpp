#pragma once
// Fixed-lag smoother: Gauss-Newton over a sliding window of body states.
//
// Window, in order of time: pose-only keyframes; keyframes with velocity and biases; the newest
// frames. A frame that is no keyframe leaves by merging its two IMU intervals (nothing is
// linearized for good); an old keyframe first loses velocity and biases, then its pose, both into
// the prior, the latter with the landmarks that it saw and no recent frame sees. Landmarks are structureless
// until they are promoted to columns of their own; planes are further columns (extra_states.hpp). States that
// the prior touches keep their first estimate as linearization point, moved with the window (moveEstimates).
// Frames: world (z up, origin and yaw of the first state), body (= IMU), cameras. SI units, pixels.
// Memory: 15.6 MiB, all reserved by the constructor (table in docs/smoother.md); nothing is allocated
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
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/extra_factors.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/prior.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

struct SmootherSettings {
  double pixel_sigma = 0.6;           ///< px
  double horizon = 30.0;              ///< s
  int max_recent = 4;                 ///< newest frames, keyframe or not, that stay whole
  int max_motion_keyframes = 5;       ///< keyframes behind them that keep velocity and biases
  int max_keyframes = 12;             ///< these and the pose-only ones; with max_recent below kMaxStates
  bool estimate_time_offset = false;  ///< camera to IMU clock
  bool estimate_extrinsics = false;   ///< T_body_cam of each camera
};

/// Everything that is tied to planes: each explicit landmark to two, each plane with a direction.
inline constexpr std::size_t kMaxExtraFactors = 2 * kMaxExplicitLandmarks + kMaxPlanes;

/// A plane of the window.
struct PlaneEstimate {
  Plane plane;
  /// Of the last solve, in the plane's three columns; zero for a plane that has not been solved for.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int points = 0;  ///< tied to it
};

/// What the first state of an epoch is known to be. Its position and yaw define the world.
struct StartState {
  Stamp stamp;  ///< on the IMU's clock
  BodyState state;
  double tilt_sigma = 0.05;        ///< rad
  double velocity_sigma = 1.0;     ///< m/s
  double gyro_bias_sigma = 0.1;    ///< rad/s
  double accel_bias_sigma = 0.15;  ///< m/s^2
};

class Smoother {
 public:
  Smoother(const Rig& rig, const ImuNoise& noise, const SmootherSettings& settings);

  /// Forgets all states and landmarks; samples and the estimated calibration stay.
  void reset();
  [[nodiscard]] bool started() const { return !order_.empty(); }

  /// One IMU sample, in order of stamps; those before a frame come before it.
  void addImu(const ImuSample& sample) { imu_.push(sample); }
  /// After reset(): the samples to come have earlier stamps.
  void forgetImu() { imu_.clear(); }

  /// The first state; its frame is the first that `step` gets.
  void start(const StartState& start) {
    start_ = start;
    has_start_ = true;
  }

  struct StepInput {
    const TrackedFrame* frame = nullptr;
    bool imu_gap = false;  ///< samples are missing since the previous frame
    bool at_rest = false;
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

  /// Not before the first step.
  [[nodiscard]] const WindowState& newest() const { return states_[order_.back()]; }
  [[nodiscard]] const FrameStatistics& statistics() const { return statistics_; }
  /// Marginal covariance of the newest state, error-state order.
  [[nodiscard]] const Matrix15d& covariance() const { return covariance_; }
  /// The verdict on the newest frame, to be recorded with it.
  void setHealth(Health health) {
    if (started()) states_[order_.back()].health = health;
  }
  /// t_imu = t_image + offset: the calibration's, or its estimate.
  [[nodiscard]] Duration timeOffset() const { return Duration::fromSeconds(time_offset_); }
  /// T_body_cam: the calibration's, or its estimate.
  [[nodiscard]] const std::array<SE3, kMaxCameras>& extrinsics() const { return T_body_cam_; }

  /// Covariance of the motion between two poses of the window, T_i_j = T_world_i^-1 T_world_j, in j's error
  /// state (phi, p of T_i_j, rotation on the right), from their joint marginal. Positions as in
  /// `window()`. False for a state that has left since the solve. Cost: 12 triangular solves.
  [[nodiscard]] bool relativeCovariance(std::size_t i, std::size_t j,
                                        Eigen::Matrix<double, 6, 6>& covariance);

  /// Poses in order of time, and the landmarks of the last solve that are not at infinity.
  void window(SmoothedWindow& out) const;

  // Extra states: after a step's trim, before the next step. All of it is forgotten by reset().

  /// Gives a landmark columns of its own, from its triangulated position on, until no frame sees it any more.
  /// Refused: kInvalidInput without such a landmark, kNotReady when it took no part in the last solve,
  /// kDegenerate at infinity or when its depth is known to less than 10 % (1 sigma), kCapacityReached with
  /// kMaxExplicitLandmarks. One that is promoted already stays so: ok.
  Status promote(TrackId id);
  [[nodiscard]] bool promoted(TrackId id) const;

  /// A new plane, without any information: `plane` is where to start from. Its factors count from the step on
  /// at which they determine its normal (settlePlanes). It leaves with the next step unless a point is tied
  /// to it by then, and later when the last point tied to it has left. None when kMaxPlanes are held.
  std::optional<PlaneId> addPlane(const Plane& plane);
  /// Ties a promoted landmark to a plane, `sigma` m. Refused: kInvalidInput without such a landmark or plane,
  /// or when they are tied already; kCapacityReached with kMaxExtraFactors.
  Status addPointOnPlane(TrackId id, PlaneId plane, double sigma);
  /// `sigma` rad. Replaces the direction that it has. Refused as above.
  Status addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma);
  /// Unties; what left into the prior with frames of the past stays there. No effect without such a tie.
  void removePointOnPlane(TrackId id, PlaneId plane);
  /// Forgets a plane with its factors; what the prior knows through it stays.
  void removePlane(PlaneId plane);
  /// Cost: three triangular solves.
  [[nodiscard]] std::optional<PlaneEstimate> plane(PlaneId plane);
  [[nodiscard]] std::size_t explicitLandmarks() const;
  [[nodiscard]] std::size_t planes() const;

  /// The keyframes still in the window, oldest first.
  void flush(FixedVector<KeyframeState, kMaxStates>& left_window);

 private:
  static constexpr std::uint8_t kNoSlot = 255;

  std::uint8_t addState(const StepInput& input);
  [[nodiscard]] TrackId newestIdTaken(const TrackedFrame& frame, int max_features);
  void linkState(WindowState& state, const WindowState& previous, bool gap);
  void integrateLink(WindowState& state, const WindowState& previous);
  void addSightings(std::uint8_t slot, const TrackedFrame& frame, int max_features);
  Landmark* findLandmark(TrackId id);
  Landmark* newLandmark(TrackId id);
  void removeLandmark(Landmark& landmark);
  void discardLandmark(Landmark& landmark);

  Status solve(int iterations, double pose_tolerance);
  void assignOffsets();
  void restore();
  void backup();
  void moveEstimates();
  void placeCameras();
  void buildSystem();
  void addPrior();
  void addMotionFactor(std::size_t position);
  void addRestFactor(const WindowState& i, const WindowState& j);
  void triangulateAll(int iterations);
  [[nodiscard]] LandmarkViews viewsOf(std::span<const Sighting> sightings) const;
  void substitutePoints(const VectorMap& step);
  void startPrior();
  [[nodiscard]] Eigen::Matrix<double, kMaxCalibrationDim, 1> calibrationDeviation() const;
  void applyStep(const Eigen::Ref<const Eigen::VectorXd>& step);
  void rejectOutliers(double threshold, bool newest_only);
  void updateStatistics();

  void dropFrame(std::size_t position);
  void dropMotion(std::size_t position);
  void dropKeyframe(std::size_t position);
  [[nodiscard]] std::size_t chooseKeyframeToDrop(std::size_t candidates) const;
  void removeState(std::size_t position);
  void removeSightingsOf(std::uint8_t slot);
  void freeze(std::uint8_t slot);
  /// What goes into the prior at a time: columns [first, first + count) of the state at `position`, and the
  /// extra states marked as leaving.
  struct Departure {
    std::size_t position = 0;
    int first = 0;
    int count = 0;                    ///< zero: extra states alone
    bool with_motion_factor = false;  ///< to the next state
    bool with_landmarks = false;      ///< that no recent frame sees, and its sightings of explicit ones
  };
  void marginalize(const Departure& departure);
  void buildMarginalSystem(const Departure& departure);
  void expandAtReferences();
  void eliminateDeparture(const Departure& departure);
  [[nodiscard]] int offsetOf(std::uint8_t slot) const;
  [[nodiscard]] bool leavesWith(const Landmark& landmark, std::uint8_t slot) const;

  ExtraState* findExtra(ExtraKind kind, std::size_t first, std::size_t last);
  ExtraState* findPlane(PlaneId id);
  [[nodiscard]] std::uint8_t indexOf(const ExtraState& extra) const;
  void syncLandmark(const ExtraState& extra);
  void linearizeFactor(const ExtraFactor& factor, LinearFactor& linear) const;
  void addSightingsOf(const ExtraState& extra, std::uint8_t slot);
  void settlePlanes();
  double linearizePlane(const ExtraState& plane, Eigen::Matrix3d& H, Eigen::Vector3d& g) const;
  [[nodiscard]] bool counts(const ExtraFactor& factor) const { return extras_[factor.plane].settled; }
  void addExtras();
  void finishExtras();
  void retractExtras(const Eigen::Ref<const Eigen::VectorXd>& step);
  void restoreExtras();
  void markDepartures(std::uint8_t slot);
  void markBarePlanes();
  [[nodiscard]] bool departs(const ExtraFactor& factor) const;
  void involveExtras(std::uint8_t slot);
  void addDepartingFactors(std::uint8_t slot);
  void dropFactorsOf(std::uint8_t extra);
  void freeExtra(ExtraState& extra);
  void releaseExtras();

  void keepFactor();
  /// Columns of L^-1 that give marginals: covariance(a, b) = Y_a^T Y_b.
  void solveFactorColumns(int offset, int count, std::vector<double>& columns);
  [[nodiscard]] KeyframeState record(const WindowState& state);
  [[nodiscard]] std::size_t motionBegin() const;

  Rig rig_;
  ImuNoise noise_;
  SmootherSettings settings_;
  ImuBuffer imu_;
  StartState start_;
  bool has_start_ = false;
  std::uint64_t newest_frame_ = 0;
  bool trim_due_ = false;
  int max_keyframes_ = 0;                     // of the last step
  FixedVector<TrackId, kMaxFeatures> taken_;  // scratch of newestIdTaken()

  std::array<WindowState, kMaxStates> states_;
  FixedVector<std::uint8_t, kMaxStates> order_;  // slots in order of time
  std::vector<Landmark> landmarks_;
  std::vector<TrackId> landmark_ids_;    // of landmarks_, 0 where free: searched far more often than read
  std::vector<std::uint8_t> in_system_;  // landmark takes part in this solve
  std::vector<EliminatedPoint> eliminated_;
  Prior prior_;
  NormalEquations system_;
  std::array<RigPose, kMaxStates> rig_poses_;
  std::vector<double> step_;
  std::vector<double> factor_;  // L of the last solve
  std::vector<double> columns_i_;
  std::vector<double> columns_j_;
  int factor_dimension_ = 0;
  std::vector<std::uint8_t> involved_;  // slots touched by a marginalization, extra ones behind the others
  int dimension_ = 0;
  double prior_cost_ = 0;  // of the last addPrior(), without its constant
  std::uint64_t oldest_recent_frame_ = 0;
  std::array<BodyState, kMaxStates> backup_;

  std::array<ExtraState, kMaxExtraStates> extras_;  // landmarks, then planes
  FixedVector<ExtraFactor, kMaxExtraFactors> extra_factors_;
  int extra_columns_ = 0;  // of the system, behind the calibration's
  PlaneId next_plane_ = 1;

  CalibrationLayout calibration_;
  double time_offset_ = 0;  // s, t_imu = t_image + offset
  double time_offset_backup_ = 0;
  std::array<SE3, kMaxCameras> T_body_cam_;
  std::array<SE3, kMaxCameras> T_body_cam_backup_;
  std::array<SE3, kMaxCameras> T_body_cam_reference_;
  double time_offset_reference_ = 0;

  Matrix15d covariance_ = Matrix15d::Zero();
  FrameStatistics statistics_;
};

}  // namespace swiftlet
