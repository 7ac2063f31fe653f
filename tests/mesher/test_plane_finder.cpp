// Planes in meshes of known surfaces: found where they are, followed, merged, forgotten; none where none is.

#include "mesher/plane_finder.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <set>

#include "tests/mesher/plane_scene.hpp"

using namespace swiftlet;
using Eigen::Vector3d;
using test::addRoom;
using test::PlaneScene;

namespace {

const ReportedPlane* facing(const PlaneReport& report, const Vector3d& normal) {
  for (const ReportedPlane& plane : report.planes) {
    if (plane.normal.dot(normal) > std::cos(0.1)) return &plane;
  }
  return nullptr;
}

std::size_t pointsOn(const PlaneReport& report, std::uint64_t plane) {
  return static_cast<std::size_t>(
      std::count_if(report.points.begin(), report.points.end(),
                    [plane](const ReportedPoint& p) { return p.plane == plane; }));
}

struct Finder {
  std::unique_ptr<PlaneFinder> finder = std::make_unique<PlaneFinder>();
  std::unique_ptr<PlaneReport> report = std::make_unique<PlaneReport>();

  const PlaneReport& step(const PlaneScene& scene) {
    REQUIRE(finder->step(*scene.mesh, *scene.window, *report).ok());
    return *report;
  }
};

}  // namespace

TEST_CASE("A room's floor, ceiling and walls are found where they are", "[mesher][planes]") {
  const double yaw = GENERATE(0.0, 0.4, 2.9);
  const Vector3d half(3, 2.5, 1.5);
  const Vector3d viewer(0.4, -0.3, 0.1);
  PlaneScene scene(7, 0.02);
  Finder planes;
  for (int k = 0; k < 8; ++k) {
    scene.begin(viewer + 0.05 * k * Vector3d(1, 1, 0));
    addRoom(scene, half, yaw);
    const PlaneReport& report = planes.step(scene);
    if (k < 3) CHECK(report.planes.empty());  // not proven yet
  }
  const PlaneReport& report = *planes.report;
  REQUIRE(report.planes.size() == 6);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).toRotationMatrix();
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const Vector3d inward = -sign * (R * Vector3d::Unit(axis));
      const ReportedPlane* plane = facing(report, inward);
      REQUIRE(plane != nullptr);
      CHECK(plane->normal.norm() == Approx(1).margin(1e-6));
      CHECK(std::acos(std::min(1.0, plane->normal.dot(inward))) < 0.01);
      CHECK(plane->distance == Approx(-half[axis]).margin(0.02));
      CHECK(plane->direction == (axis == 2 ? PlaneDirection::kHorizontal : PlaneDirection::kVertical));
      CHECK(pointsOn(report, plane->id) > 30);
    }
  }
  // Each landmark once, on the surface that it was drawn on, best known first.
  std::set<TrackId> seen;
  for (const ReportedPoint& point : report.points) {
    CHECK(seen.insert(point.id).second);
    const auto plane = std::find_if(report.planes.begin(), report.planes.end(),
                                    [&](const ReportedPlane& p) { return p.id == point.plane; });
    REQUIRE(plane != report.planes.end());
    const MeshVertex& vertex = scene.mesh->vertices[point.id - 1];
    REQUIRE(vertex.id == point.id);
    const double height = plane->normal.dot(vertex.p_world.cast<double>()) - plane->distance;
    CHECK(std::abs(height) <= (point.firm ? 0.05 : 0.1));
  }
}

TEST_CASE("A hall's walls are found, too", "[mesher][planes]") {
  PlaneScene scene(7, 0.02);
  Finder planes;
  for (int k = 0; k < 8; ++k) {
    scene.begin(0.05 * k * Vector3d(1, 1, 0));
    addRoom(scene, {25, 18, 3}, 0.4);
    planes.step(scene);
  }
  CHECK(planes.report->planes.size() == 6);
}

