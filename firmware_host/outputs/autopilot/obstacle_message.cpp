#include "firmware_host/outputs/autopilot/obstacle_message.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/mavlink/autopilot_link.hpp"
#include "mesher/obstacle_queries.hpp"

namespace swiftlet {
namespace {

static_assert(kObstacleSectors == mavlink::ObstacleDistance::kSectors);

constexpr float kCentimetres = 100;
constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
/// Contact is reported as 1 cm: readers ignore 0 and values below the minimum.
constexpr std::uint16_t kNearest_cm = 1;
constexpr auto kFarthest_cm = static_cast<std::uint16_t>(kObstacleReach * kCentimetres);
constexpr std::uint16_t kNothingThere = kFarthest_cm + 1;

std::uint16_t told(float metres) {
  if (metres == kNothingKnown) return mavlink::ObstacleDistance::kUnknown;
  if (metres > kObstacleReach) return kNothingThere;
  return std::max(kNearest_cm, static_cast<std::uint16_t>(std::lround(metres * kCentimetres)));
}

}  // namespace

std::optional<mavlink::ObstacleDistance> obstacleDistanceOf(const LocalMesh& mesh, const NavState& state,
                                                            const AutopilotMounting& mounting) {
  if (mesh.epoch != state.epoch || state.stamp - mesh.stamp > AutopilotLink::kOldestObstacles)
    return std::nullopt;
  if (state.health != Health::kGood && state.health != Health::kDegraded) return std::nullopt;
  const SE3& T = state.T_world_body;
  const Eigen::Matrix3d R_world_vehicle = T.R() * mounting.q_vehicle_body.conjugate().toRotationMatrix();
  const Eigen::Vector3d forward = R_world_vehicle.col(0);
  SectorQuery query;
  query.origin = (T.translation + T.R() * mounting.p_body_vehicle).cast<float>();
  query.heading = static_cast<float>(std::atan2(forward.y(), forward.x()));
  query.reach = kObstacleReach;
  const SectorDistances nearest = nearestBySector(mesh, query);

  mavlink::ObstacleDistance message;
  message.time_usec = static_cast<std::uint64_t>(mesh.stamp.ns / kNanosecondsPerMicrosecond);
  message.min_cm = kNearest_cm;
  message.max_cm = kFarthest_cm;
  std::ranges::transform(nearest, message.distance_cm.begin(), &told);
  return message;
}

}  // namespace swiftlet
