// `swiftlet mesh`: the mesher alone with given poses, from the command line to its files.

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/lab/modules/mesh_run.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/run_summary.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::messageOf;
using test::run;
using test::summaryIn;
using test::textOf;

Trajectory poses(const std::string& file) {
  LogCounters counters;
  LogWarnings warnings;
  return readTrajectory(file, counters, warnings);
}

void write(const std::string& file, const Trajectory& trajectory) {
  LineFile out(file);
  for (const TrajectoryPoint& point : trajectory) out.write(formatTum(point.stamp, point.T_world_body));
}

struct Row {
  std::uint64_t frame = 0;
  bool keyframe = false;
  std::string frame_mesh, horizon_mesh;
  std::vector<double> hull;
};

std::vector<Row> readFrames(const std::string& folder) {
  std::ifstream file(fs::path(folder) / "meshes" / "frames.csv");
  std::string line;
  std::getline(file, line);
  CHECK(line == "frame,stamp [ns],keyframe,frame_mesh,horizon_mesh,hull [px: u v ...]");
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    std::vector<std::string> fields(1);
    for (const char c : line) {
      if (c == ',') {
        fields.emplace_back();
      } else {
        fields.back() += c;
      }
    }
    REQUIRE(fields.size() == 6);
    Row row{std::stoull(fields[0]), fields[2] == "1", fields[3], fields[4], {}};
    std::istringstream hull(fields[5]);
    for (double value = 0; hull >> value;) row.hull.push_back(value);
    rows.push_back(row);
  }
  return rows;
}

/// What the input error says; empty without one.
std::string complaint(const MeshRequest& request) {
  return messageOf([&] { (void)runMesh(request, Settings{}); });
}

std::string recordedLog() { return (fs::path(SWIFTLET_TEST_DATA) / "euroc_mh01_4s").string(); }

TEST_CASE("mesh writes what the run folder promises, from real images") {
  const ScratchFolder folder("mesh");
  const std::string out = folder.file("out");
  REQUIRE(run({"mesh", recordedLog(), "--until", "1.5", "--complete", "--out", out}) == kExitDone);
  const auto summary = summaryIn(out);
  const auto meshed = summary["frames"]["meshed"].get<std::size_t>();
  CHECK(meshed >= 25);
  CHECK(summary["frames"]["jumps"] == 0);
  CHECK(summary["timing"]["keyframes"]["count"] == summary["frames"]["keyframes"]);
  const std::vector<Row> rows = readFrames(out);
  REQUIRE(rows.size() == meshed);
  std::size_t keyframes = 0;
  for (const Row& row : rows) {
    REQUIRE_FALSE(row.frame_mesh.empty());
    CHECK(row.hull.size() >= 6);
    CHECK(row.horizon_mesh.empty() != row.keyframe);
    const TriangleMesh mesh = readPly(fs::path(out) / "meshes" / row.frame_mesh);
    CHECK(mesh.faces.size() > 50);
    keyframes += row.keyframe ? 1 : 0;
    if (row.keyframe) CHECK_FALSE(readPly(fs::path(out) / "meshes" / row.horizon_mesh).faces.empty());
  }
  CHECK(keyframes == summary["frames"]["keyframes"]);
  CHECK(keyframes >= 2);
  const TriangleMesh local = readPly(fs::path(out) / "local_mesh.ply");
  CHECK(local.faces.size() == summary["local_mesh"]["faces"]);
  // A hall: metres to some tens of metres away from the camera, with grey values from its images.
  const Trajectory used = poses(fs::path(out) / "trajectory.tum");
  CHECK(used.size() == meshed);
  double grey_sum = 0;
  double square_sum = 0;
  for (std::size_t i = 0; i < local.vertices.size(); ++i) {
    const double distance = (local.vertices[i].cast<double>() - used.back().T_world_body.translation).norm();
    CHECK(distance > 0.3);
    CHECK(distance < 60);
    grey_sum += local.grey[i];
    square_sum += double{static_cast<double>(local.grey[i])} * local.grey[i];
  }
  const double mean = grey_sum / static_cast<double>(local.vertices.size());
  CHECK(square_sum / static_cast<double>(local.vertices.size()) - mean * mean > 100);
  CHECK(readPly(fs::path(out) / "complete_mesh.ply").faces.size() >= local.faces.size());

  SECTION("the same bytes again, with or without the complete mesh; nothing is left of the run before") {
    const std::string stale = out + "/meshes/frame_999999.ply";
    std::ofstream(stale) << "stale";
    const std::string local_before = textOf(fs::path(out) / "local_mesh.ply");
    const std::string rows_before = textOf(fs::path(out) / "meshes" / "frames.csv");
    REQUIRE(run({"mesh", recordedLog(), "--until", "1.5", "--out", out}) == kExitDone);
    CHECK(textOf(fs::path(out) / "local_mesh.ply") == local_before);
    CHECK(textOf(fs::path(out) / "meshes" / "frames.csv") == rows_before);
    CHECK_FALSE(fs::exists(stale));
    CHECK_FALSE(fs::exists(fs::path(out) / "complete_mesh.ply"));
  }
}

