#pragma once
// Flattens a mesh onto known planes: moves vertices towards their planes according to their noise,
//   p' = p - S n (n . p - d) / (n^T S n + surface_sigma^2),   S = depth_sigma^2 u u^T + lateral_sigma^2 I,
// with u the line of sight: the most likely position of a point that was seen in that direction and lies on
// that plane. Accurate vertices hardly move. Inaccurate ones move onto the plane along their line of sight,
// so that their position in the image stays. Landmarks that the smoother already tied to the plane hardly
// move. The plane is the smoother's if it has one (SmoothedWindow::planes), otherwise the mesher's. No
// allocation (40 kB on the stack). Cost: two sorts, and a search per vertex; 0.1 ms.

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet {

/// n . p = distance, world.
struct KnownPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double distance = 0;  ///< m
};
/// The smoother's plane, otherwise the mesher's; empty if neither has it.
std::optional<KnownPlane> knownPlane(std::uint64_t id, const PlaneReport& report,
                                     const SmoothedWindow& window);

/// `surface_sigma` [m]: standard deviation of a point's distance from its plane; 0 moves vertices completely
/// onto it. Vertices that are not in the report, or beyond the finder's gate from the plane, do not move.
/// Returns the number of moved vertices.
int drawOntoPlanes(const PlaneReport& report, const SmoothedWindow& window, double surface_sigma,
                   LocalMesh& mesh);

}  // namespace swiftlet
