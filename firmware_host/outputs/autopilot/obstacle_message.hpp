#pragma once
// Obstacles around the vehicle from the local mesh, in the form that autopilots accept.
//
// 72 sectors of 5 degrees, clockwise from the vehicle's heading (MAV_FRAME_BODY_FRD: rotated with the
// vehicle's yaw, level). Distances are from the vehicle's reference point to the nearest mesh within half a
// metre above and below it. A sector is reported as free up to kObstacleReach if mesh beyond it crosses the
// sector's whole width; without mesh, or with part of the width, it is unknown. Pure; costs what
// nearestBySector costs, some 0.1 ms. Source: MAVLink common.xml, OBSTACLE_DISTANCE; docs/mavlink.md.

#include <optional>

#include "drivers/mavlink/autopilot_pose.hpp"
#include "drivers/mavlink/vision_messages.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

/// [m] The position of farther triangles is too uncertain to report.
inline constexpr float kObstacleReach = 20;

/// Empty if the mesh is of another epoch, if it is older than AutopilotLink::kOldestObstacles at `state`, or
/// if the state's health does not allow flight, so that the vehicle's position relative to the mesh is
/// unknown. The message has the mesh's stamp.
std::optional<mavlink::ObstacleDistance> obstacleDistanceOf(const LocalMesh& mesh, const NavState& state,
                                                            const AutopilotMounting& mounting);

}  // namespace swiftlet