TEST_CASE("mesh, fuse and place overwrite their own files only") {
  const ScratchFolder folder("modules");
  const std::string summary = folder.file("summary.json");
  std::ofstream(summary) << "not theirs";
  for (const char* command : {"mesh", "fuse", "place"}) {
    INFO(command);
    CHECK(run({command, recordedLog(), "--out", folder.path()}) == kExitBadInput);
    CHECK(textOf(summary) == "not theirs");
    fs::create_directories(folder.file("flight"));
    std::ofstream(folder.file("flight/swiftlet_run.txt")) << "flight\n";
    CHECK(run({command, recordedLog(), "--out", folder.file("flight")}) == kExitBadInput);
    CHECK_FALSE(fs::exists(folder.file("flight/summary.json")));
    CHECK(textOf(folder.file("flight/swiftlet_run.txt")) == "flight\n");
  }
}

TEST_CASE("replay leaves its newest mesh in the run folder, and all of them on request") {
  const ScratchFolder folder("replay_meshes");
  const std::string out = folder.file("run");
  REQUIRE(run({"replay", recordedLog(), "--until", "1.5", "--mesh-sequence", "--out", out}) == kExitDone);
  const auto counters = summaryIn(out)["counters"]["mesh"];
  const auto poses = summaryIn(out)["counters"]["odometry"]["poses"].get<std::size_t>();
  CHECK(counters["frames"].get<std::size_t>() + counters["too_few_points"].get<std::size_t>() == poses);
  CHECK(counters["skipped"] == 0);
  CHECK(counters["without_image"] == 0);
  const std::vector<Row> rows = readFrames(out);
  CHECK(rows.size() == poses);
  const TriangleMesh local = readPly(fs::path(out) / "local_mesh.ply");
  std::string last;
  for (const Row& row : rows) last = row.horizon_mesh.empty() ? last : row.horizon_mesh;
  const std::string local_bytes = textOf(fs::path(out) / "local_mesh.ply");
  REQUIRE_FALSE(last.empty());
  // The newest is of the last frame, the other of the last keyframe: most of the landmarks are the same.
  const TriangleMesh keyframe = readPly(fs::path(out) / "meshes" / last);
  CHECK(local.faces.size() > 50);
  CHECK(2 * local.vertices.size() > keyframe.vertices.size());

  SECTION("less on request, with the same mesh") {
    REQUIRE(run({"replay", recordedLog(), "--until", "1.5", "--out", out}) == kExitDone);
    CHECK_FALSE(fs::exists(fs::path(out) / "meshes"));
    CHECK(textOf(fs::path(out) / "local_mesh.ply") == local_bytes);
  }
  SECTION("none when it is switched off, with the same poses") {
    const std::string poses_before = textOf(fs::path(out) / "odometry.tum");
    REQUIRE(run({"replay", recordedLog(), "--until", "1.5", "--set", "mesh.enabled=false", "--mesh-sequence",
                 "--out", out}) == kExitDone);
    CHECK(readFrames(out).empty());
    CHECK_FALSE(fs::exists(fs::path(out) / "local_mesh.ply"));
    CHECK_FALSE(summaryIn(out)["counters"].contains("mesh"));
    CHECK(textOf(fs::path(out) / "odometry.tum") == poses_before);
  }
}

