#pragma once
// A mesh drawn flat where planes are known: its vertices on planes are moved towards them by their own noise,
//   p' = p - S n (n . p - d) / (n^T S n + surface_sigma^2),   S = depth_sigma^2 u u^T + lateral_sigma^2 I,
// u the line of sight: the likeliest place of a point that is seen in that direction and lies on that plane.
// What is known well stays where it is, what is known badly takes the plane's word, and moves along its line
// of sight, so that it stays where it was seen. A landmark that the smoother has tied already hardly moves.
// The plane is the smoother's where it has one (SmoothedWindow::planes), the mesher's otherwise.
// Nothing is allocated (40 kB on the stack). Cost: two sorts and a search a vertex, 0.1 ms.

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
/// The smoother's, else the mesher's; none when neither has it.
std::optional<KnownPlane> knownPlane(std::uint64_t id, const PlaneReport& report,
                                     const SmoothedWindow& window);

/// `surface_sigma` [m] by which a surface is off its plane; zero: all the way onto it. Vertices that the
/// report does not name, or that are beyond the finder's gate from the plane, stay. Returns how many were
/// moved.
int drawOntoPlanes(const PlaneReport& report, const SmoothedWindow& window, double surface_sigma,
                   LocalMesh& mesh);

}  // namespace swiftlet
