#include "firmware_host/view/live_scene.hpp"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "firmware_host/report_page/base64.hpp"

namespace swiftlet {

nlohmann::ordered_json cloudJson(const char* id, const char* name, std::span<const SurfaceVertex> vertices,
                                 const SE3& T_to_from, std::size_t most) {
  const std::size_t step = (vertices.size() + most - 1) / most;
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::uint8_t> grey;
  std::vector<std::uint8_t> labels;
  bool labelled = false;
  for (std::size_t i = 0; i < vertices.size(); i += step) {
    const SurfaceVertex& vertex = vertices[i];
    positions.push_back((T_to_from * vertex.p_world.cast<double>()).cast<float>());
    grey.push_back(vertex.grey);
    labels.push_back(vertex.label);
    labelled = labelled || vertex.label != 0;
  }
  Eigen::Vector3f low = positions.front();
  Eigen::Vector3f high = low;
  for (const Eigen::Vector3f& p : positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  constexpr float kLeast = 1e-6F;
  constexpr float kSteps = 65535;
  const Eigen::Vector3f size = (high - low).cwiseMax(kLeast);
  std::vector<std::uint16_t> points;
  for (const Eigen::Vector3f& p : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      points.push_back(static_cast<std::uint16_t>(std::lround((p[axis] - low[axis]) / size[axis] * kSteps)));
    }
  }
  nlohmann::ordered_json json = {{"id", id},
                                 {"name", name},
                                 {"count", positions.size()},
                                 {"low", {low.x(), low.y(), low.z()}},
                                 {"size", {size.x(), size.y(), size.z()}},
                                 {"points", base64Of(std::span<const std::uint16_t>(points))},
                                 {"grey", base64(grey)}};
  if (labelled) json["labels"] = base64(labels);
  if (step > 1)
    json["note"] = fmt::format("{} of {} corners of the surface", positions.size(), vertices.size());
  return json;
}

}  // namespace swiftlet
