// Frame and horizon meshes of scenes whose surfaces are known; bad input; what is allocated; what a planner
// asks.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "estimator/core/random.hpp"
#include "mesher/obstacle_queries.hpp"
#include "tests/mesher/mesh_scene.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)
using namespace swiftlet::test;

namespace {

constexpr double kWall = 4.0;  // m, distance of the wall z = kWall

/// A grid of landmarks on the wall, ids from `first`, `step` m apart.
void addWall(MeshScene& scene, TrackId first, double step = 0.4, double half = 1.6, double z = kWall) {
  for (double y = -half; y <= half + 1e-9; y += step) {
    for (double x = -half; x <= half + 1e-9; x += step) scene.add(first++, {x, y, z});
  }
}

std::unique_ptr<LocalMesh> horizonOf(const MeshStage& stage) {
  auto mesh = std::make_unique<LocalMesh>();
  stage.horizonMesh(*mesh);
  return mesh;
}

std::unique_ptr<LocalMesh> frameOf(const MeshStage& stage) {
  auto mesh = std::make_unique<LocalMesh>();
  stage.frameMesh(*mesh);
  return mesh;
}

double areaOf(const LocalMesh& mesh) {
  double area = 0;
  for (const MeshFace& face : mesh.faces) {
    const Eigen::Vector3f a = mesh.vertices[face.vertex[0]].p_world;
    area +=
        0.5 *
        (mesh.vertices[face.vertex[1]].p_world - a).cross(mesh.vertices[face.vertex[2]].p_world - a).norm();
  }
  return area;
}

SE3 at(double x, double y, double z) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, y, z)}; }

}  // namespace

TEST_CASE("a wall's features become a wall, facing the camera") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  MeshScene scene(rig, at(0, 0, 0), 1);
  addWall(scene, 1);
  REQUIRE(stage.step(scene.input()).ok());
  for (const auto& mesh : {frameOf(stage), horizonOf(stage)}) {
    CHECK(mesh->vertices.size() == 81);
    CHECK(mesh->faces.size() == 128);
    CHECK(areaOf(*mesh) == Approx(3.2 * 3.2).epsilon(1e-4));
    for (const MeshFace& face : mesh->faces) {
      const Eigen::Vector3f a = mesh->vertices[face.vertex[0]].p_world;
      const Eigen::Vector3f normal =
          (mesh->vertices[face.vertex[1]].p_world - a).cross(mesh->vertices[face.vertex[2]].p_world - a);
      CHECK(normal.z() < 0);
    }
  }
  CHECK(stage.hull().size() >= 4);
}

TEST_CASE("a thing in front of a wall is not joined to it") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  MeshScene scene(rig, at(0, 0, 0), 1);
  addWall(scene, 1);
  addWall(scene, 1000, 0.1, 0.2, 1.5);
  REQUIRE(stage.step(scene.input()).ok());
  const auto mesh = frameOf(stage);
  double between = 0;
  for (const MeshFace& face : mesh->faces) {
    float low = 10;
    float high = 0;
    for (const std::uint32_t v : face.vertex) {
      low = std::min(low, mesh->vertices[v].p_world.z());
      high = std::max(high, mesh->vertices[v].p_world.z());
    }
    between += high - low > 0.1F ? 1 : 0;
  }
  CHECK(between == 0);
  CHECK(areaOf(*mesh) > 0.4 * 0.4 + 5);  // the thing whole, and the wall around it
}

TEST_CASE("a floor that runs away is one surface, however steep its faces look") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  MeshScene scene(rig, at(0, 0, 0), 1);
  // 1 m below the camera, 2.2 to 12 m away: near its end a face reaches 1 m and a fifth of its distance
  // along a line of sight that it meets at 5 degrees.
  TrackId id = 1;
  for (double z = 2.2; z < 12; z *= 1.2) {
    for (int i = -3; i <= 3; ++i) scene.add(id++, {0.1 * i * z, 1, z});
  }
  REQUIRE(stage.step(scene.input()).ok());
  double kept = 0;
  double all = 0;
  for (const FrameFace& face : stage.frame().faces()) {
    all += 1;
    kept += face.verdict == FaceVerdict::kKept ? 1 : 0;
  }
  // Those at its ends have but one face beside them.
  CHECK(kept / all > 0.85);
}

