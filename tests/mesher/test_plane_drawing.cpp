// Meshes drawn onto planes and folded where two of them meet.

#include "mesher/plane_drawing.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <set>

#include "mesher/plane_folds.hpp"
#include "tests/mesher/plane_scene.hpp"

using namespace swiftlet;
using Eigen::Vector3d;
using test::PlaneScene;

namespace {

constexpr double kDepthSigma = 0.02;  // m

struct Scene {
  PlaneScene mesh{5, kDepthSigma};
  std::unique_ptr<PlaneReport> report = std::make_unique<PlaneReport>();

  void plane(std::uint64_t id, const Vector3d& normal, double distance) {
    static_cast<void>(report->planes.tryPushBack({id, PlaneDirection::kVertical, normal, distance}));
  }
  /// A vertex whose landmark is reported on a plane.
  std::uint32_t on(std::uint64_t plane, const Vector3d& p) {
    const std::uint32_t v = mesh.add(p);
    static_cast<void>(report->points.tryPushBack({mesh.mesh->vertices[v].id, plane, true}));
    return v;
  }
  [[nodiscard]] Vector3d at(std::uint32_t v) const { return mesh.mesh->vertices[v].p_world.cast<double>(); }
};

double area(const LocalMesh& mesh) {
  double sum = 0;
  for (const MeshFace& face : mesh.faces) {
    const Eigen::Vector3f& a = mesh.vertices[face.vertex[0]].p_world;
    sum += 0.5 * static_cast<double>((mesh.vertices[face.vertex[1]].p_world - a)
                                         .cross(mesh.vertices[face.vertex[2]].p_world - a)
                                         .norm());
  }
  return sum;
}

Vector3d normalOf(const LocalMesh& mesh, const MeshFace& face) {
  const Eigen::Vector3f& a = mesh.vertices[face.vertex[0]].p_world;
  return (mesh.vertices[face.vertex[1]].p_world - a)
      .cross(mesh.vertices[face.vertex[2]].p_world - a)
      .cast<double>()
      .normalized();
}

}  // namespace

TEST_CASE("Vertices are drawn onto their plane along the line of sight", "[mesher][drawing]") {
  Scene scene;
  const Vector3d normal = Vector3d(-1, 0.4, 0).normalized();
  scene.plane(3, normal, -2.5);
  Random random(3, 8);
  for (int k = 0; k < 40; ++k) {
    const Vector3d beside =
        random.uniform(-1, 1) * Vector3d(0.4, 1, 0).normalized() + random.uniform(-1, 1) * Vector3d::UnitZ();
    scene.on(3, -2.5 * normal + beside);
  }
  const std::uint32_t other = scene.mesh.add({2, 1, 0});
  const LocalMesh before = *scene.mesh.mesh;
  const auto height = [&](std::uint32_t v) { return normal.dot(scene.at(v)) + 2.5; };

  SECTION("all the way") {
    CHECK(drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh) == 40);
    for (std::uint32_t v = 0; v < 40; ++v) {
      CHECK(std::abs(height(v)) < 1e-5);
      const Vector3d ray = before.vertices[v].p_world.cast<double>();
      // Where it was seen, to a fraction of the noise.
      CHECK(ray.normalized().cross(scene.at(v) - ray).norm() < 0.1 * (scene.at(v) - ray).norm() + 1e-6);
    }
    CHECK(before.vertices[other].p_world == scene.mesh.mesh->vertices[other].p_world);
  }
  SECTION("by their noise") {
    const double surface = kDepthSigma;
    CHECK(drawOntoPlanes(*scene.report, *scene.mesh.window, surface, *scene.mesh.mesh) == 40);
    for (std::uint32_t v = 0; v < 40; ++v) {
      const Vector3d ray = before.vertices[v].p_world.cast<double>();
      const double cosine = normal.dot(ray.normalized());
      const double variance = std::pow(kDepthSigma * cosine, 2) + std::pow(0.002 * ray.norm(), 2);
      const double kept = 1 - variance / (variance + surface * surface);
      CHECK(height(v) == Approx(kept * (normal.dot(ray) + 2.5)).epsilon(0.05).margin(2e-4));
    }
  }
  SECTION("the smoother's word on a plane goes before the mesher's") {
    static_cast<void>(scene.mesh.window->planes.tryPushBack({3, normal, -2.49, {}, 7}));
    drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh);
    for (std::uint32_t v = 0; v < 40; ++v) CHECK(height(v) == Approx(0.01).margin(1e-5));
  }
  SECTION("what its noise does not explain stays, and so does all of another epoch") {
    scene.mesh.mesh->vertices[4].p_world += 0.3F * normal.cast<float>();
    CHECK(drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh) == 39);
    scene.report->epoch = 2;
    CHECK(drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh) == 0);
  }
  SECTION("vertices that are not finite") {
    scene.mesh.mesh->vertices[4].p_world.x() = std::nanf("");
    CHECK(drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh) == 39);
  }
}

