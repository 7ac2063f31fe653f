// The distance field beside brute force over all surface points and all unknown cells, through random
// surfaces that come, move and go, and while the window follows a vehicle.

#include "mapping/distance/distance_field.hpp"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <limits>
#include <map>
#include <set>
#include <thread>
#include <vector>

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

double nearestPoint(const Surface& surface, const Eigen::Vector3d& at_cells) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [cell, offset] : surface) {
    const Eigen::Vector3d point = cell.cast<double>().array() + 0.5 + offset.cast<double>().array();
    nearest = std::min(nearest, (point - at_cells).norm());
  }
  return nearest;
}

double nearestUnknown(const std::set<Eigen::Vector3i, Before>& known, const DistanceField& field,
                      const Eigen::Vector3d& at_cells) {
  double nearest = std::numeric_limits<double>::infinity();
  const Eigen::Vector3i& n = field.limits().cells;
  for (int z = -1; z <= n.z(); ++z) {
    for (int y = -1; y <= n.y(); ++y) {
      for (int x = -1; x <= n.x(); ++x) {
        const Eigen::Vector3i cell = field.origin() + Eigen::Vector3i(x, y, z);
        if (known.contains(cell)) continue;
        const Eigen::Array3d low = cell.cast<double>().array() - at_cells.array();
        nearest = std::min(nearest, low.max(-low - 1).max(0.0).matrix().norm());
      }
    }
  }
  return nearest;
}

struct Verdict {
  double worst = 0;  ///< cells, of those with a distance
  int distances = 0, at_least = 0, unknown = 0;
  int too_far = 0;  ///< "at least" above the truth
  int missing = 0;  ///< "at least" although surface is well within reach, and nearer than the window's edge
};

/// Random points of the window beside brute force.
Verdict judge(const DistanceField& field, const Surface& surface, Random& random) {
  const Eigen::Vector3i& n = field.limits().cells;
  const double size = field.limits().cell_size;
  Verdict verdict;
  for (int i = 0; i < 2000; ++i) {
    Eigen::Vector3d from;
    for (int axis = 0; axis < 3; ++axis) from[axis] = random.uniform(0.5, n[axis] - 0.5);
    const Eigen::Vector3d at = field.origin().cast<double>() + from;
    const DistanceSample sample = field.query(at * size);
    const double truth = nearestPoint(surface, at);
    const double edge = std::min(from.minCoeff(), (n.cast<double>() - from).minCoeff());
    switch (sample.kind) {
      case DistanceKind::kUnknown:
        ++verdict.unknown;
        break;
      case DistanceKind::kAtLeast:
        ++verdict.at_least;
        verdict.too_far += std::abs(sample.distance) / size > truth ? 1 : 0;
        verdict.missing += truth < std::min<double>(field.limits().reach, edge) - 3 ? 1 : 0;
        break;
      case DistanceKind::kDistance:
        ++verdict.distances;
        verdict.worst = std::max(verdict.worst, std::abs(std::abs(sample.distance) / size - truth));
        break;
    }
  }
  return verdict;
}

/// All cells but those that `window` holds.
void freeRest(DistanceField& field, const Eigen::Vector3i& window) {
  const Eigen::Vector3i& n = field.limits().cells;
  std::array<Space, kDistanceStep> row;
  row.fill(Space::kFree);
  for (int z = 0; z < n.z(); ++z) {
    for (int y = 0; y < n.y(); ++y) {
      for (int x = 0; x < n.x(); x += kDistanceStep) {
        const Eigen::Vector3i cell = field.origin() + Eigen::Vector3i(x, y, z);
        const Eigen::Array3i from = (cell - window).array();
        if ((from < 0).any() || (from >= n.array()).any()) field.setSpaces(cell, 0xFF, row);
      }
    }
  }
}

void freeAll(DistanceField& field) { freeRest(field, field.origin() - field.limits().cells); }

void setSpace(DistanceField& field, const Eigen::Vector3i& cell, Space space) {
  std::array<Space, kDistanceStep> row;
  row.fill(space);
  const int within = cell.x() & (kDistanceStep - 1);
  field.setSpaces(cell - Eigen::Vector3i(within, 0, 0), 1U << static_cast<unsigned>(within), row);
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
  field.setSurface(cell, Space::kFree, {offset, {}});
  surface[cell] = offset;
}

}  // namespace