TEST_CASE("a diagonal joins what is at one distance") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  MeshScene scene(rig, at(0, 0, 0), 1);
  // Seen from the camera a rhombus, its short diagonal from 2 to 4: Delaunay's.
  scene.add(1, {-0.5, 0, 2});
  scene.add(2, {0, -0.4, 2});
  scene.add(3, {0.5, 0, 2});
  scene.add(4, {0, 0.8, 4});
  REQUIRE(stage.step(scene.input()).ok());
  REQUIRE(stage.frame().faces().size() == 2);
  for (const FrameFace& face : stage.frame().faces()) {
    const bool far = std::ranges::find(face.point, 3) != face.point.end();
    CHECK(face.verdict == (far ? FaceVerdict::kTorn : FaceVerdict::kKept));
  }
}

TEST_CASE("faces with unknown depth, thin or torn ones are judged by name") {
  const Rig rig = pinholeRig();
  const auto verdictOf = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                             double sigma) {
    MeshStage stage(rig, {});
    MeshScene scene(rig, at(0, 0, 0), 1);
    scene.add(1, a, true, sigma);
    scene.add(2, b);
    scene.add(3, c);
    static_cast<void>(stage.step(scene.input()));
    REQUIRE(stage.frame().faces().size() == 1);
    return stage.frame().faces()[0].verdict;
  };
  CHECK(verdictOf({0, 0, 4}, {0.5, 0, 4}, {0, 0.5, 4}, 0.001) == FaceVerdict::kKept);
  CHECK(verdictOf({0, 0, 4}, {0.5, 0, 4}, {0, 0.5, 4}, 0.03) == FaceVerdict::kUnknown);
  // A hall's: ten times as large, and as far.
  CHECK(verdictOf({0, 0, 40}, {5, 0, 40}, {0, 5, 40}, 0.0001) == FaceVerdict::kKept);
  CHECK(verdictOf({0, 0, 4}, {0.5, 0, 4}, {0.25, 0.01, 4}, 0.001) == FaceVerdict::kThin);
  CHECK(verdictOf({0, 0, 4}, {0.1, 0, 4}, {0.05, 0.06, 4.6}, 0.001) == FaceVerdict::kTorn);
}

TEST_CASE("the horizon follows its landmarks and forgets those that left") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  {
    MeshScene scene(rig, at(0, 0, 0), 1);
    addWall(scene, 1);
    REQUIRE(stage.step(scene.input()).ok());
  }
  SECTION("new places") {
    MeshScene scene(rig, at(0, 0, 0), 2);
    addWall(scene, 1, 0.4, 1.6, kWall + 0.05);
    REQUIRE(stage.step(scene.input()).ok());
    const auto mesh = horizonOf(stage);
    for (const MeshVertex& vertex : mesh->vertices) {
      CHECK(vertex.p_world.z() == Approx(kWall + 0.05));
    }
  }
  SECTION("still in the window, seen by no track") {
    MeshScene scene(rig, at(0, 0, 0), 2);
    for (int i = 0; i < 81; ++i) {
      scene.add(static_cast<TrackId>(1 + i), {-1.6 + 0.4 * (i % 9), -1.6 + 0.4 * (i / 9), kWall}, false);
    }
    CHECK(stage.step(scene.input()).code == StatusCode::kDegenerate);
    CHECK(frameOf(stage)->faces.empty());
    CHECK(horizonOf(stage)->faces.size() == 128);
  }
  SECTION("left the window") {
    MeshScene scene(rig, at(0, 0, 0), 2);
    addWall(scene, 1000, 0.4, 0.8);
    REQUIRE(stage.step(scene.input()).ok());
    CHECK(horizonOf(stage)->vertices.size() == 25);
    CHECK(horizonOf(stage)->faces.size() == 32);
  }
}

