#pragma once
// Linearizes a landmark at the states that see it and eliminates its point. Used for the fixed lag, full
// smoothing and landmarks on planes. The start with one camera (mono_start.cpp) has its own code.
//
// For state i with Jacobians J_i (pose), P_i (point) and K_i (calibration) of all its views, whitened and
// weighted, and residuals r_i:
//   A_i = J_i^T J_i,  B_i = J_i^T P_i,  a_i = J_i^T r_i,  c = sum P_i^T r_i,  C = sum P_i^T P_i + prior = L
//   L^T;   with calibration K = sum K_i^T K_i,  B_k = sum K_i^T P_i,  a_k = sum K_i^T r_i,  A_ik = J_i^T K_i.
// Eliminating the point leaves, with Y = B L^-T and z = L^-1 c,
//   A_i - Y_i Y_i^T at state i,  -Y_i Y_j^T between states,  a_i - Y_i z in the gradient,
// and the same with k instead of i. The owner of the pair blocks computes the pairs (PairProduct). The point
// is a bearing with inverse depth (landmark.hpp) or, for an explicit landmark, a position. Residuals and
// robust weights are computed at the current poses, Jacobians at RigPose::linearization. Frames and
// Jacobians: vision_factor.hpp. Four states are processed at a time, in vector lanes (view_lanes.hpp); the
// scalar version is in tests/smoother/scalar_landmark.hpp. Memory: 1.1 kB per observation (2.4 kB with
// calibration), reserved by the constructor. Cost: linear in the views. Source: Triggs et al., "Bundle
// Adjustment - A Modern Synthesis", 1999, section 6.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/eliminated_point.hpp"
#include "estimator/smoother/padded_block.hpp"
#include "estimator/smoother/view_lanes.hpp"

namespace swiftlet {

static_assert(kPaddedRows == 2 * lanes::kLanes);

class LandmarkBlock {
 public:
  using CalibrationVector = Eigen::Matrix<double, kMaxCalibrationDim, 1>;
  using CalibrationMatrix = Eigen::Matrix<double, kMaxCalibrationDim, kMaxCalibrationDim>;
  using CalibrationPoint = Eigen::Matrix<double, kMaxCalibrationDim, 3>;
  using PoseCalibration = Eigen::Matrix<double, kPoseDim, kMaxCalibrationDim>;

  /// A state that observed the landmark, in the order of the observations: A, B, a, or their values after
  /// elimination.
  struct State {
    std::uint32_t slot = 0;
    PaddedBlock information;                        ///< lower triangle
    alignas(32) double point[3][kPaddedRows] = {};  ///< B or Y, by columns
    alignas(32) double gradient[kPaddedRows] = {};
  };
  /// Calibration: K, B_k, a_k, or their values after elimination. Columns as in the layout.
  struct Calibration {
    CalibrationMatrix information = CalibrationMatrix::Zero();
    CalibrationPoint point = CalibrationPoint::Zero();
    CalibrationVector gradient = CalibrationVector::Zero();
  };

  /// `max_sightings`: more observations allocate memory.
  explicit LandmarkBlock(std::size_t max_sightings);

  /// Linearizes a landmark without its own columns.
  void linearize(const LandmarkViews& views, const LandmarkPoint& point);
  /// Linearizes an explicit landmark with respect to its position (world, m).
  void linearize(const LandmarkViews& views, const Eigen::Vector3d& position);

  /// Call after linearize(). False if fewer than two states have the point in front of a camera or its
  /// information is singular; then nothing must be added.
  [[nodiscard]] bool eliminate();
  /// Call instead of eliminate() for an explicit landmark.
  void keepPoint();

  [[nodiscard]] std::span<const State> states() const { return {states_.data(), states_.size()}; }
  [[nodiscard]] int calibrationDimension() const { return layout_.dimension(); }
  [[nodiscard]] const Calibration& calibration() const { return calibration_; }
  /// A_ik of states()[k].
  [[nodiscard]] const PoseCalibration& cross(std::size_t k) const { return cross_[k]; }
  [[nodiscard]] double cost() const { return sums_.cost(); }
  /// After eliminate(): L and z.
  [[nodiscard]] const PointFactor& factor() const { return L_; }
  [[nodiscard]] const Eigen::Vector3d& z() const { return z_; }
  /// After linearize(): C without its prior, and c.
  [[nodiscard]] Eigen::Matrix3d pointInformation() const { return sums_.H(); }
  [[nodiscard]] Eigen::Vector3d pointGradient() const { return sums_.g(); }

