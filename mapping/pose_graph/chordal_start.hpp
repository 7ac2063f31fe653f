#pragma once
// Poses from relative poses without an initial guess: two linear least squares problems.
//
// Rotations minimize sum kappa |R_to - R_from R_from_to|_F^2 over all 3 x 3 (2 x 2 conformal) matrices with
// held poses given; then the nearest rotation of each is taken. Positions minimize g2o's cost, which is
// quadratic in them for given rotations, with the full information matrices. Frames and held poses are those
// of the graph; poses that are not held are overwritten. Each edge counts with its weight (0: left out).
// Cost: two factorizations of half the optimizer's size. Sources: Carlone, Tron, Daniilidis, Dellaert,
// "Initialization techniques for 3D SLAM", ICRA 2015, III-B; Martinec and Pajdla, "Robust rotation and
// translation estimation in multiview reconstruction", CVPR 2007.

#include <span>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/block_cholesky.hpp"
#include "mapping/pose_graph/graph_layout.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

template <typename Pose>
class ChordalStart {
 public:
  /// kNumerical if a system cannot be factored; `poses` are then unchanged.
  Status run(std::span<const RelativePose<Pose>> edges, std::span<const double> weights,
             const GraphLayout& layout, std::vector<Pose>& poses);

 private:
  static constexpr int kSpace = PoseSpace<Pose>::kDof - PoseSpace<Pose>::kRotationDof;  // 2 or 3

  bool solveRotations(std::span<const RelativePose<Pose>> edges, std::span<const double> weights,
                      const GraphLayout& layout, std::vector<Pose>& poses);
  bool solvePositions(std::span<const RelativePose<Pose>> edges, std::span<const double> weights,
                      const GraphLayout& layout, std::vector<Pose>& poses);

  BlockMatrix<kSpace> matrix_;
  BlockCholesky<kSpace> factor_;
  Eigen::MatrixXd solution_;
};

}  // namespace swiftlet