TEST_CASE("kept for the whole flight, nothing leaves") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {.vertices = 10'000, .faces = 20'000, .keep_all = true});
  MeshScene first(rig, at(0, 0, 0), 1);
  addWall(first, 1);
  REQUIRE(stage.step(first.input()).ok());
  MeshScene second(rig, at(4, 0, 0), 2);
  for (int i = 0; i < 25; ++i) {
    second.add(static_cast<TrackId>(1000 + i), {3.2 + 0.4 * (i % 5), -0.8 + 0.4 * (i / 5), kWall});
  }
  static_cast<void>(stage.step(second.input()));
  CHECK(stage.counters().pose_jumps == 1);  // 4 m in 50 ms
  MeshScene third(rig, at(4, 0, 0), 3);
  for (int i = 0; i < 25; ++i) {
    third.add(static_cast<TrackId>(1000 + i), {3.2 + 0.4 * (i % 5), -0.8 + 0.4 * (i / 5), kWall});
  }
  REQUIRE(stage.step(third.input()).ok());
  CHECK(stage.horizon().vertices().size() == 81 + 25);
  CHECK(stage.horizon().faces().size() == 128 + 32);
}

TEST_CASE("a landmark seen through an old face takes it out, one in front of it does not") {
  const Rig rig = pinholeRig();
  for (const double z : {6.0, 2.0}) {
    MeshStage stage(rig, {});
    MeshScene before(rig, at(0, 0, 0), 1);
    before.add(1, {-0.4, -0.4, kWall});
    before.add(2, {0.4, -0.4, kWall});
    before.add(3, {0, 0.4, kWall});
    REQUIRE(stage.step(before.input()).ok());
    REQUIRE(horizonOf(stage)->faces.size() == 1);
    MeshScene after(rig, at(0, 0, 0), 2);
    after.add(1, {-0.4, -0.4, kWall}, false);
    after.add(2, {0.4, -0.4, kWall}, false);
    after.add(3, {0, 0.4, kWall}, false);
    after.add(4, {0, 0, z});
    static_cast<void>(stage.step(after.input()));
    CHECK(horizonOf(stage)->faces.size() == (z > kWall ? 0 : 1));
    CHECK(stage.horizon().counters().refuted == (z > kWall ? 1 : 0));
  }
}

TEST_CASE("a newer frame joins the same vertices otherwise") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  MeshScene before(rig, at(0, 0, 0), 1);
  before.add(1, {-0.4, -0.4, kWall});
  before.add(2, {0.4, -0.4, kWall});
  before.add(3, {0, 0.4, kWall});
  REQUIRE(stage.step(before.input()).ok());
  MeshScene after(rig, at(0, 0, 0), 2);
  after.add(1, {-0.4, -0.4, kWall});
  after.add(2, {0.4, -0.4, kWall});
  after.add(3, {0, 0.4, kWall});
  after.add(4, {0, -0.1, kWall});
  REQUIRE(stage.step(after.input()).ok());
  CHECK(horizonOf(stage)->faces.size() == 3);
  CHECK(stage.horizon().counters().replaced == 1);
}

TEST_CASE("a face that a newer frame finds torn leaves the horizon") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  const auto step = [&](std::uint64_t frame, double far) {
    MeshScene scene(rig, at(0, 0, 0), frame);
    scene.add(1, {0, 0, 4});
    scene.add(2, {0.1, 0, 4});
    scene.add(3, {0.05, 0.06, far});
    static_cast<void>(stage.step(scene.input()));
    REQUIRE(stage.frame().faces().size() == 1);
    return stage.frame().faces()[0].verdict;
  };
  REQUIRE(step(1, 4.20) == FaceVerdict::kKept);
  REQUIRE(horizonOf(stage)->faces.size() == 1);
  REQUIRE(step(2, 4.27) == FaceVerdict::kTorn);
  CHECK(horizonOf(stage)->faces.empty());
}

TEST_CASE("a face's label changes by majority") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kWidth * kHeight), 3);
  const auto step = [&](std::uint64_t index, std::uint8_t label) {
    std::fill(pixels.begin(), pixels.end(), label);
    MeshScene scene(rig, at(0, 0, 0), index);
    addWall(scene, 1);
    MeshInput input = scene.input();
    input.labels = {pixels.data(), kWidth, kHeight, kWidth};
    REQUIRE(stage.step(input).ok());
    return stage.horizon().faces()[0].label;
  };
  CHECK(step(1, 3) == 3);
  CHECK(step(2, 3) == 3);
  CHECK(step(3, 5) == 3);
  CHECK(step(4, 5) == 3);
  CHECK(step(5, 5) == 5);
}