TEST_CASE("Points that are known best come first", "[mesher][planes]") {
  PlaneScene scene(3, 0.01);
  Finder planes;
  for (int k = 0; k < 6; ++k) {
    scene.begin(Vector3d::Zero());
    addRoom(scene, {2, 2, 1.5}, 0.1);
    for (WindowLandmark& landmark : scene.window->landmarks) {
      landmark.inverse_depth_sigma *= 1 + 0.1 * static_cast<double>((landmark.id * 7919) % 10);
    }
    planes.step(scene);
  }
  const auto sigma = [&](TrackId id) {
    const WindowLandmark& landmark = scene.window->landmarks[id - 1];
    return landmark.inverse_depth_sigma * landmark.p_world.squaredNorm();
  };
  REQUIRE(planes.report->points.size() > 100);
  for (std::size_t i = 1; i < planes.report->points.size(); ++i) {
    CHECK(sigma(planes.report->points[i - 1].id) <= sigma(planes.report->points[i].id) * 1.0001);
  }
}

TEST_CASE("No plane in a cloud or on a ball", "[mesher][planes]") {
  const std::uint64_t seed = GENERATE(1, 2, 3, 4, 5, 6);
  PlaneScene scene(seed, 0.01);
  Finder planes;
  SECTION("a cloud of triangles, the same one and ever another") {
    const bool same = seed % 2 == 0;
    for (int k = 0; k < 12; ++k) {
      if (same) scene.random = Random(seed, 9);
      scene.begin(Vector3d::Zero());
      scene.addCloud({1.5, -1.5, -1.5}, {3.5, 1.5, 1.5}, 300, 0.15);
      CHECK(planes.step(scene).planes.empty());
    }
  }
  SECTION("a ball") {
    // Of 1 m: 5 cm of it lie within a disc of 31 cm.
    for (int k = 0; k < 12; ++k) {
      scene.begin(Vector3d::Zero());
      const Vector3d centre(0, 3, 0);
      constexpr int kRings = 12;
      for (int i = 0; i <= kRings; ++i) {
        for (int j = 0; j <= kRings; ++j) {
          const double a = (-0.5 + static_cast<double>(i) / kRings) * 2.4;
          const double b = (-0.5 + static_cast<double>(j) / kRings) * 2.4;
          scene.add(centre + Vector3d(std::sin(a) * std::cos(b), -std::cos(a) * std::cos(b), std::sin(b)));
        }
      }
      for (std::uint32_t i = 0; i < kRings; ++i) {
        for (std::uint32_t j = 0; j < kRings; ++j) {
          const std::uint32_t c = i * (kRings + 1) + j;
          scene.addFace({c, c + kRings + 1, c + 1});
          scene.addFace({c + 1, c + kRings + 1, c + kRings + 2});
        }
      }
      CHECK(planes.step(scene).planes.empty());
    }
  }
  SECTION("a strip, and a patch too small") {
    for (int k = 0; k < 12; ++k) {
      scene.begin(Vector3d::Zero());
      scene.addSheet({{-2, 2, -1}, {4, 0, 0}, {0, 0.2, 0}, 20, 2});
      scene.addSheet({{-0.2, 2, 0.4}, {0.4, 0, 0}, {0, 0.4, 0}, 5, 5});
      CHECK(planes.step(scene).planes.empty());
    }
  }
  SECTION("the front of a column, the edge of a shelf far beside it, and faces across") {
    for (int k = 0; k < 12; ++k) {
      scene.begin(Vector3d::Zero());
      scene.addSheet({{-0.1, 2, -1}, {0.15, 0, 0}, {0, 0, 2}, 1, 8});
      scene.addSheet({{0.55, 2, -1}, {0.02, 0, 0}, {0, 0, 2}, 1, 8});
      for (std::uint32_t j = 0; j < 8; ++j) {
        const std::uint32_t left = 2 * j + 1;  // the column's right edge and the shelf's left one
        const std::uint32_t right = 18 + 2 * j;
        scene.addFace({left, right, right + 2});
        scene.addFace({left, right + 2, left + 2});
      }
      CHECK(planes.step(scene).planes.empty());
    }
  }
  SECTION("a slope, neither floor nor wall") {
    for (int k = 0; k < 12; ++k) {
      scene.begin(Vector3d::Zero());
      scene.addSheet({{-2, 1, -1}, {4, 0, 0}, {0, 1.6, 1.6}, 10, 10});
      CHECK(planes.step(scene).planes.empty());
    }
  }
}

