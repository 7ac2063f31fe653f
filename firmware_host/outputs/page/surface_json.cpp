#include "firmware_host/outputs/page/surface_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "firmware_host/outputs/page/base64.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

using Cell = std::array<std::int64_t, 3>;

/// Vertices grouped by grid cell: `group` gives the new vertex of each.
struct Grouping {
  std::vector<std::uint32_t> group;
  std::size_t count = 0;
};

Grouping groupOf(const TriangleMesh& mesh, double width) {
  std::vector<std::pair<Cell, std::uint32_t>> cells(mesh.vertices.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Eigen::Vector3d at = mesh.vertices[i].cast<double>() / width;
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double kFar = 1e15;  // values of damaged files must still fit an integer
      cells[i].first[static_cast<std::size_t>(axis)] =
          static_cast<std::int64_t>(std::floor(std::clamp(at[axis], -kFar, kFar)));
    }
    cells[i].second = static_cast<std::uint32_t>(i);
  }
  std::sort(cells.begin(), cells.end());
  Grouping grouping;
  grouping.group.resize(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i == 0 || cells[i].first != cells[i - 1].first) ++grouping.count;
    grouping.group[cells[i].second] = static_cast<std::uint32_t>(grouping.count - 1);
  }
  return grouping;
}

TriangleMesh joined(const TriangleMesh& mesh, const Grouping& grouping) {
  TriangleMesh thin;
  thin.vertices.assign(grouping.count, Eigen::Vector3f::Zero());
  std::vector<float> grey(grouping.count, 0.0F);
  std::vector<float> members(grouping.count, 0.0F);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const std::uint32_t to = grouping.group[i];
    members[to] += 1;
    thin.vertices[to] += (mesh.vertices[i] - thin.vertices[to]) / members[to];
    if (!mesh.grey.empty()) grey[to] += (static_cast<float>(mesh.grey[i]) - grey[to]) / members[to];
  }
  if (!mesh.grey.empty()) {
    for (const float value : grey) thin.grey.push_back(static_cast<std::uint8_t>(std::lround(value)));
  }
  // Of triangles that become equal, one is kept, whatever the order of their corners.
  std::map<std::array<std::uint32_t, 3>, bool> taken;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    std::array<std::uint32_t, 3> face{};
    for (std::size_t k = 0; k < 3; ++k) face[k] = grouping.group[mesh.faces[i][k]];
    if (face[0] == face[1] || face[1] == face[2] || face[0] == face[2]) continue;
    std::array<std::uint32_t, 3> key = face;
    std::sort(key.begin(), key.end());
    if (!taken.emplace(key, true).second) continue;
    thin.faces.push_back(face);
    if (!mesh.labels.empty()) thin.labels.push_back(mesh.labels[i]);
  }
  return thin;
}

std::string bytesText(const std::vector<std::uint8_t>& bytes) {
  return base64(std::span<const unsigned char>(bytes));
}

}  // namespace

TriangleMesh thinned(const TriangleMesh& mesh, std::size_t vertices, std::size_t faces, double& cell) {
  cell = 0;
  if (mesh.vertices.size() <= vertices && mesh.faces.size() <= faces) return mesh;
  constexpr double kFirstCell = 0.02;  // m
  constexpr double kCoarser = 1.25;
  for (cell = kFirstCell;; cell *= kCoarser) {
    const Grouping grouping = groupOf(mesh, cell);
    if (grouping.count > vertices) continue;
    TriangleMesh thin = joined(mesh, grouping);
    if (thin.faces.size() <= faces) return thin;
  }
}

void addPoints(Json& json, std::span<const Eigen::Vector3f> points) {
  Eigen::Vector3f low = points.front();
  Eigen::Vector3f high = low;
  for (const Eigen::Vector3f& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  constexpr float kLeast = 1e-6F;  // m; a flat surface has no extent
  constexpr float kSteps = 65535;
  const Eigen::Vector3f size = (high - low).cwiseMax(kLeast);
  std::vector<std::uint16_t> steps;
  for (const Eigen::Vector3f& p : points) {
    for (int axis = 0; axis < 3; ++axis) {
      steps.push_back(static_cast<std::uint16_t>(std::lround((p[axis] - low[axis]) / size[axis] * kSteps)));
    }
  }
  json["low"] = {low.x(), low.y(), low.z()};
  json["size"] = {size.x(), size.y(), size.z()};
  json["points"] = base64Of(std::span<const std::uint16_t>(steps));
}

Json surfaceJson(const char* id, const char* name, const TriangleMesh& whole, const SurfaceError& error) {
  double cell = 0;
  const TriangleMesh mesh = thinned(whole, kMostVertices, kMostFaces, cell);
  std::vector<std::uint16_t> triangles;
  for (const auto& face : mesh.faces) {
    for (const std::uint32_t corner : face) triangles.push_back(static_cast<std::uint16_t>(corner));
  }
  Json json = {{"id", id}, {"name", name}, {"vertices", mesh.vertices.size()}, {"faces", mesh.faces.size()}};
  addPoints(json, mesh.vertices);
  json["triangles"] = base64Of(std::span<const std::uint16_t>(triangles));
  if (!mesh.grey.empty()) json["grey"] = bytesText(mesh.grey);
  if (std::ranges::any_of(mesh.labels, [](std::uint8_t label) { return label != 0; })) {
    json["labels"] = bytesText(mesh.labels);
  }
  if (error) {
    constexpr double kMost = 0.3;  // m; larger errors are not distinguished
    constexpr double kTop = 255;
    std::vector<std::uint8_t> errors;
    for (const Eigen::Vector3f& p : mesh.vertices) {
      errors.push_back(static_cast<std::uint8_t>(std::lround(error(p, kMost) / kMost * kTop)));
    }
    json["error"] = bytesText(errors);
    json["error_most"] = kMost;
  }
  if (cell > 0) {
    json["note"] = fmt::format("{} of {} triangles: vertices merged on a grid of {:.3f} m", mesh.faces.size(),
                               whole.faces.size(), cell);
  }
  return json;
}

}  // namespace swiftlet