TEST_CASE("faces across a border between labels have none") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kWidth * kHeight), 3);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (i % kWidth >= kWidth / 2 + 20) pixels[i] = 4;  // midway between two columns of vertices
  }
  MeshScene scene(rig, at(0, 0, 0), 1);
  addWall(scene, 1);
  MeshInput input = scene.input();
  input.labels = {pixels.data(), kWidth, kHeight, kWidth};
  REQUIRE(stage.step(input).ok());
  const auto mesh = frameOf(stage);
  for (const MeshFace& face : mesh->faces) {
    float x = 0;
    for (const std::uint32_t v : face.vertex) x += mesh->vertices[v].p_world.x() / 3;
    const bool across = x > 0 && x < 0.4F;
    CHECK(face.label == (across ? kNoLabel : x < 0 ? 3 : 4));
  }
}

TEST_CASE("bad input is skipped and counted") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  MeshScene scene(rig, at(0, 0, 0), 1);
  addWall(scene, 1);
  SECTION("landmarks") {
    static_cast<void>(scene.window->landmarks.tryPushBack({500, {nan, 0, 4}, 0.001, 3}));
    static_cast<void>(scene.window->landmarks.tryPushBack({501, {0, infinity, 4}, 0.001, 3}));
    static_cast<void>(scene.window->landmarks.tryPushBack({7, {1, 1, 1}, 0.001, 3}));
    REQUIRE(stage.step(scene.input()).ok());
    CHECK(stage.counters().bad_landmarks == 3);
    CHECK(horizonOf(stage)->faces.size() == 128);
  }
  SECTION("features") {
    TrackedFeature feature = scene.tracks->features[0];
    feature.pixel[0].x() = std::numeric_limits<float>::quiet_NaN();
    feature.id = 900;
    static_cast<void>(scene.tracks->features.tryPushBack(feature));
    feature.id = 901;
    feature.pixel[0] = {-5, 10};
    static_cast<void>(scene.tracks->features.tryPushBack(feature));
    feature = scene.tracks->features[40];  // in the middle of the wall, twice
    static_cast<void>(scene.tracks->features.tryPushBack(feature));
    REQUIRE(stage.step(scene.input()).ok());
    CHECK(stage.counters().bad_features == 4);
    CHECK(frameOf(stage)->vertices.size() == 80);
  }
  SECTION("fewer than three") {
    MeshScene two(rig, at(0, 0, 0), 1);
    two.add(1, {0, 0, 4});
    two.add(2, {1, 0, 4});
    CHECK(stage.step(two.input()).code == StatusCode::kDegenerate);
    CHECK(stage.counters().too_few_points == 1);
  }
  SECTION("not of one frame, no pose, a pose that is not finite") {
    scene.tracks->index = 2;
    CHECK(stage.step(scene.input()).code == StatusCode::kInvalidInput);
    scene.tracks->index = 1;
    scene.window->poses.back().T_world_body.translation.x() = nan;
    CHECK(stage.step(scene.input()).code == StatusCode::kInvalidInput);
    scene.window->poses.clear();
    CHECK(stage.step(scene.input()).code == StatusCode::kInvalidInput);
    CHECK(stage.step({}).code == StatusCode::kInvalidInput);
    CHECK(stage.counters().invalid_frames == 4);
  }
  SECTION("a new epoch") {
    REQUIRE(stage.step(scene.input()).ok());
    MeshScene other(rig, at(50, 0, 0), 2);
    other.window->epoch = 1;
    for (int i = 0; i < 3; ++i) other.add(static_cast<TrackId>(1 + i), {50 + 0.4 * i, 0.3 * (i % 2), kWall});
    REQUIRE(stage.step(other.input()).ok());
    CHECK(stage.counters().epochs == 2);
    CHECK(stage.counters().pose_jumps == 0);
    CHECK(horizonOf(stage)->vertices.size() == 3);
  }
}