TEST_CASE("a single surface point gives its Euclidean distance everywhere within reach") {
  Random random(1);
  DistanceField field(smallLimits());
  freeAll(field);
  Surface surface;
  setOne(field, surface, {3, -2, 1}, {0.25F, -0.5F, 0.125F});
  field.update({});
  const Verdict verdict = judge(field, surface, random);
  // The point is kept to 1/126 of a cell; between cells' middles the distance is not linear, most of all next
  // to a point.
  CHECK(verdict.worst < 0.6);
  CHECK(verdict.distances > 80);
  CHECK(verdict.at_least > 200);
  CHECK(verdict.unknown + verdict.too_far + verdict.missing == 0);
}

TEST_CASE("surfaces that come and go leave no false distance behind") {
  Random random(7);
  DistanceField field(smallLimits());
  freeAll(field);
  Surface surface;
  for (int round = 0; round < 12; ++round) {
    for (int i = 0; i < 40; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
    while (surface.size() > 120) {
      auto gone = surface.begin();
      std::advance(gone, static_cast<int>(random.uniform(0, static_cast<double>(surface.size()) - 1e-9)));
      setSpace(field, gone->first, Space::kFree);
      surface.erase(gone);
    }
    // Before the update what is gone is "at least" as far as it was, or the others' distance.
    const Verdict before = judge(field, surface, random);
    CHECK(before.unknown == 0);
    field.update({});
    const Verdict verdict = judge(field, surface, random);
    CHECK(verdict.worst < 1);
    CHECK(verdict.unknown + verdict.too_far + verdict.missing == 0);
  }
}

TEST_CASE("a wall gives its distance to a tenth of a cell, signed, with its normal") {
  DistanceField field(smallLimits());
  const double wall = 0.53;  // m, the plane x = 0.53; free before it
  for (int x = -24; x < 24; ++x) {
    for (int y = -20; y < 20; ++y) {
      for (int z = -16; z < 16; ++z) {
        const Eigen::Vector3i cell(x, y, z);
        const double to = (wall - field.centreOf(cell).x()) / field.limits().cell_size;
        const Space space = to > 0 ? Space::kFree : Space::kBehindSurface;
        if (std::abs(to) <= 0.5) {
          field.setSurface(cell, space, {{static_cast<float>(to), 0, 0}, {}});
        } else {
          setSpace(field, cell, space);
        }
      }
    }
  }
  field.update({});
  for (double x = -0.4; x < 1.2; x += 0.031) {
    const DistanceSample sample = field.query({x, 0.11, -0.07});
    REQUIRE(sample.kind == DistanceKind::kDistance);
    CHECK(sample.distance == Approx(wall - x).margin(0.01));
    CHECK(sample.gradient.x() == Approx(-1).margin(0.02));
    CHECK(sample.space ==
          (field.centreOf(field.cellOf({x, 0, 0})).x() < wall ? Space::kFree : Space::kBehindSurface));
    CHECK(sample.clearance() <= std::max(sample.distance, 0.0));
  }
}

TEST_CASE("a point half a cell from the middle is kept along every axis") {
  DistanceField field(smallLimits());
  freeAll(field);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3f offset(i & 1 ? 0.5F : -0.5F, i & 2 ? 0.5F : -0.5F, i & 4 ? 0.5F : -0.5F);
    field.setSurface({3, -2, 1}, Space::kFree, {offset, {}});
    field.update({});
    const Eigen::Vector3d point = Eigen::Vector3d(3.5, -1.5, 1.5) + offset.cast<double>();
    const Eigen::Vector3d at = (point + Eigen::Vector3d(5, 0.5, 0)).array().floor() + 0.5;  // a cell's middle
    CHECK(field.query(at * 0.1).distance == Approx(0.1 * (at - point).norm()).margin(1e-6));
  }
}

TEST_CASE("a sheet thinner than a cell gives the distance to the side that one looks at") {
  DistanceField field(smallLimits());
  freeAll(field);
  for (int y = -20; y < 20; ++y) {
    for (int z = -16; z < 16; ++z)
      field.setSurface({3, y, z}, Space::kBehindSurface, {{0.25F, 0, 0}, {true, false, false}});
  }
  field.update({});
  const double size = field.limits().cell_size;
  for (const double from : {-6.0, -2.5, -1.0, 1.0, 1.5, 7.0}) {
    const DistanceSample sample = field.query(Eigen::Vector3d(3.5 + from, 0.2, 0.7) * size);
    REQUIRE(sample.kind == DistanceKind::kDistance);
    CHECK(sample.distance == Approx((std::abs(from) - 0.25) * size).margin(0.02 * size));
  }
}

