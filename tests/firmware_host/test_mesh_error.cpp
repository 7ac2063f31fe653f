// Meshes judged by a true surface: answers known by hand, queries against brute force.

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/lab/evaluation/evaluate_meshes.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/evaluation/mesh_frames.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d randomPoint(Random& random, double spread) {
  return spread * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

void addTriangle(TriangleMesh& mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c, std::uint8_t label = 0) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3d& p : {a, b, c}) mesh.vertices.push_back(p.cast<float>());
  mesh.faces.push_back({first, first + 1, first + 2});
  mesh.labels.push_back(label);
}

/// The parallelogram over `a`, `a + b`, `a + c`.
void addQuad(TriangleMesh& mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
             std::uint8_t label = 0) {
  addTriangle(mesh, a, a + b, a + b + c, label);
  addTriangle(mesh, a, a + b + c, a + c, label);
}

/// Small and large, thin, without area, repeated, and a fan in one plane.
TriangleMesh awkwardMesh(Random& random) {
  TriangleMesh mesh;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d centre = randomPoint(random, 3);
    const double size = i % 10 == 0 ? 4 : 0.3;
    addTriangle(mesh, centre, centre + randomPoint(random, size), centre + randomPoint(random, size));
  }
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d a = randomPoint(random, 3);
    const Eigen::Vector3d b = randomPoint(random, 3);
    addTriangle(mesh, a, a, a);
    addTriangle(mesh, a, b, a);
    addTriangle(mesh, a, a, b);
    addTriangle(mesh, {1, 2, 3}, {2, 2, 3}, {1, 3, 3});
  }
  for (int i = 0; i < 60; ++i) addTriangle(mesh, {0, 0, -2}, {i * 0.1, 4, -2}, {i * 0.1 + 0.1, 4, -2});
  return mesh;
}

double distanceToSegment(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double squared = (b - a).squaredNorm();
  const double t = squared > 0 ? std::clamp((p - a).dot(b - a) / squared, 0.0, 1.0) : 0;
  return (p - a - t * (b - a)).norm();
}

/// By the plane where the foot lies within, else by the edges: another way than the tree's.
double bruteDistance(const TriangleMesh& mesh, std::size_t face, const Eigen::Vector3d& p) {
  std::array<Eigen::Vector3d, 3> v;
  for (std::size_t k = 0; k < 3; ++k) v[k] = mesh.vertices[mesh.faces[face][k]].cast<double>();
  double best = distanceToSegment(p, v[0], v[1]);
  best = std::min({best, distanceToSegment(p, v[1], v[2]), distanceToSegment(p, v[2], v[0])});
  const Eigen::Vector3d normal = (v[1] - v[0]).cross(v[2] - v[0]);
  if (normal.norm() < 1e-12) return best;
  Eigen::Matrix3d A;
  A << v[1] - v[0], v[2] - v[0], normal.normalized();
  const Eigen::Vector3d x = A.partialPivLu().solve(p - v[0]);
  return x[0] >= 0 && x[1] >= 0 && x[0] + x[1] <= 1 ? std::min(best, std::abs(x[2])) : best;
}

/// Infinity when the ray misses the triangle.
double bruteCast(const TriangleMesh& mesh, std::size_t face, const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& direction) {
  std::array<Eigen::Vector3d, 3> v;
  for (std::size_t k = 0; k < 3; ++k) v[k] = mesh.vertices[mesh.faces[face][k]].cast<double>();
  Eigen::Matrix3d A;
  A << v[1] - v[0], v[2] - v[0], -direction;
  if ((v[1] - v[0]).cross(v[2] - v[0]).norm() < 1e-12) return MeshDistance::kAnyDistance;
  const Eigen::Vector3d x = A.partialPivLu().solve(origin - v[0]);
  const bool hit = x[0] >= 0 && x[1] >= 0 && x[0] + x[1] <= 1 && x[2] >= 0;
  return hit ? x[2] : MeshDistance::kAnyDistance;
}

