#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "drivers/simulated/flight_path.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "drivers/simulated/track_simulator.hpp"
#include "drivers/simulated/world.hpp"

namespace swiftlet {
namespace {

struct Flight {
  WorldSettings world_settings;
  MountedRig mounted;
  SplineTrajectory trajectory;
  World world;
};

std::vector<Eigen::Vector3d> sampled(const SplineTrajectory& trajectory, double duration) {
  std::vector<Eigen::Vector3d> points;
  for (double t = 0; t < duration; t += 0.1) points.push_back(trajectory.pose(t).translation);
  return points;
}

Flight makeFlight(WorldKind kind, RigKind rig, std::uint64_t seed, double duration) {
  Flight flight;
  flight.world_settings.kind = kind;
  flight.world_settings.seed = seed;
  flight.mounted = makeRig(rig);
  FlightSettings settings;
  settings.duration = duration;
  settings.seed = seed;
  settings.R_flu_body = flight.mounted.R_flu_body;
  flight.trajectory = flyTour(worldTour(flight.world_settings), settings);
  flight.world = buildWorld(flight.world_settings, sampled(flight.trajectory, duration));
  return flight;
}

constexpr std::array kKinds{WorldKind::kRoom, WorldKind::kHall, WorldKind::kCluttered, WorldKind::kTwinRooms,
                            WorldKind::kCorridor};

TEST_CASE("every world is closed and its flight path free") {
  for (const WorldKind kind : kKinds) {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      const Flight flight = makeFlight(kind, RigKind::kEuroc, seed, 90);
      INFO(worldName(kind) << ", seed " << seed << ", patches " << flight.world.patches().size());
      CHECK(flight.world.patches().size() > 20);
      Random random(seed);
      const std::vector<Eigen::Vector3d> path = sampled(flight.trajectory, 90);
      std::size_t open = 0;
      std::size_t close = 0;
      for (std::size_t i = 0; i < path.size(); i += 3) {
        for (int k = 0; k < 10; ++k) {
          const Eigen::Vector3d d =
              Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
          const auto hit = flight.world.castRay(path[i], d, 0.0, 1e3);
          if (!hit) ++open;
          if (hit && hit->distance < 0.25) ++close;
        }
        INFO("at " << path[i].transpose());
        if (i + 3 < path.size()) CHECK(flight.world.sees(path[i], path[i + 3], 0.0));
      }
      CHECK(open == 0);
      CHECK(close == 0);
    }
  }
}

TEST_CASE("surface coordinates of a hit give the hit point") {
  const Flight flight = makeFlight(WorldKind::kCluttered, RigKind::kEuroc, 4, 10);
  Random random(9);
  std::map<Shape, int> shapes;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d o = flight.trajectory.pose(random.uniform(0, 10)).translation;
    const Eigen::Vector3d d(random.normal(), random.normal(), random.normal());
    const auto hit = flight.world.castRay(o, d, 0.0, 1e3);
    REQUIRE(hit);
    const Patch& patch = flight.world.patches()[hit->patch];
    ++shapes[patch.shape];
    CHECK((patch.pointAt(hit->u, hit->v) - (o + hit->distance * d)).norm() < 1e-9);
    CHECK(patch.normalAt(hit->u, hit->v).dot(d) < 0);
  }
  CHECK(shapes.size() == 4);
}

TEST_CASE("the mesh has the surface's area, labels and outward triangles") {
  const Flight flight = makeFlight(WorldKind::kCluttered, RigKind::kEuroc, 4, 10);
  double area = 0;
  for (const Patch& patch : flight.world.patches()) area += patch.area();
  const SurfaceMesh mesh = flight.world.mesh(1e-4);
  double meshed = 0;
  for (const MeshTriangle& triangle : mesh.triangles) {
    const Eigen::Vector3f a = mesh.vertices[triangle.vertex[0]];
    const Eigen::Vector3f b = mesh.vertices[triangle.vertex[1]];
    const Eigen::Vector3f c = mesh.vertices[triangle.vertex[2]];
    meshed += 0.5 * static_cast<double>((b - a).cross(c - a).norm());
  }
  CHECK(meshed == Approx(area).epsilon(1e-3));
  // A ray that starts just above each triangle and goes down its normal hits at once.
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 7) {
    const auto& v = mesh.triangles[i].vertex;
    const Eigen::Vector3d a = mesh.vertices[v[0]].cast<double>();
    const Eigen::Vector3d b = mesh.vertices[v[1]].cast<double>();
    const Eigen::Vector3d c = mesh.vertices[v[2]].cast<double>();
    const Eigen::Vector3d normal = (b - a).cross(c - a);
    if (normal.norm() < 1e-7) continue;  // the poles of a sphere
    const auto hit =
        flight.world.castRay((a + b + c) / 3 + 1e-3 * normal.normalized(), -normal.normalized(), 0, 1e-2);
    REQUIRE(hit);
    CHECK(flight.world.patches()[hit->patch].label == mesh.triangles[i].label);
  }
}

