#pragma once
// What stands around the vehicle, from the local mesh, as autopilots take it.
//
// 72 sectors of 5 degrees, clockwise from the vehicle's heading (MAV_FRAME_BODY_FRD: turned with the
// vehicle's yaw, level), distances from its reference point to what lies within half a metre below and above
// it. A sector in which the mesh has nothing is unknown, not free; one in which the nearest that it has lies
// beyond kObstacleReach is told as free up to there. Pure; cost as nearestBySector, some 0.1 ms.
// Source: MAVLink common.xml, OBSTACLE_DISTANCE; docs/mavlink.md.

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