TEST_CASE("nearest triangle and rays against brute force") {
  Random random(11);
  const TriangleMesh mesh = awkwardMesh(random);
  const MeshDistance tree(mesh);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3d p = randomPoint(random, i % 7 == 0 ? 20 : 3);
    double nearest = MeshDistance::kAnyDistance;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
      nearest = std::min(nearest, bruteDistance(mesh, f, p));
    const auto found = tree.nearest(p);
    REQUIRE(found);
    CHECK(found->distance == Approx(nearest).margin(1e-7));
    CHECK(bruteDistance(mesh, found->face, p) == Approx(nearest).margin(1e-7));
    CHECK(tree.nearest(p, nearest + 1e-6));
    CHECK_FALSE(tree.nearest(p, nearest * (1 - 1e-6) - 1e-6));

    // Every third ray along an axis: zeros in the direction.
    Eigen::Vector3d direction = randomPoint(random, 1).normalized();
    if (i % 3 == 0) direction = Eigen::Vector3d::Unit(i % 9 / 3) * (i % 2 == 0 ? 1 : -1);
    double first = MeshDistance::kAnyDistance;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      first = std::min(first, bruteCast(mesh, f, p, direction));
    }
    const auto hit = tree.cast(p, direction);
    REQUIRE(hit.has_value() == std::isfinite(first));
    if (!hit) continue;
    ++hits;
    CHECK(hit->distance == Approx(first).margin(1e-7));
    CHECK_FALSE(tree.cast(p, direction, first * (1 - 1e-6) - 1e-6));
  }
  CHECK(hits > 100);
  CHECK_FALSE(MeshDistance(TriangleMesh()).nearest({0, 0, 0}));
  CHECK_FALSE(MeshDistance(TriangleMesh()).cast({0, 0, 0}, {0, 0, 1}));
}

