// Distances by sector around a vehicle: a known wall, random faces beside a dense sampling, what is above and
// below, a face all around.

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "estimator/core/random.hpp"
#include "mesher/obstacle_queries.hpp"

namespace swiftlet {
namespace {

using Eigen::Vector3f;

constexpr float kDegree = std::numbers::pi_v<float> / 180;
constexpr float kSector = 360.0F / static_cast<float>(kObstacleSectors);

void addFace(LocalMesh& mesh, const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Vector3f& p : {a, b, c}) REQUIRE(mesh.vertices.tryPushBack({first, p, 0}));
  REQUIRE(mesh.faces.tryPushBack({{first, first + 1, first + 2}, kNoLabel}));
}

TEST_CASE("A wall ahead is in the sectors that look at it, at its distance", "[obstacles]") {
  const auto mesh = std::make_unique<LocalMesh>();
  // The vehicle looks along the world's y; 3 m ahead stands a wall from 3 m to its left to 3 m to its right.
  addFace(*mesh, {-3, 3, -1}, {3, 3, -1}, {3, 3, 1});
  addFace(*mesh, {-3, 3, -1}, {3, 3, 1}, {-3, 3, 1});
  SectorQuery query;
  query.heading = std::numbers::pi_v<float> / 2;
  const SectorDistances found = nearestBySector(*mesh, query);
  for (std::size_t i = 0; i < kObstacleSectors; ++i) {
    float degrees = static_cast<float>(i) * kSector;
    if (degrees > 180) degrees -= 360;
    INFO(degrees);
    if (std::abs(degrees) < 45) {
      // The edge of the sector that is nearer to straight ahead sees the wall nearest.
      const float nearest = std::max(std::abs(degrees) - kSector / 2, 0.0F);
      CHECK(found[i] == Approx(3 / std::cos(nearest * kDegree)).epsilon(1e-4));
    } else if (std::abs(degrees) > 45 + kSector) {
      CHECK(found[i] == kNothingKnown);
    }
  }
}

TEST_CASE("What stands to the right is in the sectors clockwise of ahead", "[obstacles]") {
  const auto mesh = std::make_unique<LocalMesh>();
  addFace(*mesh, {-0.1F, -2, -0.2F}, {0.1F, -2, -0.2F}, {0, -2, 0.2F});  // y to the left, so -y to the right
  const SectorDistances found = nearestBySector(*mesh, {});
  CHECK(found[kObstacleSectors / 4] == Approx(2));
  CHECK(found[3 * kObstacleSectors / 4] == kNothingKnown);
}

TEST_CASE("What is above, below or too far does not count; what surrounds the vehicle is at no distance",
          "[obstacles]") {
  const auto mesh = std::make_unique<LocalMesh>();
  addFace(*mesh, {2, -1, 1}, {2, 1, 1}, {2, 0, 2});
  addFace(*mesh, {2, -1, -1}, {2, 1, -1}, {2, 0, -2});
  addFace(*mesh, {50, -1, -0.2F}, {50, 1, -0.2F}, {50, 0, 0.2F});
  for (const float distance : nearestBySector(*mesh, {})) CHECK(distance == kNothingKnown);
  // A ramp that rises from below into the band is met where it enters it.
  addFace(*mesh, {0, -9, -3}, {0, 9, -3}, {6, 0, 0});
  CHECK(nearestBySector(*mesh, {})[0] == Approx(5).epsilon(1e-4));
  addFace(*mesh, {-9, -9, 0.1F}, {9, -9, 0.1F}, {0, 9, 0.1F});
  for (const float distance : nearestBySector(*mesh, {})) CHECK(distance == 0);
}

TEST_CASE("A sector is free where far faces cross its whole width, unknown where they cross a part",
          "[obstacles]") {
  const auto mesh = std::make_unique<LocalMesh>();
  SectorQuery query;
  query.reach = 20;
  // 30 m ahead, from 10 degrees left to 10 right, in two faces with a common edge: the sectors of
  // 0 and 5 degrees are crossed whole, those of 10 degrees by half.
  const float side = 30 * std::tan(10 * kDegree);
  addFace(*mesh, {30, -side, -9}, {30, side, -9}, {30, side, 9});
  addFace(*mesh, {30, -side, -9}, {30, side, 9}, {30, -side, 9});
  const SectorDistances far = nearestBySector(*mesh, query);
  for (const std::size_t free : {0U, 1U, 71U}) {
    CHECK(far[free] > query.reach);
    CHECK(far[free] < 31);
  }
  for (const std::size_t unknown : {2U, 70U, 3U, 69U}) CHECK(far[unknown] == kNothingKnown);
  // A gap of two degrees in the middle.
  const auto gap = std::make_unique<LocalMesh>();
  const float inner = 30 * std::tan(1 * kDegree);
  addFace(*gap, {30, -side, -9}, {30, -inner, -9}, {30, -inner, 9});
  addFace(*gap, {30, -side, -9}, {30, -inner, 9}, {30, -side, 9});
  addFace(*gap, {30, inner, -9}, {30, side, -9}, {30, side, 9});
  addFace(*gap, {30, inner, -9}, {30, side, 9}, {30, inner, 9});
  CHECK(nearestBySector(*gap, query)[0] == kNothingKnown);
  CHECK(nearestBySector(*gap, query)[1] > query.reach);
  // Near faces count in whatever part of the sector they are.
  query.reach = 40;
  CHECK(nearestBySector(*gap, query)[2] == Approx(30 / std::cos(7.5F * kDegree)).epsilon(1e-4));
}

TEST_CASE("Random faces are met as a dense sampling meets them", "[obstacles]") {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    const auto uniform = [&](double low, double high) {
      return static_cast<float>(random.uniform(low, high));
    };
    const auto mesh = std::make_unique<LocalMesh>();
    SectorQuery query;
    query.origin = {uniform(-2, 2), uniform(-2, 2), uniform(-1, 1)};
    query.heading = uniform(-4, 4);
    query.below = uniform(0.2, 1);
    query.above = uniform(0.2, 1);
    for (int face = 0; face < 4; ++face) {
      // Away from the vehicle, as the mesh of a camera is.
      const float azimuth = uniform(-4, 4);
      const Vector3f centre = query.origin + 4 * Vector3f(std::cos(azimuth), std::sin(azimuth), 0);
      const auto corner = [&] {
        return Vector3f(centre + Vector3f(uniform(-2, 2), uniform(-2, 2), uniform(-1, 1)));
      };
      addFace(*mesh, corner(), corner(), corner());
    }
    SectorDistances sampled;
    sampled.fill(kNothingKnown);
    for (const MeshFace& face : mesh->faces) {
      constexpr int kSteps = 400;
      for (int i = 0; i <= kSteps; ++i) {
        for (int j = 0; i + j <= kSteps; ++j) {
          const float u = static_cast<float>(i) / kSteps;
          const float v = static_cast<float>(j) / kSteps;
          const Vector3f p = (1 - u - v) * mesh->vertices[face.vertex[0]].p_world +
                             u * mesh->vertices[face.vertex[1]].p_world +
                             v * mesh->vertices[face.vertex[2]].p_world - query.origin;
          if (p.z() > query.above || p.z() < -query.below) continue;
          const float clockwise = query.heading - std::atan2(p.y(), p.x());
          const int sector = static_cast<int>(std::floor(clockwise / (kSector * kDegree) + 0.5F));
          constexpr int kSectors = static_cast<int>(kObstacleSectors);
          float& nearest = sampled[static_cast<std::size_t>((sector % kSectors + kSectors) % kSectors)];
          nearest = std::min(nearest, p.head<2>().norm());
        }
      }
    }
    const SectorDistances found = nearestBySector(*mesh, query);
    for (std::size_t i = 0; i < kObstacleSectors; ++i) {
      INFO("seed " << seed << " sector " << i);
      // Samples lie on the faces: they are never nearer. They may miss what is thinner than their steps.
      if (sampled[i] < kNothingKnown) CHECK(found[i] <= sampled[i] + 1e-4F);
      if (sampled[i] < kNothingKnown && found[i] < sampled[i] - 0.05F) {
        // Then only at a sliver: a neighbour must explain it.
        const std::size_t before = (i + kObstacleSectors - 1) % kObstacleSectors;
        const std::size_t after = (i + 1) % kObstacleSectors;
        CHECK(found[i] >= std::min(sampled[before], sampled[after]) - 0.05F);
      }
    }
  }
}

}  // namespace
}  // namespace swiftlet
