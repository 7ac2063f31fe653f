// A map judged by the truth: labels counted by hand, and a mesh laid on the surface that it came from.

#include <catch2/catch.hpp>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/label_confusion.hpp"
#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"

namespace swiftlet {
namespace {

void addMany(LabelConfusion& confusion, std::uint8_t truth, std::uint8_t found, int count) {
  for (int i = 0; i < count; ++i) confusion.add(truth, found);
}

TEST_CASE("accuracy and intersection over union are those of the counts", "[map_evaluation]") {
  LabelConfusion confusion;
  addMany(confusion, 1, 1, 80);
  addMany(confusion, 1, 2, 10);
  addMany(confusion, 1, 0, 10);  // nothing said: against class 1
  addMany(confusion, 2, 2, 90);
  addMany(confusion, 2, 1, 9);
  addMany(confusion, 3, 3, 1);   // half a percent of the places
  addMany(confusion, 0, 2, 50);  // truth says nothing: counts nowhere
  CHECK(confusion.places() == 200);
  CHECK(confusion.accuracy() == Approx(171.0 / 200));
  CHECK(confusion.intersectionOverUnion(1) == Approx(80.0 / 109));
  CHECK(confusion.intersectionOverUnion(2) == Approx(90.0 / 109));
  CHECK(confusion.intersectionOverUnion(7) == 0);
  CHECK(confusion.meanIntersectionOverUnion(0.01) == Approx(170.0 / 218));
  CHECK(confusion.meanIntersectionOverUnion(0) == Approx((170.0 / 109 + 1) / 3));
  LabelConfusion twice = confusion;
  twice.add(confusion);
  CHECK(twice.places() == 400);
  CHECK(LabelConfusion().accuracy() == 0);
  CHECK(LabelConfusion().meanIntersectionOverUnion(0) == 0);
}

/// Three walls of a room, each of many small triangles.
TriangleMesh corner(double step) {
  TriangleMesh mesh;
  const auto wall = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    for (double s = 0; s < 2; s += step) {
      for (double t = 0; t < 2; t += step) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        for (const auto& [i, k] : {std::pair{0.0, 0.0}, {step, 0.0}, {step, step}, {0.0, step}}) {
          mesh.vertices.push_back((a + (s + i) * u + (t + k) * v).cast<float>());
        }
        mesh.faces.push_back({first, first + 1, first + 2});
        mesh.faces.push_back({first, first + 2, first + 3});
        mesh.labels.insert(mesh.labels.end(), {std::uint8_t{1}, std::uint8_t{1}});
      }
    }
  };
  wall({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  wall({0, 0, 0}, {0, 1, 0}, {0, 0, 1});
  wall({0, 0, 0}, {0, 0, 1}, {1, 0, 0});
  return mesh;
}

TEST_CASE("registration finds the motion of a mesh that was moved", "[map_evaluation]") {
  const TriangleMesh truth = corner(0.25);
  const TrueSurface surface(truth);
  Alignment motion;
  motion.T_to_from = SE3(expSo3({0.02, -0.03, 0.01}), {0.05, -0.04, 0.06});
  const TriangleMesh mesh = moved(corner(0.25), motion);
  CompleteMeshAccuracy accuracy = completeMeshAccuracy(mesh, surface, {});
  judgeRegistered(mesh, truth, surface, accuracy);
  CHECK(accuracy.distance.rmse > 0.03);
  CHECK(accuracy.registered.rmse < 1e-4);
  REQUIRE(accuracy.registration);
  CHECK(accuracy.registration->settled);
  const SE3 rest = accuracy.registration->motion.T_to_from * motion.T_to_from;
  CHECK(rest.translation.norm() < 1e-3);
  CHECK(accuracy.labels.accuracy() == 1);
}

TEST_CASE("one plane alone fixes what it can and leaves the rest", "[map_evaluation]") {
  TriangleMesh truth;
  truth.vertices = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  truth.faces = {{0, 1, 2}, {0, 2, 3}};
  truth.labels = {1, 1};
  const TrueSurface surface(truth);
  TriangleMesh mesh = truth;
  for (Eigen::Vector3f& p : mesh.vertices) p.z() += 0.1F;
  const MeshRegistration registration = registerMesh(mesh, truth, surface);
  CHECK(registration.settled);
  CHECK(registration.motion.T_to_from.translation.z() == Approx(-0.1).margin(1e-3));
  CHECK(registration.motion.T_to_from.translation.head<2>().norm() < 1e-3);
}

TEST_CASE("a mesh with nothing near it stays where it is", "[map_evaluation]") {
  const TriangleMesh truth = corner(0.5);
  TriangleMesh mesh = truth;
  for (Eigen::Vector3f& p : mesh.vertices) p.array() += 100;
  const MeshRegistration registration = registerMesh(mesh, truth, TrueSurface(truth));
  CHECK_FALSE(registration.settled);
  CHECK(registration.motion.T_to_from.translation.norm() == 0);
}

}  // namespace
}  // namespace swiftlet