TEST_CASE("A plane keeps its id while the estimate moves, and while nobody looks", "[mesher][planes]") {
  PlaneScene scene(11, 0.01);
  Finder planes;
  std::uint64_t floor = 0;
  for (int k = 0; k < 40; ++k) {
    scene.begin(Vector3d::Zero());
    const bool looking = k < 15 || k > 22;
    const double drift = 0.004 * k;  // m
    if (looking) scene.addSheet({{-2, -2, -1 + drift}, {4, 0, 0}, {0, 4, 0}, 9, 9});
    const PlaneReport& report = planes.step(scene);
    if (k == 10) {
      REQUIRE(report.planes.size() == 1);
      floor = report.planes[0].id;
      CHECK(report.points.size() > 50);
    }
    if (!looking) CHECK(report.points.empty());
    if (k == 39) {
      REQUIRE(report.planes.size() == 1);
      CHECK(report.planes[0].id == floor);
      CHECK(report.planes[0].distance == Approx(-1 + drift).margin(0.005));
    }
  }
  CHECK(planes.finder->counters().confirmed == 1);
}

TEST_CASE("A plane is forgotten after its lifetime, and a new one has a new id", "[mesher][planes]") {
  PlaneScene scene(12, 0.01);
  Finder planes;
  const auto fly = [&](int keyframes, bool looking) {
    for (int k = 0; k < keyframes; ++k) {
      scene.begin(Vector3d::Zero());
      if (looking) scene.addSheet({{-2, -2, -1}, {4, 0, 0}, {0, 4, 0}, 9, 9});
      planes.step(scene);
    }
  };
  fly(6, true);
  REQUIRE(planes.report->planes.size() == 1);
  const std::uint64_t first = planes.report->planes[0].id;
  fly(130, false);
  CHECK(planes.report->planes.empty());
  CHECK(planes.finder->counters().expired == 1);
  fly(2, true);
  CHECK(planes.report->planes.empty());
  fly(4, true);
  REQUIRE(planes.report->planes.size() == 1);
  CHECK(planes.report->planes[0].id != first);
}

TEST_CASE("Two that become one are merged under the older id", "[mesher][planes]") {
  PlaneScene scene(13, 0.006);
  Finder planes;
  std::uint64_t older = 0;
  for (int k = 0; k < 40; ++k) {
    scene.begin(Vector3d::Zero());
    // Two tables, the second 14 cm higher at first.
    const double gap = std::max(0.0, 0.14 - 0.005 * std::max(0, k - 8));
    scene.addSheet({{-2, 0.5, -1}, {1.6, 0, 0}, {0, 1.6, 0}, 7, 7});
    if (k >= 2) scene.addSheet({{0.4, 0.5, -1 + gap}, {1.6, 0, 0}, {0, 1.6, 0}, 7, 7});
    const PlaneReport& report = planes.step(scene);
    if (k == 8) {
      REQUIRE(report.planes.size() == 2);
      older = std::min(report.planes[0].id, report.planes[1].id);
    }
  }
  REQUIRE(planes.report->planes.size() == 1);
  CHECK(planes.report->planes[0].id == older);
  CHECK(planes.finder->counters().merged >= 1);
  CHECK(planes.report->points.size() > 90);
}