TEST_CASE("a window that follows the vehicle forgets what leaves and keeps what stays") {
  Random random(3);
  DistanceField field(smallLimits());
  freeAll(field);
  Surface surface;
  for (int i = 0; i < 150; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
  Eigen::Vector3d vehicle = Eigen::Vector3d::Zero();
  std::size_t moves = 0;
  for (int step = 0; step < 30; ++step) {
    vehicle += Eigen::Vector3d(random.uniform(-0.5, 1), random.uniform(-0.3, 0.6), random.uniform(-0.2, 0.2));
    const Eigen::Vector3i before = field.origin();
    if (field.follow(vehicle)) ++moves;
    // What enters is given anew, as the map thread does.
    freeRest(field, before);
    for (auto it = surface.begin(); it != surface.end();)
      it = inWindow(field, it->first) ? std::next(it) : surface.erase(it);
    for (int i = 0; i < 10; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
    if (step % 5 != 4) continue;
    field.update({});
    const Verdict verdict = judge(field, surface, random);
    CHECK(verdict.worst < 1);
    CHECK(verdict.too_far == 0);
    CHECK(verdict.distances > 30);
  }
  CHECK(moves > 5);
}

TEST_CASE("a jump further than the window leaves an unknown one") {
  DistanceField field(smallLimits());
  freeAll(field);
  Surface surface;
  setOne(field, surface, {0, 0, 0}, Eigen::Vector3f::Zero());
  field.update({});
  REQUIRE(field.query({0.5, 0.3, 0}).kind == DistanceKind::kDistance);
  REQUIRE(field.follow({100, -200, 50}));
  for (int round = 0; round < 2; ++round) {
    CHECK(field.query({0.5, 0.3, 0}).kind == DistanceKind::kUnknown);
    CHECK(field.query({100, -200, 50}).kind == DistanceKind::kUnknown);
    field.update({});
  }
}

TEST_CASE("clearance ends where the unknown begins") {
  Random random(9);
  DistanceField field(smallLimits());
  std::set<Eigen::Vector3i, Before> known;
  // Free space with holes that nobody looked into.
  const Eigen::Vector3i& n = field.limits().cells;
  for (int z = 0; z < n.z(); ++z) {
    for (int y = 0; y < n.y(); ++y) {
      for (int x = 0; x < n.x(); ++x) known.insert(field.origin() + Eigen::Vector3i(x, y, z));
    }
  }
  for (int i = 0; i < 12; ++i) known.erase(randomCell(field, random));
  for (const Eigen::Vector3i& cell : known) setSpace(field, cell, Space::kFree);
  field.update({});
  const double size = field.limits().cell_size;
  double gained = 0, possible = 0;
  for (int i = 0; i < 300; ++i) {
    Eigen::Vector3d at;
    for (int axis = 0; axis < 3; ++axis)
      at[axis] = field.origin()[axis] + random.uniform(0.5, field.limits().cells[axis] - 0.5);
    const DistanceSample sample = field.query(at * size);
    const bool is_known = known.contains(field.cellOf(at * size));
    REQUIRE((sample.kind == DistanceKind::kUnknown) == !is_known);
    const double truth = nearestUnknown(known, field, at);
    REQUIRE(sample.known_to <= truth * size + 1e-9);
    REQUIRE(sample.clearance() <= sample.known_to);
    gained += sample.known_to;
    possible += std::min<double>(truth, field.limits().reach) * size;
  }
  CHECK(gained > 0.6 * possible);
}

TEST_CASE("a sample says which images are in it, and when newer ones are not") {
  DistanceField field(smallLimits());
  freeAll(field);
  CHECK(field.query({0, 0, 0}).clearance() == 0);
  field.announce(Stamp{100});
  CHECK(field.query({0, 0, 0}).stale);
  field.update(Stamp{100});
  CHECK_FALSE(field.query({0, 0, 0}).stale);
  CHECK(field.query({0, 0, 0}).kind == DistanceKind::kAtLeast);
  field.announce(Stamp{200});
  field.update(Stamp{100});  // not all of the newest was given
  CHECK(field.query({0, 0, 0}).stale);
  CHECK(field.query({0, 0, 0}).up_to == Stamp{100});
}

TEST_CASE("the gradient is the numeric derivative of the interpolated distance") {
  DistanceField field(smallLimits());
  Surface surface;
  Random random(12);
  freeAll(field);
  for (int i = 0; i < 30; ++i) setOne(field, surface, randomCell(field, random), randomOffset(random));
  field.update({});
  constexpr double kStep = 1e-7;  // m: within one cell's trilinear piece, but for a chance of 1e-5
  int compared = 0;
  for (int n = 0; n < 500; ++n) {
    const Eigen::Vector3d at(random.uniform(-1.9, 1.9), random.uniform(-1.7, 1.7), random.uniform(-1.3, 1.3));
    const DistanceSample sample = field.query(at);
    if (sample.kind != DistanceKind::kDistance) continue;
    Eigen::Vector3d slope;
    for (int axis = 0; axis < 3; ++axis) {
      const DistanceSample before = field.query(at - kStep * Eigen::Vector3d::Unit(axis));
      const DistanceSample after = field.query(at + kStep * Eigen::Vector3d::Unit(axis));
      slope[axis] = (after.distance - before.distance) / (2 * kStep);
    }
    if (slope.norm() < 0.1) continue;  // between two surfaces
    ++compared;
    CHECK((sample.gradient - slope.normalized()).norm() < 1e-4);
  }
  CHECK(compared > 200);
}

TEST_CASE("points that are not finite or far away are unknown") {
  DistanceField field(smallLimits());
  freeAll(field);
  field.update({});
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(NAN, 0, 0), Eigen::Vector3d(1e9, 0, 0), Eigen::Vector3d(3, 0, 0)}) {
    const DistanceSample sample = field.query(at);
    CHECK(sample.kind == DistanceKind::kUnknown);
    CHECK(sample.clearance() == 0);
  }
}