 private:
  struct Camera {
    Eigen::Matrix3d R_body_cam;
    Eigen::Vector3d center;  // body
  };
  /// The point and the meaning of its three columns.
  struct At {
    LandmarkPoint point;
    PointBasis basis;
    bool position = false;
  };
  /// Blocks of four states.
  struct PoseGroup {
    lanes::V information[kPoseDim * (kPoseDim + 1) / 2]{};  // lower triangle by columns
    lanes::V point[kPoseDim][3]{};
    lanes::V gradient[kPoseDim]{};
    lanes::Mask valid{};  // in front of a camera of this state
  };
  /// Blocks of four states and one camera.
  using CrossGroup = std::array<std::array<lanes::V, kViewCalibrationDim>, kPoseDim>;
  /// Blocks of one camera.
  struct CalibrationSums {
    lanes::V information[kViewCalibrationDim][kViewCalibrationDim]{};  // lower triangle by columns
    lanes::V point[kViewCalibrationDim][3]{};
    lanes::V gradient[kViewCalibrationDim]{};
  };
  /// One row of four views: unweighted Jacobian and residual, and the weight.
  struct Row {
    lanes::V pose[kPoseDim];
    lanes::V point[3];
    lanes::V residual;
    lanes::V weight;
  };

  void linearizeAll(const LandmarkViews& views, const At& at);
  void addViews(std::size_t c, const Camera& camera, std::span<const Sighting> four, RigPoses poses,
                const At& at, std::size_t group);
  void addRows(std::size_t c, const Camera& camera, const lanes::ViewGroup& views,
               const lanes::Residuals& now, const lanes::Residuals& linearization, const At& at,
               std::size_t group);
  void addCalibration(std::size_t c, const Camera& camera, const lanes::Residuals& at, double inverse_depth,
                      const lanes::V (&G)[3], const Row& row, std::size_t group);
  void eliminateCalibration();
  void gatherCalibration();
  void writeStates();

  CalibrationLayout layout_;
  lanes::PointSums sums_;
  int valid_states_ = 0;
  PointFactor L_{};
  Eigen::Vector3d z_ = Eigen::Vector3d::Zero();
  std::span<const Sighting> sightings_;
  std::vector<PoseGroup> groups_;
  std::vector<State> states_;
  std::vector<std::array<CrossGroup, kMaxCameras>> cross_groups_;
  std::array<CalibrationSums, kMaxCameras> calibration_sums_;
  lanes::V rates_[6];  // angular rate (body) and velocity (world) of the current four states
  lanes::V rows_{};    // of the current views (CameraSighting::row)
  Calibration calibration_;
  std::vector<PoseCalibration> cross_;
};

/// -Y_i Y_j^T for one state i and others; the columns of i stay in registers.
class PairProduct {
 public:
  explicit PairProduct(const LandmarkBlock::State& i) {
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      lanes::load(i.point[k], upper_[k]);
      lanes::load(i.point[k] + lanes::kLanes, lower_[k]);
    }
  }
  /// Rows of i, columns of j.
  void subtract(const LandmarkBlock::State& j, PaddedBlock& target) const {
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < kPoseDim; ++k) {
      const double y0 = j.point[0][k];
      const double y1 = j.point[1][k];
      const double y2 = j.point[2][k];
      lanes::V upper, lower;
      lanes::load(target.column[k], upper);
      lanes::load(target.column[k] + lanes::kLanes, lower);
      upper -= y0 * upper_[0] + y1 * upper_[1] + y2 * upper_[2];
      lower -= y0 * lower_[0] + y1 * lower_[1] + y2 * lower_[2];
      lanes::store(upper, target.column[k]);
      lanes::store(lower, target.column[k] + lanes::kLanes);
    }
  }

 private:
  lanes::V upper_[3];
  lanes::V lower_[3];
};

}  // namespace swiftlet
