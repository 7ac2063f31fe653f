// The distance field beside brute force over all surface points, through random surfaces that come, move and
// go, and while the window follows a vehicle.

#include "mapping/distance/distance_field.hpp"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <map>
#include <thread>

#include "estimator/core/random.hpp"

using namespace swiftlet;

namespace {

struct Before {
  bool operator()(const Eigen::Vector3i& a, const Eigen::Vector3i& b) const {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  }
};
using Surface = std::map<Eigen::Vector3i, Eigen::Vector3f, Before>;

DistanceLimits smallLimits() {
  DistanceLimits limits;
  limits.cells = {48, 40, 32};
  limits.cell_size = 0.1;
  limits.reach = 12;
  return limits;
}

bool inWindow(const DistanceField& field, const Eigen::Vector3i& cell) {
  const Eigen::Vector3i from = cell - field.origin();
  return (from.array() >= 0).all() && (from.array() < field.limits().cells.array()).all();
}

void settle(DistanceField& field) {
  while (field.queued() > 0) field.propagate(1000);
}

/// Largest difference [cells] between the field and brute force, where a surface is within reach by either.
double worstError(const DistanceField& field, const Surface& surface) {
  const int reach = field.limits().reach;
  double worst = 0;
  for (int z = 0; z < field.limits().cells.z(); ++z) {
    for (int y = 0; y < field.limits().cells.y(); ++y) {
      for (int x = 0; x < field.limits().cells.x(); ++x) {
        const Eigen::Vector3i cell = field.origin() + Eigen::Vector3i(x, y, z);
        double nearest = reach;
        for (const auto& [at, offset] : surface) {
          if (!inWindow(field, at)) continue;
          nearest = std::min(nearest, static_cast<double>(((at - cell).cast<float>() + offset).norm()));
        }
        const float squared = field.squaredDistance(cell);
        const double found = squared < 0 ? reach : std::min<double>(std::sqrt(squared), reach);
        worst = std::max(worst, std::abs(found - nearest));
      }
    }
  }
  return worst;
}

Eigen::Vector3i randomCell(const DistanceField& field, Random& random) {
  Eigen::Vector3i cell = field.origin();
  for (int i = 0; i < 3; ++i) cell[i] += static_cast<int>(random.uniform(0, field.limits().cells[i] - 1e-9));
  return cell;
}

Eigen::Vector3f randomOffset(Random& random) {
  Eigen::Vector3f offset;
  for (int i = 0; i < 3; ++i) offset[i] = static_cast<float>(random.uniform(-0.5, 0.5));
  return offset;
}

void setOne(DistanceField& field, Surface& surface, const Eigen::Vector3i& cell,
            const Eigen::Vector3f& offset) {
  field.setSurface(cell, Space::kFree, offset);
  surface[cell] = offset;
}

}  // namespace

TEST_CASE("a single surface point gives its Euclidean distance everywhere within reach") {
  DistanceField field(smallLimits());
  Surface surface;
  setOne(field, surface, {3, -2, 1}, {0.25F, -0.5F, 0.125F});
  settle(field);
  CHECK(worstError(field, surface) < 0.02);  // the point is kept to 1/127 of a cell
}

