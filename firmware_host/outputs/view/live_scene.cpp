#include "firmware_host/outputs/view/live_scene.hpp"

#include <fmt/format.h>

#include <vector>

#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"

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
  nlohmann::ordered_json json = {{"id", id}, {"name", name}, {"count", positions.size()}};
  addPoints(json, positions);
  json["grey"] = base64(grey);
  if (labelled) json["labels"] = base64(labels);
  if (step > 1)
    json["note"] = fmt::format("{} of {} corners of the surface", positions.size(), vertices.size());
  return json;
}

}  // namespace swiftlet