TEST_CASE("A face over the edge of floor and wall is folded into both", "[mesher][folds]") {
  Scene scene;
  scene.plane(1, Vector3d::UnitZ(), -1);   // floor
  scene.plane(2, -Vector3d::UnitX(), -3);  // wall at x = 3
  const std::uint32_t a = scene.on(1, {2.4, -0.2, -1});
  const std::uint32_t b = scene.on(1, {2.5, 0.4, -1});
  const std::uint32_t c = scene.on(2, {3, 0.1, -0.4});
  const std::uint32_t d = scene.on(2, {3, -0.5, -0.5});
  drawOntoPlanes(*scene.report, *scene.mesh.window, 0, *scene.mesh.mesh);
  scene.mesh.addFace({b, a, c});
  scene.mesh.addFace({c, a, d});
  LocalMesh& mesh = *scene.mesh.mesh;

  SECTION("both, with the edge between them shared") {
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 2);
    CHECK(mesh.faces.size() == 6);
    CHECK(mesh.vertices.size() == 7);  // three edges cross
    std::set<TrackId> ids;
    for (const MeshVertex& vertex : mesh.vertices) CHECK(ids.insert(vertex.id).second);
    for (std::uint32_t v = 4; v < 7; ++v) {
      CHECK(scene.at(v).x() == Approx(3).margin(1e-4));
      CHECK(scene.at(v).z() == Approx(-1).margin(1e-4));
    }
    for (const MeshFace& face : mesh.faces) {
      const Vector3d normal = normalOf(mesh, face);
      // On one of the two, seen from the same side.
      CHECK(std::max(normal.z(), -normal.x()) > 0.999);
    }
  }
  SECTION("what the planes folded flat would hold, no more and no less") {
    mesh.faces.resize(1);
    // The wall laid down: (3, y, z) to (3 + (z + 1), y).
    const auto flat = [&](std::uint32_t v) {
      const Vector3d p = scene.at(v);
      return Eigen::Vector2d(p.x() + p.z() + 1, p.y());
    };
    const Eigen::Vector2d e = flat(b) - flat(a);
    const Eigen::Vector2d g = flat(c) - flat(a);
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 1);
    CHECK(area(mesh) == Approx(0.5 * std::abs(e.x() * g.y() - e.y() * g.x())).epsilon(1e-3));
  }
  SECTION("no room, no fold") {
    mesh.faces.resize(kMaxMeshFaces - 1);
    for (std::size_t f = 2; f < mesh.faces.size(); ++f) mesh.faces[f].vertex = {a, b, a};
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 0);
    CHECK(mesh.faces.size() == kMaxMeshFaces - 1);
  }
  SECTION("a corner on no plane, planes that are nearly parallel, another epoch") {
    scene.report->points.popBack();
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 1);  // the first face alone
    mesh.faces.resize(1);
    mesh.faces[0].vertex = {a, b, c};
    scene.report->planes[1].normal = Vector3d(-0.2, 0, 1).normalized();
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 0);
    scene.report->planes[1].normal = -Vector3d::UnitX();
    scene.report->epoch = 1;
    CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, mesh) == 0);
  }
}

TEST_CASE("A floor below a wall's foot and a table in front of it: no fold where none is seen",
          "[mesher][folds]") {
  Scene scene;
  scene.plane(1, Vector3d::UnitZ(), -1);
  scene.plane(2, -Vector3d::UnitX(), -3);
  // The floor goes on behind the wall's plane (a doorway).
  const std::uint32_t a = scene.on(1, {3.4, -0.2, -1});
  const std::uint32_t b = scene.on(1, {3.5, 0.4, -1});
  const std::uint32_t c = scene.on(2, {3, 0.1, -0.4});
  scene.mesh.addFace({a, b, c});
  CHECK(foldAtPlanes(*scene.report, *scene.mesh.window, *scene.mesh.mesh) == 0);
  CHECK(scene.mesh.mesh->faces.size() == 1);
}