TEST_CASE("surfaces that come and go leave distances within half a cell of brute force") {
  Random random(7);
  DistanceField field(smallLimits());
  Surface surface;
  for (int round = 0; round < 12; ++round) {
    for (int i = 0; i < 40; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
    while (surface.size() > 120) {
      auto gone = surface.begin();
      std::advance(gone, static_cast<int>(random.uniform(0, static_cast<double>(surface.size()) - 1e-9)));
      field.setSpace(gone->first, Space::kFree);
      surface.erase(gone);
    }
    // Not settled in between: changes meet waves that are still on their way.
    field.propagate(2000);
    if (round % 3 != 2) continue;
    settle(field);
    CHECK(worstError(field, surface) < 0.5);
  }
}

TEST_CASE("a wall that is measured better and better stays within half a cell") {
  Random random(11);
  DistanceField field(smallLimits());
  Surface surface;
  for (int round = 0; round < 10; ++round) {
    for (int y = -15; y < 15; ++y) {
      for (int z = -12; z < 12; ++z) {
        const float noise = static_cast<float>(random.normal()) * 0.3F / static_cast<float>(round + 1);
        setOne(field, surface, {5, y, z}, {std::clamp(0.1F + noise, -0.5F, 0.5F), 0, 0});
      }
    }
    settle(field);
    CHECK(worstError(field, surface) < 0.5);
  }
}

TEST_CASE("a window that follows the vehicle forgets what leaves and keeps what stays") {
  Random random(3);
  DistanceField field(smallLimits());
  Surface surface;
  for (int i = 0; i < 150; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
  Eigen::Vector3d vehicle = Eigen::Vector3d::Zero();
  std::size_t moves = 0;
  for (int step = 0; step < 30; ++step) {
    vehicle += Eigen::Vector3d(random.uniform(-0.5, 1), random.uniform(-0.3, 0.6), random.uniform(-0.2, 0.2));
    if (field.follow(vehicle)) ++moves;
    // What enters is given anew, as the map thread does.
    for (int i = 0; i < 10; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
    field.propagate(3000);
    for (auto it = surface.begin(); it != surface.end();)
      it = inWindow(field, it->first) ? std::next(it) : surface.erase(it);
  }
  settle(field);
  CHECK(moves > 5);
  CHECK(worstError(field, surface) < 0.5);
}

TEST_CASE("a jump further than the window leaves an empty one") {
  DistanceField field(smallLimits());
  Surface surface;
  setOne(field, surface, {0, 0, 0}, Eigen::Vector3f::Zero());
  settle(field);
  REQUIRE(field.follow({100, -200, 50}));
  settle(field);
  CHECK(worstError(field, {}) == 0);
  DistanceSample sample;
  CHECK_FALSE(field.query({0, 0, 0}, sample));
  REQUIRE(field.query({100, -200, 50}, sample));
  CHECK_FALSE(sample.bounded);
  CHECK(sample.distance == Approx(1.2));
}

TEST_CASE("a query interpolates the distance to a wall, signed, with its normal") {
  DistanceField field(smallLimits());
  const double wall = 0.53;  // m, the plane x = 0.53; free before it
  for (int x = -20; x < 20; ++x) {
    for (int y = -18; y < 18; ++y) {
      for (int z = -14; z < 14; ++z) {
        const Eigen::Vector3i cell(x, y, z);
        const double to = (wall - field.centreOf(cell).x()) / field.limits().cell_size;
        const Space space = to > 0 ? Space::kFree : Space::kBehindSurface;
        if (std::abs(to) <= 0.5) {
          field.setSurface(cell, space, {static_cast<float>(to), 0, 0});
        } else {
          field.setSpace(cell, space);
        }
      }
    }
  }
  settle(field);
  for (double x = -0.4; x < 1.2; x += 0.031) {
    DistanceSample sample;
    REQUIRE(field.query({x, 0.11, -0.07}, sample));
    REQUIRE(sample.bounded);
    CHECK(sample.distance == Approx(wall - x).margin(0.01));
    CHECK(sample.gradient.x() == Approx(-1).margin(0.02));
    CHECK(sample.space ==
          (field.centreOf(field.cellOf({x, 0, 0})).x() < wall ? Space::kFree : Space::kBehindSurface));
  }
}

TEST_CASE("the gradient is the numeric derivative of the interpolated distance") {
  DistanceField field(smallLimits());
  Surface surface;
  Random random(12);
  for (int x = -20; x < 20; ++x) {
    for (int y = -18; y < 18; ++y) {
      for (int z = -14; z < 14; ++z) field.setSpace({x, y, z}, Space::kFree);
    }
  }
  for (int i = 0; i < 30; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
  settle(field);
  constexpr double kStep = 1e-7;  // m: within one cell's trilinear piece, but for a chance of 1e-5
  int compared = 0;
  for (int n = 0; n < 500; ++n) {
    const Eigen::Vector3d at(random.uniform(-1.9, 1.9), random.uniform(-1.7, 1.7), random.uniform(-1.3, 1.3));
    DistanceSample sample;
    if (!field.query(at, sample) || !sample.bounded) continue;
    Eigen::Vector3d slope;
    for (int axis = 0; axis < 3; ++axis) {
      DistanceSample before, after;
      REQUIRE(field.query(at - kStep * Eigen::Vector3d::Unit(axis), before));
      REQUIRE(field.query(at + kStep * Eigen::Vector3d::Unit(axis), after));
      slope[axis] = (after.distance - before.distance) / (2 * kStep);
    }
    if (slope.norm() < 0.1) continue;  // between two surfaces
    ++compared;
    CHECK((sample.gradient - slope.normalized()).norm() < 1e-4);
  }
  CHECK(compared > 200);
}

TEST_CASE("work is bounded, and the rest goes on in the next step") {
  DistanceField field(smallLimits());
  Surface surface;
  setOne(field, surface, {0, 0, 0}, Eigen::Vector3f::Zero());
  std::size_t steps = 0;
  while (field.queued() > 0) {
    REQUIRE(field.propagate(100) <= 100);
    ++steps;
  }
  CHECK(steps > 50);
  CHECK(worstError(field, surface) < 0.02);
}

TEST_CASE("points that are not finite or far away are outside") {
  DistanceField field(smallLimits());
  DistanceSample sample;
  CHECK_FALSE(field.query({NAN, 0, 0}, sample));
  CHECK_FALSE(field.query({1e9, 0, 0}, sample));
  CHECK_FALSE(field.query({3, 0, 0}, sample));
  CHECK(sample.space == Space::kUnknown);
}

TEST_CASE("a reader beside the writer sees only distances that were true of some surface") {
  DistanceField field(smallLimits());
  std::atomic<bool> done{false};
  std::atomic<int> wrong{0};
  std::atomic<int> asked{0};
  std::thread reader([&] {
    Random random(5);
    while (!done.load()) {
      DistanceSample sample;
      const Eigen::Vector3d at(random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(-1, 1));
      if (!field.query(at, sample)) continue;
      asked.fetch_add(1);
      if (!(std::abs(sample.distance) <= 1.2 + 1e-6) || !sample.gradient.allFinite()) wrong.fetch_add(1);
    }
  });
  Random random(6);
  Surface surface;
  for (int round = 0; round < 200; ++round) {
    const Eigen::Vector3i cell = randomCell(field, random);
    field.setSurface(cell, Space::kFree, randomOffset(random));
    field.propagate(500);
    if (round % 3 == 0) field.setSpace(cell, Space::kFree);
    if (round % 10 == 0) field.follow({random.uniform(-1, 1), random.uniform(-1, 1), 0});
  }
  while (asked.load() < 1000) std::this_thread::yield();
  done.store(true);
  reader.join();
  CHECK(wrong.load() == 0);
}