TEST_CASE("with planes the meshes are drawn flat, as far as the landmarks' noise allows") {
  constexpr double kNoise = 0.015;  // m
  const Rig rig = pinholeRig();
  Random random(3);
  std::vector<Eigen::Vector3d> points;
  for (double y = -1.6; y <= 1.6; y += 0.32) {
    for (double x = -1.6; x <= 1.6; x += 0.32) points.emplace_back(x, y, kWall + kNoise * random.normal());
  }
  const auto fly = [&](MeshStage& stage) {
    int reports = 0;
    for (std::uint64_t k = 1; k <= 8; ++k) {
      MeshScene scene(rig, at(0.05 * static_cast<double>(k), 0, 0), k);
      for (std::size_t i = 0; i < points.size(); ++i) {
        scene.add(1 + i, points[i], true, kNoise / (kWall * kWall));
      }
      REQUIRE(stage.step(scene.input()).ok());
      reports += stage.newPlanes() != nullptr ? 1 : 0;
    }
    return reports;
  };
  const auto rms = [](const LocalMesh& mesh) {
    double sum = 0;
    for (const MeshVertex& v : mesh.vertices) sum += std::pow(static_cast<double>(v.p_world.z()) - kWall, 2);
    return std::sqrt(sum / static_cast<double>(mesh.vertices.size()));
  };
  MeshStage plain(rig, {});
  CHECK(fly(plain) == 0);
  CHECK(plain.newPlanes() == nullptr);
  MeshStage drawn(rig, {}, {.enabled = true, .surface_sigma = 0.003});
  CHECK(fly(drawn) == 8);
  REQUIRE(drawn.newPlanes()->planes.size() == 1);
  CHECK(drawn.newPlanes()->planes[0].direction == PlaneDirection::kHorizontal);
  CHECK(drawn.newPlanes()->planes[0].distance == Approx(-kWall).margin(0.01));
  CHECK(rms(*horizonOf(drawn)) < 0.4 * rms(*horizonOf(plain)));
  CHECK(rms(*frameOf(drawn)) < 0.4 * rms(*frameOf(plain)));
  drawn.reset();
  CHECK(drawn.newPlanes() == nullptr);
  CHECK(horizonOf(drawn)->faces.empty());
}

TEST_CASE("full meshes refuse what is new, counted, and stay whole") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {.vertices = 40, .faces = 30, .keep_all = false});
  MeshScene scene(rig, at(0, 0, 0), 1);
  addWall(scene, 1);
  REQUIRE(stage.step(scene.input()).ok());
  CHECK(stage.horizon().vertices().size() == 40);
  CHECK(stage.horizon().faces().size() == 30);
  CHECK(stage.horizon().counters().refused >= 41);
  for (const HorizonMesh::Face& face : stage.horizon().faces()) {
    for (const std::uint32_t v : face.vertex) CHECK(v < 40);
  }
}

TEST_CASE("random windows: faces name vertices, no face twice, vertices in order") {
  const Rig rig = pinholeRig();
  MeshStage stage(rig, {.vertices = 500, .faces = 700, .keep_all = false});
  Random random(5);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 600; ++i) {
    points.emplace_back(random.uniform(-6, 6), random.uniform(-3, 3), random.uniform(2, 7));
  }
  for (std::uint64_t k = 1; k <= 60; ++k) {
    MeshScene scene(rig, at(-3 + 0.1 * static_cast<double>(k), 0, 0), k);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (random.uniform(0, 1) < 0.3) continue;
      scene.add(1 + i, points[i], random.uniform(0, 1) < 0.5);
    }
    static_cast<void>(stage.step(scene.input()));
    const auto vertices = stage.horizon().vertices();
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const HorizonMesh::Face& face : stage.horizon().faces()) {
      auto v = face.vertex;
      std::sort(v.begin(), v.end());
      faces.push_back(v);
      REQUIRE(v[2] < vertices.size());
      REQUIRE((v[0] != v[1] && v[1] != v[2]));
    }
    std::sort(faces.begin(), faces.end());
    CHECK(std::adjacent_find(faces.begin(), faces.end()) == faces.end());
    CHECK(std::adjacent_find(vertices.begin(), vertices.end(), [](const MeshVertex& a, const MeshVertex& b) {
            return a.id >= b.id;
          }) == vertices.end());
  }
}

