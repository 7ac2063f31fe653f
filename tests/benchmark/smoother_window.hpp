#pragma once
// A window of the fixed-lag smoother as it stands while a new frame is solved, rebuilt from a simulated
// flight out of the same public pieces, so that another solver can be given the very same cost:
//   10 keyframes (6 of them poses only), 4 recent frames and the new one; what the left-out velocities
//   and biases knew as a prior; preintegrated IMU factors; stereo sightings with Cauchy weights.
// Every linearization point is the current value (no frozen first estimates): the cost then has one
// gradient, and two solvers one solution.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/smoother/landmark.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/prior.hpp"
#include "estimator/smoother/state.hpp"
#include "tests/smoother/track_flight.hpp"

namespace swiftlet::test {

/// What an update changes.
struct WindowValues {
  std::vector<BodyState> states;  ///< in order of time
  std::vector<LandmarkPoint> points;
};

class BenchmarkWindow {
 public:
  /// The window whose new frame is `newest` of the flight; initial values off the truth as an update
  /// finds them.
  BenchmarkWindow(const TrackFlight& flight, std::size_t newest);

  /// One update as Smoother::solve does it, without its early stop: `iterations` Gauss-Newton steps and
  /// the points of the result. False when the system is singular.
  [[nodiscard]] bool update(int iterations);

  [[nodiscard]] WindowValues values() const;
  void setValues(const WindowValues& values);

  /// Robust cost at the current values, points included; the prior's completed to a square.
  [[nodiscard]] double cost();

  /// Deviation from the prior's references, stacked.
  [[nodiscard]] Eigen::VectorXd priorDeviation() const;

  Rig rig;
  ImuNoise noise;
  std::vector<std::uint8_t> order;  ///< slots in order of time
  std::array<WindowState, kMaxStates> states;
  std::vector<Landmark> landmarks;
  Prior prior;
  Eigen::MatrixXd prior_root;      ///< U, upper triangular, H = U^T U
  Eigen::VectorXd prior_residual;  ///< at the references: the prior's residual is U d + this

 private:
  void chooseStates(const TrackFlight& flight, std::size_t newest);
  void linkStates(const TrackFlight& flight);
  void addLandmarks(const TrackFlight& flight);
  void makePrior();
  void disturb(std::uint64_t seed);
  void placeCameras();
  [[nodiscard]] bool motionFactor(std::size_t position, MotionFactor& factor) const;
  void addPrior();

  NormalEquations system_;
  std::vector<EliminatedPoint> eliminated_;
  std::array<RigPose, kMaxStates> poses_;
  Eigen::VectorXd step_;
  int dimension_ = 0;
};

}  // namespace swiftlet::test