TEST_CASE("no ray slips between the triangles of a closed surface") {
  // A sphere of longitudes and latitudes, rays from inside aimed at its vertices and edges.
  TriangleMesh mesh;
  constexpr int kSides = 24;
  const auto at = [](int i, int j) {
    const double theta = kPi * j / kSides;
    const double phi = 2 * kPi * (i % kSides) / kSides;
    return Eigen::Vector3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
  };
  for (int i = 0; i < kSides; ++i) {
    for (int j = 0; j < kSides; ++j) {
      addTriangle(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1));
      addTriangle(mesh, at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  const MeshDistance tree(mesh);
  const Eigen::Vector3d origin(0.1, -0.2, 0.05);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Eigen::Vector3d a = mesh.vertices[mesh.faces[f][0]].cast<double>();
    const Eigen::Vector3d b = mesh.vertices[mesh.faces[f][1]].cast<double>();
    for (const double t : {0.0, 0.3, 0.5}) CHECK(tree.cast(origin, (a + t * (b - a) - origin).normalized()));
  }
}

TEST_CASE("samples lie evenly by area") {
  TriangleMesh mesh;
  addTriangle(mesh, {0, 0, 0}, {3, 0, 0}, {0, 2, 0});     // 3 m^2
  addTriangle(mesh, {5, 0, 0}, {6, 0, 0}, {6, 0, 0});     // none
  addTriangle(mesh, {10, 0, 0}, {11, 0, 0}, {10, 2, 0});  // 1 m^2
  CHECK(areaOf(mesh) == Approx(4));
  const auto samples = sampleSurface(mesh, 1000);
  REQUIRE(samples.size() == 4000);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::size_t first = 0;
  for (const SurfaceSample& sample : samples) {
    CHECK(sample.face != 1);
    if (sample.face != 0) continue;
    ++first;
    sum += sample.point;
    CHECK((sample.point.x() >= 0 && sample.point.y() >= 0 &&
           sample.point.x() / 3 + sample.point.y() / 2 < 1 + 1e-9));
  }
  CHECK(first == 3000);
  CHECK((sum / 3000 - Eigen::Vector3d(1, 2.0 / 3, 0)).norm() < 0.01);
  CHECK(sampleSurface(mesh, 0.01).size() == 1);
  CHECK(sampleSurface(TriangleMesh(), 1000).empty());
}

TEST_CASE("accuracy and labels of planes at known distances") {
  TriangleMesh wall;
  addQuad(wall, {-5, -5, 0}, {5, 0, 0}, {0, 10, 0}, 3);
  addQuad(wall, {0, -5, 0}, {5, 0, 0}, {0, 10, 0}, 4);
  const TrueSurface truth(wall);

  TriangleMesh offset;
  addQuad(offset, {-1, 0, 0.03}, {2, 0, 0}, {0, 1, 0});
  const DistanceStatistics flat = statisticsOf(surfaceError(offset, truth, kSurfaceDensity).distances);
  CHECK(flat.count == 2000);
  for (const double figure : {flat.mean, flat.rmse, flat.median, flat.percentile95}) {
    CHECK(figure == Approx(0.03).epsilon(1e-5));
  }
  // Labels: a quarter of the labelled half is wrong.
  TriangleMesh labelled;
  addQuad(labelled, {-1, 0, 0.01}, {0.75, 0, 0}, {0, 1, 0}, 3);
  addQuad(labelled, {1, 0, 0.05}, {0.25, 0, 0}, {0, 1, 0}, 3);
  addQuad(labelled, {-1, 2, 0.05}, {1, 0, 0}, {0, 1, 0}, 0);
  const SurfaceError error = surfaceError(labelled, truth, kSurfaceDensity);
  CHECK(error.labelShare() == Approx(0.75));
  CHECK(error.unlabelledShare() == Approx(0.5));
  const DistanceStatistics steps = statisticsOf(error.distances);
  CHECK(steps.mean == Approx(0.75 / 2 * 0.01 + 1.25 / 2 * 0.05));
  CHECK(steps.rmse == Approx(std::sqrt(0.375 * 1e-4 + 0.625 * 25e-4)));
  CHECK(steps.median == Approx(0.05));
  CHECK(statisticsOf(std::vector<float>()).count == 0);
  // A slope from 0 to 0.2 m: uniform, so the quantiles are known.
  TriangleMesh slope;
  addQuad(slope, {0, 0, 0}, {1, 0, 0.2}, {0, 1, 0});
  const DistanceStatistics uniform = statisticsOf(surfaceError(slope, truth, 10000).distances);
  CHECK(uniform.mean == Approx(0.1).epsilon(0.01));
  CHECK(uniform.rmse == Approx(0.2 / std::sqrt(3.0)).epsilon(0.01));
  CHECK(uniform.percentile95 == Approx(0.19).epsilon(0.01));
}

CameraModel pinhole() {
  return {CameraKind::kPinholeRadtan, 640, 480, {320, 320, 319.5, 239.5}, Eigen::Vector4d::Zero()};
}

std::vector<Eigen::Vector2f> rectangle(float u0, float v0, float u1, float v1) {
  return {{u0, v0}, {u1, v0}, {u1, v1}, {u0, v1}};
}

TEST_CASE("completeness of half a wall, and the hull's share of the image") {
  const RayGrid grid(pinhole(), 8);
  CHECK(grid.pixels() == 80 * 60);
  TriangleMesh wall;
  addQuad(wall, {-10, -10, 2}, {20, 0, 0}, {0, 20, 0});
  const MeshDistance truth(wall);
  // The camera stands off the origin and turned; the wall with it.
  const SE3 T(expSo3({0.3, -0.8, 2.0}), {4, -2, 1});
  Alignment motion;
  motion.T_to_from = T;
  const MeshDistance moved_truth(moved(wall, motion));
  const SeenSurface seen = seenSurface(grid, rectangle(-1, -1, 640, 480), T, &moved_truth);
  CHECK(seen.polygon_share == 1);
  CHECK(seen.rays.size() == grid.pixels());

  // At 2 m the image is 4 m wide. Mesh on the left half covers 0.1 m of the right one too.
  TriangleMesh half;
  addQuad(half, {-10, -10, 2}, {10, 0, 0}, {0, 20, 0});
  const Completeness share = completenessOf(seen, MeshDistance(moved(half, motion)), &moved_truth);
  CHECK(share.share() == Approx(0.525).margin(0.5 / 80));
  CHECK(share.areaShare() == Approx(share.share()).epsilon(1e-3));
  CHECK(share.seen_area == Approx(12).epsilon(0.001));
  CHECK(share.drawnShare() == Approx(0.5).margin(0.5 / 80));
  CHECK(share.relativeRmse() < 1e-6);
  // 3 cm in front all of it is covered, 11 cm in front nothing; without mesh nothing.
  TriangleMesh front;
  addQuad(front, {-10, -10, 1.97}, {20, 0, 0}, {0, 20, 0});
  CHECK(completenessOf(seen, MeshDistance(moved(front, motion)), &moved_truth).share() == 1);
  // Points at 1.97 m and more from the camera; rays in proportion to the tangent of the angle.
  double squares = 0;
  for (const SeenRay& ray : seen.rays) squares += std::pow(0.03 / (1.97 / 2 * ray.distance), 2);
  CHECK(completenessOf(seen, MeshDistance(moved(front, motion)), &moved_truth).relativeRmse() ==
        Approx(std::sqrt(squares / static_cast<double>(seen.rays.size()))).epsilon(1e-4));
  for (Eigen::Vector3f& p : front.vertices) p.z() = 1.89f;
  CHECK(completenessOf(seen, MeshDistance(moved(front, motion)), &moved_truth).share() == 0);
  CHECK(completenessOf(seen, MeshDistance(TriangleMesh()), nullptr).share() == 0);

  CHECK(seenSurface(grid, rectangle(0, 0, 320, 240), SE3(), &truth).polygon_share == 0.25);
  std::vector<Eigen::Vector2f> turned = rectangle(0, 0, 320, 240);
  std::reverse(turned.begin(), turned.end());
  CHECK(seenSurface(grid, turned, SE3(), &truth).polygon_share == 0.25);
  const std::vector<Eigen::Vector2f> triangle = {{-8, -8}, {648, -8}, {-8, 488}};
  CHECK(seenSurface(grid, triangle, SE3(), &truth).polygon_share == Approx(0.5).margin(0.02));
  turned.resize(2);
  CHECK(seenSurface(grid, turned, SE3(), &truth).polygon_share == 0);
  CHECK(seenSurface(grid, {}, SE3(), &truth).rays.empty());
  // A camera that looks away sees nothing of it.
  const SeenSurface away =
      seenSurface(grid, rectangle(0, 0, 320, 240), SE3(expSo3({kPi, 0, 0}), {0, 0, 0}), &truth);
  CHECK(away.rays.size() == grid.pixels() / 4);
  CHECK(completenessOf(away, MeshDistance(wall), nullptr).seen == 0);
}

TEST_CASE("points weigh the surface that they stand for") {
  // The wall z = 2 + x, seen through |x / z|, |y / z| < 1/2: 8 / sqrt(2) * (2 - 2/9) m^2 of it.
  TriangleMesh wall;
  addQuad(wall, {-20, -20, -18}, {40, 0, 40}, {0, 40, 0});
  const MeshDistance truth(wall);
  const SeenSurface seen =
      seenSurface(RayGrid(pinhole(), 4), rectangle(159.5, 79.5, 479.5, 399.5), SE3(), &truth);
  double area = 0;
  for (const SeenRay& ray : seen.rays) area += ray.area;
  CHECK(area == Approx(8 / std::sqrt(2.0) * (2 - 2.0 / 9)).epsilon(0.01));
}

TEST_CASE("a sequence pools its meshes by area and its frames by pixel") {
  TriangleMesh wall;
  addQuad(wall, {-10, -10, 2}, {20, 0, 0}, {0, 20, 0}, 3);
  const TrueSurface truth(wall);
  const RayGrid grid(pinhole(), 8);
  MeshSequence sequence(&truth, kSurfaceDensity);
  TriangleMesh large;
  addQuad(large, {-10, -10, 2.02}, {20, 0, 0}, {0, 20, 0}, 3);
  TriangleMesh small;
  addQuad(small, {-0.5, -0.5, 2.08}, {1, 0, 0}, {0, 1, 0}, 4);
  sequence.add(large, seenSurface(grid, rectangle(0, 0, 320, 480), SE3(), &truth.distance()));
  sequence.add(small, seenSurface(grid, rectangle(-1, -1, 640, 480), SE3(), &truth.distance()));
  sequence.add({}, seenSurface(grid, rectangle(0, 0, 320, 480), SE3(), &truth.distance()));
  const MeshSequenceAccuracy result = sequence.result();
  CHECK(result.meshes == 3);
  CHECK(result.empty == 1);
  CHECK(result.area == Approx(401));
  CHECK(result.distance.count == 401000);
  CHECK(result.distance.rmse == Approx(std::sqrt((400 * 4e-4 + 64e-4) / 401)).epsilon(1e-4));
  CHECK(result.median_rmse == Approx(0.05).epsilon(1e-4));
  // The small patch and what lies within sqrt(0.1^2 - 0.08^2) m of it, of 12 m^2.
  const double patch = (1 + 4 * 0.06 + kPi * 0.0036) / 12;
  CHECK(result.completeness.share() == Approx((0.5 + patch) / 2).margin(0.01));
  CHECK(result.median_completeness == Approx(patch).margin(0.01));
  CHECK(result.median_hull_share == 0.5);
  CHECK(result.label_share == Approx(400.0 / 401));
  CHECK(sequenceDensity(100) == kSurfaceDensity);
  CHECK(sequenceDensity(1e5) == Approx(kMostSamples / 1e5));
}

TEST_CASE("frames.csv: rows, and what is wrong with one") {
  const ScratchFolder folder("frames");
  const auto read = [&](const std::string& rows) {
    LineFile(folder.file("frames.csv"))
        .write("frame,stamp [ns],keyframe,frame_mesh,horizon_mesh,hull [px: u v ...]\n" + rows);
    return readMeshFrames(folder.path());
  };
  const auto frames = read("3,1000,1,frame_000003.ply,horizon_000003.ply,1.5 2 3 4 5 6\n4,2000,0,,,");
  REQUIRE(frames.size() == 2);
  CHECK(frames[0].frame == 3);
  CHECK(frames[0].stamp.ns == 1000);
  CHECK(frames[0].keyframe);
  CHECK(frames[0].frame_mesh == folder.file("frame_000003.ply"));
  CHECK(frames[0].hull == std::vector<Eigen::Vector2f>{{1.5f, 2}, {3, 4}, {5, 6}});
  CHECK_FALSE(frames[1].keyframe);
  CHECK((frames[1].frame_mesh.empty() && frames[1].horizon_mesh.empty() && frames[1].hull.empty()));
  CHECK(read("").empty());
  for (const char* row : {"3,1000,1,a,b,1 2 3", "3,1000,1,a,b,1 2 nan 4", "x,1000,1,a,b,", "3,1.5,1,a,b,",
                          "3,1000,1", "3,1000,1,a,b,\n4,1000,0,,,"}) {
    CHECK_THROWS_AS(read(row), InputError);
  }
}

// The run's world is turned against the truth's; its mesh is a box around the flight.
TEST_CASE("evaluate --mesh moves the run's meshes onto the truth") {
  const ScratchFolder folder("evaluate_mesh");
  const std::string log = (std::filesystem::path(SWIFTLET_TEST_DATA) / "euroc_mh01_4s").string();
  const Trajectory truth = readTruth(log).poses;
  REQUIRE(truth.size() > 100);
  const SE3 T_run_truth(expSo3({0.1, 0.2, -1.0}), {3, 1, -2});
  Alignment motion;
  motion.T_to_from = T_run_truth;
  Trajectory estimate = truth;
  {
    LineFile odometry(folder.file("trajectory.tum"));
    for (TrajectoryPoint& point : estimate) {
      point.T_world_body = T_run_truth * point.T_world_body;
      odometry.write(formatTum(point.stamp, point.T_world_body));
    }
  }
  TriangleMesh box;
  const Eigen::Vector3d corner = truth[0].T_world_body.translation - Eigen::Vector3d::Constant(5);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d a = 10 * Eigen::Vector3d::Unit((k + 1) % 3);
    const Eigen::Vector3d b = 10 * Eigen::Vector3d::Unit((k + 2) % 3);
    addQuad(box, corner, a, b, 3);
    addQuad(box, corner + 10 * Eigen::Vector3d::Unit(k), a, b, 4);
  }
  const MeshEvaluationRequest request = {folder.path(), log, folder.file("mesh.ply")};
  writePly(request.truth_mesh, box);
  const std::vector<std::string> arguments = {"swiftlet", "evaluate",     folder.path(),      "--truth", log,
                                              "--mesh",   "--truth-mesh", request.truth_mesh, "--json"};
  const auto program = [&] {
    std::vector<std::string> copies = arguments;
    std::vector<char*> pointers;
    for (std::string& argument : copies) pointers.push_back(argument.data());
    return runProgram(static_cast<int>(pointers.size()), pointers.data());
  };
  CHECK(program() == kExitBadInput);  // no meshes

  std::filesystem::create_directories(folder.file("meshes"));
  const TriangleMesh run_box = moved(box, motion);
  writePly(folder.file("local_mesh.ply"), run_box);
  writePly(folder.file("meshes/frame.ply"), run_box);
  writePly(folder.file("meshes/horizon.ply"), run_box);
  {
    LineFile frames(folder.file("meshes/frames.csv"));
    frames.write("frame,stamp [ns],keyframe,frame_mesh,horizon_mesh,hull [px: u v ...]");
    const std::string hull = "-1 -1 375.5 -1 375.5 480 -1 480";
    for (const std::size_t i : {std::size_t{10}, std::size_t{20}}) {
      const bool key = i == 10;
      frames.write(std::to_string(i) + "," + std::to_string(truth[i].stamp.ns) + (key ? ",1" : ",0") +
                   ",frame.ply," + (key ? "horizon.ply," : ",") + hull);
    }
    frames.write("30," + std::to_string(truth[30].stamp.ns) + ",1,,," + hull);
    frames.write("99," + std::to_string(truth.back().stamp.ns + 1'000'000'000) + ",0,frame.ply,," + hull);
  }
  CHECK(program() == kExitDone);
  const MeshAccuracy found = evaluateMeshes(request, estimate, truth, AccuracyOptions());
  CHECK(found.frames == 4);
  CHECK(found.without_truth == 1);
  CHECK(found.keyframes_bare == 1);
  REQUIRE((found.frame && found.horizon && found.complete));
  CHECK(found.frame->meshes == 2);
  CHECK(found.horizon->meshes == 1);
  for (const MeshSequenceAccuracy& sequence : {*found.frame, *found.horizon}) {
    CHECK(sequence.area == Approx(600.0 * static_cast<double>(sequence.meshes)).epsilon(1e-4));
    CHECK(sequence.distance.rmse < 1e-4);
    CHECK(sequence.completeness.share() == 1);
    CHECK(sequence.median_hull_share == Approx(0.5).margin(0.01));
    CHECK(sequence.label_share > 0.999);
  }
  CHECK(found.complete->file == "local_mesh.ply");
  CHECK(found.complete->distance.percentile95 < 1e-4);
  CHECK(found.complete->observed == 0);

  // Half of the box as the complete mesh; of two seen points one is covered.
  TriangleMesh half = run_box;
  half.faces.resize(2);
  half.labels.resize(2);
  writePly(folder.file("complete_mesh.ply"), half);
  TriangleMesh observed;
  observed.vertices = {(corner + Eigen::Vector3d(0, 5, 5)).cast<float>(),
                       (corner + Eigen::Vector3d(10, 5, 5)).cast<float>()};
  writePly(folder.file("observed.ply"), observed);
  const MeshAccuracy again = evaluateMeshes(request, estimate, truth, AccuracyOptions());
  CHECK(again.complete->file == "complete_mesh.ply");
  CHECK(again.complete->observed == 2);
  CHECK(again.complete->covered == 1);

  // A map in a frame of its own: in_map.tum has the run's poses there, or map.tum if loops were searched for.
  Alignment elsewhere;
  elsewhere.T_to_from = SE3(expSo3({0, 0, 0.5}), {7, 0, 0});
  writePly(folder.file("map.ply"), moved(box, elsewhere));
  const auto write_poses = [&](const std::string& name, Duration late) {
    LineFile file(folder.file(name));
    for (const TrajectoryPoint& point : truth)
      file.write(formatTum(point.stamp + late, elsewhere.T_to_from * point.T_world_body));
  };
  const auto evaluated = [&] { return evaluateMeshes(request, estimate, truth, AccuracyOptions()); };
  write_poses("map.tum", Duration{});
  CHECK(evaluated().map->distance.rmse > 0.1);  // of full smoothing alone
  LineFile(folder.file("loops.csv")).write("a header");
  CHECK(evaluated().map->distance.rmse < 1e-4);
  CHECK(evaluated().alignment == "se3 alignment");
  std::filesystem::rename(folder.file("map.tum"), folder.file("in_map.tum"));
  CHECK(evaluated().map->distance.rmse < 1e-4);

  // No pose can be compared: the mesh is judged where it is.
  const Duration hour = Duration::fromSeconds(3600);
  Trajectory late = truth;
  for (TrajectoryPoint& point : late) point.stamp = point.stamp + hour;
  const std::string nothing = "nothing (no pose has a true pose at its stamp)";
  write_poses("in_map.tum", hour);
  CHECK(evaluated().alignment == "se3 alignment; the map by " + nothing);
  std::filesystem::remove(folder.file("in_map.tum"));
  CHECK(evaluateMeshes(request, late, truth, AccuracyOptions()).alignment == nothing);
}

}  // namespace
}  // namespace swiftlet
