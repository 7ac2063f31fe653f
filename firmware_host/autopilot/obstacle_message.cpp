#include "firmware_host/autopilot/obstacle_message.hpp"

#include <algorithm>
#include <cmath>

#include "mesher/obstacle_queries.hpp"

namespace swiftlet {
namespace {

static_assert(kObstacleSectors == mavlink::ObstacleDistance::kSectors);

constexpr float kCentimetres = 100;
constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
/// What touches the vehicle is told as one step away: readers leave 0, and what is below the minimum, out.
constexpr std::uint16_t kNearest_cm = 1;

}  // namespace

std::optional<mavlink::ObstacleDistance> obstacleDistanceOf(const LocalMesh& mesh, const NavState& state,
                                                            const AutopilotMounting& mounting) {
  if (mesh.epoch != state.epoch || state.stamp - mesh.stamp > kOldestObstacles) return std::nullopt;
  const SE3& T = state.T_world_body;
  const Eigen::Matrix3d R_world_vehicle = T.R() * mounting.q_vehicle_body.conjugate().toRotationMatrix();
  const Eigen::Vector3d forward = R_world_vehicle.col(0);
  SectorQuery query;
  query.origin = (T.translation + T.R() * mounting.p_body_vehicle).cast<float>();
  query.heading = static_cast<float>(std::atan2(forward.y(), forward.x()));
  const SectorDistances nearest = nearestBySector(mesh, query);

  mavlink::ObstacleDistance message;
  message.time_usec = static_cast<std::uint64_t>(mesh.stamp.ns / kNanosecondsPerMicrosecond);
  message.min_cm = kNearest_cm;
  message.max_cm = static_cast<std::uint16_t>(query.reach * kCentimetres);
  std::ranges::transform(nearest, message.distance_cm.begin(), [](float metres) {
    if (metres == kNothingKnown) return mavlink::ObstacleDistance::kUnknown;
    return std::max(kNearest_cm, static_cast<std::uint16_t>(std::lround(metres * kCentimetres)));
  });
  return message;
}

}  // namespace swiftlet
