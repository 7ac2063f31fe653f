#include "firmware_host/lab/report/scene.hpp"

#include "firmware_host/lab/report/run_plots.hpp"
#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

Json trajectoryJson(const RunFiles& files, const std::string& name, const char* style,
                    const Trajectory& poses, const std::vector<double>& value,
                    const std::string& value_label) {
  const std::size_t step = poses.size() / kMostPoints + 1;
  std::vector<float> points;
  std::vector<float> t;
  std::vector<float> values;
  for (std::size_t i = 0; i < poses.size(); i += step) {
    t.push_back(static_cast<float>(files.seconds(poses[i].stamp)));
    for (int axis = 0; axis < 3; ++axis) {
      points.push_back(static_cast<float>(poses[i].T_world_body.translation[axis]));
    }
    if (value.size() == poses.size()) values.push_back(static_cast<float>(value[i]));
  }
  Json json = {{"name", name},
               {"style", style},
               {"count", points.size() / 3},
               {"points", base64Of(std::span<const float>(points))},
               {"t", base64Of(std::span<const float>(t))}};
  if (!values.empty()) {
    json["value"] = base64Of(std::span<const float>(values));
    json["value_label"] = value_label;
  }
  return json;
}

}  // namespace

Json sceneOf(const RunView& view, const MeshDistance* truth) {
  Json scene = {{"trajectories", Json::array()}, {"surfaces", Json::array()}};
  const auto add = [&](const char* name, const char* style, const Trajectory& poses,
                       const std::vector<double>& value = {}, const std::string& label = "") {
    if (poses.empty()) return;
    scene["trajectories"].push_back(trajectoryJson(view.files, name, style, poses, value, label));
  };
  add("truth", "truth", view.truth);
  add("map.tum", "points", view.files.map);
  const std::vector<Plot> plans = trajectoryPlots(view);
  if (!plans.empty()) {
    add("odometry", "line", view.files.odometry, plans.front().series.back().value,
        plans.front().value_label);
  }
  const auto surface = [&](const char* id, const char* name, const std::optional<TriangleMesh>& mesh) {
    if (!mesh || mesh->faces.empty()) return;
    SurfaceError error;
    if (truth != nullptr && view.hasTruth()) {
      error = [&](const Eigen::Vector3f& corner, double most) {
        const auto nearest = truth->nearest(view.fit * corner.cast<double>(), most);
        return nearest ? nearest->distance : most;
      };
    }
    scene["surfaces"].push_back(surfaceJson(id, name, *mesh, error));
  };
  surface("map", "map", view.files.map_mesh);
  surface("local_mesh", "local mesh", view.files.local_mesh);
  return scene;
}

}  // namespace swiftlet
