#include "firmware_host/lab/evaluation/revisits.hpp"

#include <numbers>
#include <vector>

namespace swiftlet {

Revisits countRevisits(const Trajectory& truth, const RevisitOptions& options) {
  std::vector<const TrajectoryPoint*> samples;
  for (const TrajectoryPoint& point : truth) {
    if (samples.empty() || point.stamp - samples.back()->stamp >= options.spacing) samples.push_back(&point);
  }
  Revisits result;
  result.samples = samples.size();
  const double max_turn = options.max_turn_deg * std::numbers::pi / 180;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    std::size_t pairs = 0;
    for (std::size_t j = 0; j < i && samples[i]->stamp - samples[j]->stamp > options.min_apart; ++j) {
      const SE3& a = samples[i]->T_world_body;
      const SE3& b = samples[j]->T_world_body;
      if ((a.translation - b.translation).norm() < options.max_distance &&
          a.rotation.angularDistance(b.rotation) < max_turn) {
        ++pairs;
      }
    }
    result.pairs += pairs;
    if (pairs > 0) ++result.revisiting;
  }
  return result;
}

}  // namespace swiftlet