TEST_CASE("A landmark that leaves its plane is dropped, one in front is never taken", "[mesher][planes]") {
  PlaneScene scene(14, 0.004);
  Finder planes;
  const auto named = [&](TrackId id) {
    return std::any_of(planes.report->points.begin(), planes.report->points.end(),
                       [id](const ReportedPoint& p) { return p.id == id; });
  };
  constexpr TrackId kLeaves = 45;
  constexpr TrackId kInFront = 57;
  for (int k = 0; k < 20; ++k) {
    scene.begin(Vector3d::Zero());
    scene.addSheet({{-2, -2, -1}, {4, 0, 0}, {0, 4, 0}, 9, 9});
    const auto lift = [&](TrackId id, double height) {
      scene.mesh->vertices[id - 1].p_world.z() = static_cast<float>(-1 + height);
    };
    lift(kInFront, 0.07);
    if (k >= 10) lift(kLeaves, 0.06);
    planes.step(scene);
    CHECK_FALSE(named(kInFront));
    if (k >= 6 && k < 10) CHECK(named(kLeaves));
    if (k >= 10) CHECK_FALSE(named(kLeaves));
  }
  CHECK(planes.finder->counters().points_dropped >= 1);
}

TEST_CASE("How far from its plane a landmark may be follows from its noise, up to a limit",
          "[mesher][planes]") {
  struct Point {
    TrackId id;
    double sigma;   // m, along the normal; a surface adds 8 mm
    double height;  // m, over the floor
    bool firm;      // found on the plane by itself
    bool named;     // reported on it, firm or spread over
  };
  // Known to 4 mm: 9 mm with the surface's own. Firm within 2.5 sigmas and 35 mm, spread over within 3.5
  // sigmas and half a metre.
  const std::vector<Point> points{{34, 0.004, 0.018, true, true},   {37, 0.004, 0.026, false, true},
                                  {64, 0.004, 0.040, false, false}, {67, 0.030, 0.030, true, true},
                                  {40, 0.030, 0.045, false, true},  {61, 0.300, 0.450, false, true},
                                  {93, 0.300, 0.550, false, false}, {31, 0.004, 0.010, true, true}};
  PlaneScene scene(16, 0.002);
  Finder planes;
  const auto place = [&](const Point& point) {
    MeshVertex& vertex = scene.mesh->vertices[point.id - 1];
    vertex.p_world.z() = static_cast<float>(-1 + point.height);
    const double depth = static_cast<double>(vertex.p_world.norm());
    const double cosine = std::abs(static_cast<double>(vertex.p_world.z())) / depth;
    scene.window->landmarks[point.id - 1].inverse_depth_sigma = point.sigma / cosine / (depth * depth);
  };
  for (int k = 0; k < 12; ++k) {
    scene.begin(Vector3d::Zero());
    scene.addSheet({{-2, -2, -1}, {4, 0, 0}, {0, 4, 0}, 9, 9});
    for (const Point& point : points) place(point);
    planes.step(scene);
  }
  const auto find = [&](TrackId id) {
    return std::find_if(planes.report->points.begin(), planes.report->points.end(),
                        [id](const ReportedPoint& p) { return p.id == id; });
  };
  for (const Point& point : points) {
    CAPTURE(point.id, point.sigma, point.height);
    const auto* found = find(point.id);
    CHECK((found != planes.report->points.end()) == point.named);
    if (found != planes.report->points.end()) CHECK(found->firm == point.firm);
  }
  // What is on the plane already may go a little further before it leaves.
  const std::vector<Point> moved{
      {34, 0.004, 0.028, true, true}, {67, 0.030, 0.060, false, true}, {31, 0.004, 0.036, false, false}};
  scene.begin(Vector3d::Zero());
  scene.addSheet({{-2, -2, -1}, {4, 0, 0}, {0, 4, 0}, 9, 9});
  for (const Point& point : moved) place(point);
  planes.step(scene);
  for (const Point& point : moved) {
    CAPTURE(point.id, point.sigma, point.height);
    const auto* found = find(point.id);
    CHECK((found != planes.report->points.end()) == point.named);
    if (found != planes.report->points.end()) CHECK(found->firm == point.firm);
  }
}