TEST_CASE("twin rooms are the same from inside") {
  const Flight flight = makeFlight(WorldKind::kTwinRooms, RigKind::kEuroc, 3, 60);
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p(random.uniform(-1, 1), random.uniform(-1, 2), random.uniform(1, 2));
    Eigen::Vector3d d(random.normal(), random.normal(), random.normal());
    if (d.y() < 0) d.y() = -d.y();  // not through the door
    const auto a = flight.world.castRay(p + Eigen::Vector3d(-5, 0, 0), d, 0, 100);
    const auto b = flight.world.castRay(p + Eigen::Vector3d(5, 0, 0), d, 0, 100);
    REQUIRE((a && b));
    CHECK(a->distance == Approx(b->distance).epsilon(1e-9));
    CHECK(flight.world.patches()[a->patch].paint_seed == flight.world.patches()[b->patch].paint_seed);
  }
}

TEST_CASE("tracks project from their landmarks with the noise asked for") {
  for (const RigKind kind : {RigKind::kEuroc, RigKind::kFisheye}) {
    const Flight flight = makeFlight(WorldKind::kRoom, kind, 5, 20);
    TrackSettings settings;
    settings.outlier_share = 0.1;
    settings.pixel_sigma = 0.7;
    TrackSimulator simulator(flight.world, flight.mounted.rig, flight.trajectory, settings);
    TrackedFrame frame;
    std::vector<TrackTruth> truth;
    std::map<TrackId, std::uint32_t> landmark_of;
    double noise = 0;
    int sightings = 0;
    int outliers = 0;
    int right = 0;
    int keyframes = 0;
    double features = 0;
    for (int k = 0; k < 400; ++k) {
      const double t = 0.05 * k;
      simulator.step(t, Stamp{50'000'000LL * k}, frame, &truth);
      REQUIRE(frame.index == static_cast<std::uint64_t>(k));
      REQUIRE(truth.size() == frame.features.size());
      features += static_cast<double>(truth.size()) / 400;
      keyframes += frame.keyframe ? 1 : 0;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        const TrackedFeature& feature = frame.features[i];
        const auto known = landmark_of.emplace(feature.id, truth[i].landmark_index).first;
        CHECK(known->second == truth[i].landmark_index);
        for (std::size_t c = 0; c < 2; ++c) {
          if (!feature.seen[c]) continue;
          const SE3 T_world_cam = flight.trajectory.pose(t) * flight.mounted.rig.T_body_cam[c];
          Eigen::Vector2d pixel;
          REQUIRE(flight.mounted.rig.camera[c].project(T_world_cam.inverse() * truth[i].landmark, pixel));
          CHECK((pixel - truth[i].pixel[c]).norm() < 1e-9);
          ++sightings;
          right += c == 1 ? 1 : 0;
          if (truth[i].outlier[c]) {
            ++outliers;
          } else {
            noise += (feature.pixel[c].cast<double>() - pixel).squaredNorm();
          }
        }
      }
    }
    INFO(rigName(kind) << " features " << features << " right " << right << " of " << sightings);
    CHECK(features > 100);
    CHECK(right > sightings / 4);
    CHECK(std::sqrt(noise / (2.0 * (sightings - outliers))) == Approx(0.7).epsilon(0.02));
    CHECK(static_cast<double>(outliers) / sightings == Approx(0.1).epsilon(0.1));
    CHECK(keyframes >= 80);
    CHECK(keyframes < 400);
  }
}

}  // namespace
}  // namespace swiftlet