TEST_CASE("labels of a simulated flight come into the mesh") {
  const ScratchFolder folder("mesh_labels");
  const std::string flight = folder.file("flight");
  const std::string out = folder.file("out");
  REQUIRE(run({"simulate", "--duration", "0.6", "--seed", "3", "--threads", "2", "--out", flight}) ==
          kExitDone);
  REQUIRE(run({"mesh", flight, "--out", out}) == kExitDone);
  CHECK(summaryIn(out)["frames"]["with_labels"].get<int>() >= 2);
  const TriangleMesh mesh = readPly(fs::path(out) / "local_mesh.ply");
  std::size_t labelled = 0;
  for (const std::uint8_t label : mesh.labels) labelled += label > 0 ? 1 : 0;
  CHECK(3 * labelled > mesh.labels.size());  // the others lie across borders, or came after the last labels
}

TEST_CASE("given poses that are missing, elsewhere, broken or jump") {
  const ScratchFolder folder("mesh_poses");
  const std::string flight = folder.file("flight");
  const std::string out = folder.file("out");
  REQUIRE(run({"simulate", "--tracks", "--duration", "3", "--seed", "7", "--out", flight}) == kExitDone);
  const std::string truth = flight + "/mav0/state_groundtruth_estimate0/data.csv";
  const std::string file = folder.file("given.tum");
  Trajectory given = poses(truth);
  MeshRequest request;
  request.log = flight;
  request.trajectory = file;
  request.out = out;

  SECTION("tracks in place of images give meshes too") {
    write(file, given);
    const MeshRunResult result = runMesh(request, Settings{});
    CHECK(result.has_mesh);
    CHECK(result.summary["frames"]["without_pose"] == 0);
    CHECK(result.summary["counters"]["epochs"] == 1);
  }
  SECTION("no file, no truth") {
    CHECK(complaint(request).find("given.tum") != std::string::npos);
    CHECK(run({"mesh", flight, "--trajectory", file, "--out", out}) == kExitBadInput);
    fs::remove_all(flight + "/mav0/state_groundtruth_estimate0");
    request.trajectory.clear();
    CHECK(complaint(request).find("--trajectory") != std::string::npos);
    CHECK(run({"mesh", flight, "--out", out}) == kExitBadInput);
    CHECK_FALSE(fs::exists(out));
  }
  SECTION("a trajectory of another time") {
    for (TrajectoryPoint& point : given) point.stamp = point.stamp + Duration::fromSeconds(1000);
    write(file, given);
    CHECK(complaint(request).find("no image has a pose") != std::string::npos);
    CHECK(run({"mesh", flight, "--trajectory", file, "--out", out}) == kExitBadInput);
    CHECK_FALSE(fs::exists(out));
  }
  SECTION("poses that are no numbers") {
    LineFile broken(file);
    for (const TrajectoryPoint& point : given)
      broken.write(formatSeconds(point.stamp) + " nan nan nan 0 0 0 1");
    CHECK(complaint(request).find("not finite") != std::string::npos);
    CHECK(run({"mesh", flight, "--trajectory", file, "--out", out}) == kExitBadInput);
    CHECK_FALSE(fs::exists(out));
  }
  SECTION("frames in a gap of the poses are left out and counted") {
    Trajectory gappy;
    for (const TrajectoryPoint& point : given) {
      const double t = (point.stamp - given.front().stamp).seconds();
      if (t < 1.0 || t > 1.52) gappy.push_back(point);
    }
    write(file, gappy);
    const MeshRunResult result = runMesh(request, Settings{});
    const auto left_out = result.summary["frames"]["without_pose"].get<int>();
    CHECK(left_out >= 9);
    CHECK(left_out <= 12);
    CHECK(result.summary["counters"]["epochs"] == 1);
  }
  SECTION("a jump begins a new mesh") {
    for (TrajectoryPoint& point : given) {
      if ((point.stamp - given.front().stamp).seconds() > 1.5) point.T_world_body.translation.x() += 100;
    }
    write(file, given);
    const MeshRunResult result = runMesh(request, Settings{});
    CHECK(result.summary["frames"]["jumps"] == 1);
    CHECK(result.summary["counters"]["epochs"] == 2);
    CHECK(result.summary["warnings"].dump().find("jump") != std::string::npos);
    for (const Eigen::Vector3f& p : readPly(fs::path(out) / "local_mesh.ply").vertices) CHECK(p.x() > 50);
  }
}

}  // namespace
}  // namespace swiftlet