TEST_CASE("rays and boxes meet the nearest face, as a dense sampling does") {
  Random random(11);
  const auto mesh = std::make_unique<LocalMesh>();
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3f centre(static_cast<float>(random.uniform(-3, 3)),
                                 static_cast<float>(random.uniform(-3, 3)),
                                 static_cast<float>(random.uniform(-3, 3)));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3f corner = centre + Eigen::Vector3f(static_cast<float>(random.uniform(-1, 1)),
                                                              static_cast<float>(random.uniform(-1, 1)),
                                                              static_cast<float>(random.uniform(-1, 1)));
      static_cast<void>(mesh->vertices.tryPushBack({static_cast<TrackId>(3 * i + k), corner, 0}));
    }
    const auto first = static_cast<std::uint32_t>(3 * i);
    static_cast<void>(mesh->faces.tryPushBack({{first, first + 1, first + 2}, static_cast<std::uint8_t>(i)}));
  }
  int met = 0;
  for (int run = 0; run < 200; ++run) {
    // Aimed at a point of a face: that face is met, or another before it.
    const auto i = static_cast<std::size_t>(random.uniform(0, 40));
    const auto& face = mesh->faces[std::min<std::size_t>(i, 39)];
    const Eigen::Vector3f target = 0.5F * mesh->vertices[face.vertex[0]].p_world +
                                   0.3F * mesh->vertices[face.vertex[1]].p_world +
                                   0.2F * mesh->vertices[face.vertex[2]].p_world;
    const Eigen::Vector3f origin(8, static_cast<float>(random.uniform(-8, 8)), 1);
    const float distance = (target - origin).norm();
    const auto hit = nearestAlongRay(*mesh, origin, 3 * (target - origin), 100);
    REQUIRE(hit.has_value());
    CHECK(hit->distance <= distance + 1e-4F);
    CHECK((origin + hit->distance * (target - origin).normalized() - hit->point).norm() < 1e-4F);
    CHECK(hit->label == mesh->faces[hit->face].label);
    CHECK_FALSE(nearestAlongRay(*mesh, origin, target - origin, hit->distance - 0.01F).has_value());

    const Eigen::Quaterniond q_box(random.normal(), random.normal(), random.normal(), random.normal());
    const SE3 T_world_box(q_box.normalized(), {random.uniform(-3, 3), random.uniform(-3, 3), 0});
    const Eigen::Vector3f half(0.6F, 0.9F, 0.4F);
    const auto inside = nearestInBox(*mesh, T_world_box, half);
    float nearest = 100;
    const SE3 T_box_world = T_world_box.inverse();
    for (const MeshFace& f : mesh->faces) {
      for (int u = 0; u <= 60; ++u) {
        for (int v = 0; u + v <= 60; ++v) {
          const Eigen::Vector3f a = mesh->vertices[f.vertex[0]].p_world;
          const Eigen::Vector3f p = a +
                                    static_cast<float>(u) / 60 * (mesh->vertices[f.vertex[1]].p_world - a) +
                                    static_cast<float>(v) / 60 * (mesh->vertices[f.vertex[2]].p_world - a);
          const Eigen::Vector3f q = (T_box_world * p.cast<double>()).cast<float>();
          if ((q.cwiseAbs().array() <= half.array()).all()) nearest = std::min(nearest, q.norm());
        }
      }
    }
    if (nearest < 100) REQUIRE(inside.has_value());
    if (!inside.has_value()) continue;
    ++met;
    const Eigen::Vector3f q = (T_box_world * inside->point.cast<double>()).cast<float>();
    CHECK((q.cwiseAbs().array() <= half.array() + 1e-4F).all());
    CHECK(q.norm() == Approx(inside->distance).margin(1e-4));
    CHECK(inside->distance <= nearest + 1e-4F);
    // The sampling is 2/60 m apart, and may miss a corner of the box.
    if (nearest < 100) CHECK(inside->distance >= nearest - 0.05F);
  }
  CHECK(met > 50);
}