TEST_CASE("Bad meshes: counted, harmless", "[mesher][planes]") {
  PlaneScene scene(15, 0.01);
  Finder planes;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int k = 0; k < 8; ++k) {
    scene.begin(Vector3d::Zero());
    addRoom(scene, {2, 2, 1.5}, 0.3);
    scene.mesh->vertices[3].p_world.x() = nan;
    scene.mesh->vertices[40].p_world.y() = std::numeric_limits<float>::infinity();
    scene.mesh->vertices[41].p_world.setZero();
    scene.window->landmarks[60].inverse_depth_sigma = std::nan("");
    scene.window->landmarks[61].inverse_depth_sigma = -1;
    scene.mesh->vertices[70].id = scene.mesh->vertices[71].id;  // twice
    scene.addFace({1, 2, 60000});
    scene.addFace({5, 5, 5});
    planes.step(scene);
  }
  CHECK(planes.report->planes.size() == 6);
  std::set<TrackId> seen;
  for (const ReportedPoint& point : planes.report->points) {
    CHECK(seen.insert(point.id).second);
    for (const TrackId bad : {4, 41, 42, 61, 62}) CHECK(point.id != bad);
  }
  for (const ReportedPlane& plane : planes.report->planes) {
    CHECK(plane.normal.allFinite());
    CHECK(std::isfinite(plane.distance));
  }
  CHECK(planes.finder->counters().refused > 0);

  SECTION("nowhere to look from") {
    scene.window->poses.back().T_world_body.translation.x() = std::nan("");
    CHECK(planes.finder->step(*scene.mesh, *scene.window, *planes.report).code == StatusCode::kInvalidInput);
    CHECK(planes.report->planes.empty());
  }
  SECTION("another epoch's window") {
    scene.window->epoch = 4;
    CHECK(planes.finder->step(*scene.mesh, *scene.window, *planes.report).code == StatusCode::kInvalidInput);
  }
  SECTION("an empty mesh") {
    scene.begin(Vector3d::Zero());
    planes.step(scene);
    CHECK(planes.report->points.empty());
  }
  SECTION("a new epoch starts anew") {
    scene.mesh->epoch = 1;
    scene.window->epoch = 1;
    planes.step(scene);
    CHECK(planes.report->epoch == 1);
    CHECK(planes.report->planes.empty());
  }
  SECTION("a jump of the pose") {
    scene.begin({400, 0, 0});
    addRoom(scene, {2, 2, 1.5}, 0.3);
    planes.step(scene);
    CHECK(planes.report->planes.size() <= 6);
  }
}

TEST_CASE("The same meshes give the same report twice", "[mesher][planes]") {
  Finder a;
  Finder b;
  for (Finder* finder : {&a, &b}) {
    PlaneScene scene(21, 0.03);
    for (int k = 0; k < 10; ++k) {
      scene.begin(Vector3d::Zero());
      addRoom(scene, {3, 2.5, 1.5}, 0.7);
      scene.addCloud({-1, -1, -1}, {1, 1, 1}, 80, 0.1);
      finder->step(scene);
    }
  }
  REQUIRE(a.report->planes.size() == b.report->planes.size());
  REQUIRE(a.report->points.size() == b.report->points.size());
  for (std::size_t i = 0; i < a.report->planes.size(); ++i) {
    CHECK(a.report->planes[i].id == b.report->planes[i].id);
    CHECK(a.report->planes[i].normal == b.report->planes[i].normal);
    CHECK(a.report->planes[i].distance == b.report->planes[i].distance);
  }
  for (std::size_t i = 0; i < a.report->points.size(); ++i)
    CHECK(a.report->points[i].id == b.report->points[i].id);
}
