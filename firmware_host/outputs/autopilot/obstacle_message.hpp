#pragma once
// Obstacles around the vehicle from the local mesh, in the form that autopilots accept.
//
// 72 sectors of 5 degrees, clockwise from the vehicle's heading (MAV_FRAME_BODY_FRD: rotated with the
// vehicle's yaw, level). Distances are from the vehicle's reference point to the nearest mesh within half a
// metre above and below it. A sector without any mesh is unknown, not free; a sector whose nearest mesh is
// beyond kObstacleReach is reported as free up to that distance. Pure; costs what nearestBySector costs, some
// 0.1 ms. Source: MAVLink common.xml, OBSTACLE_DISTANCE; docs/mavlink.md.

#include <optional>

#include "drivers/mavlink/autopilot_pose.hpp"
#include "drivers/mavlink/vision_messages.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

/// Older meshes say nothing about now.
inline constexpr Duration kOldestObstacles = Duration::fromMilliseconds(500);

/// [m] Farther triangles are too uncertain to give a figure.
inline constexpr float kObstacleReach = 20;

/// Empty: the mesh is of another epoch, or older than kOldestObstacles at `state`, or the state is none to
/// fly on, and so says nothing of where the mesh is seen from. The stamp is the mesh's.
std::optional<mavlink::ObstacleDistance> obstacleDistanceOf(const LocalMesh& mesh, const NavState& state,
                                                            const AutopilotMounting& mounting);

}  // namespace swiftlet