TEST_CASE("a reader beside the writer sees no distance that was never true") {
  // Two walls stand from the beginning to the end, others come and go between them: nothing is ever farther
  // than the walls, and nothing nearer than what once stood.
  DistanceField field(smallLimits());
  freeAll(field);
  Surface all;
  for (int y = -20; y < 20; ++y) {
    for (int z = -16; z < 16; ++z) {
      setOne(field, all, {-9, y, z}, Eigen::Vector3f::Zero());
      setOne(field, all, {9, y, z}, Eigen::Vector3f::Zero());
    }
  }
  const Surface walls = all;
  std::vector<Eigen::Vector3i> guests;
  Random choice(6);
  for (int i = 0; i < 40; ++i) {
    guests.emplace_back(static_cast<int>(choice.uniform(-8, 9)), static_cast<int>(choice.uniform(-9, 9)),
                        static_cast<int>(choice.uniform(-6, 6)));
    all[guests.back()] = Eigen::Vector3f::Zero();
  }
  field.update({});
  std::atomic<bool> done{false};
  std::atomic<int> wrong{0}, asked{0};
  std::thread reader([&] {
    Random random(5);
    while (!done.load()) {
      const Eigen::Vector3d at(random.uniform(-6, 6), random.uniform(-6, 6), random.uniform(-4, 4));
      const DistanceSample sample = field.query(at * field.limits().cell_size);
      asked.fetch_add(1);
      const double distance = sample.distance / field.limits().cell_size;
      const bool fits = sample.kind != DistanceKind::kUnknown && sample.gradient.allFinite() &&
                        distance < nearestPoint(walls, at) + 1 &&
                        (sample.kind == DistanceKind::kAtLeast || distance > nearestPoint(all, at) - 1);
      wrong.fetch_add(fits ? 0 : 1);
    }
  });
  for (int round = 0; round < 100 || asked.load() < 1000; ++round) {
    for (const Eigen::Vector3i& guest : guests) {
      if (choice.uniform(0, 1) < 0.5) {
        field.setSurface(guest, Space::kFree, {});
      } else {
        setSpace(field, guest, Space::kFree);
      }
    }
    field.update({});
  }
  done.store(true);
  reader.join();
  CHECK(wrong.load() == 0);
}
