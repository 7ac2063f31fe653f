#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::contains;
using test::errorOf;

struct ReadTrajectory {
  LogCounters counters;
  LogWarnings warnings;
  Trajectory poses;
  explicit ReadTrajectory(const std::string& text) {
    poses = readTrajectoryText("file", text, counters, warnings);
  }
};

TEST_CASE("TUM out and in again: exact stamps, poses to 1e-9", "[trajectory]") {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "odometry.tum").string();
  Random random(7);
  Trajectory truth;
  TumWriter writer(path);
  for (int i = 0; i < 200; ++i) {
    TrajectoryPoint point;
    point.stamp.ns = 1403636579763555584 + i * 49'999'999LL;
    const Eigen::Vector3d phi(random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3));
    point.T_world_body = SE3(expSo3(phi), {random.normal(), 10 * random.normal(), random.normal()});
    writer.write(point.stamp, point.T_world_body);
    truth.push_back(point);
  }
  writer.close();
  LogCounters counters;
  LogWarnings warnings;
  const Trajectory got = readTrajectory(path, counters, warnings);
  REQUIRE(got.size() == truth.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    CHECK(got[i].stamp == truth[i].stamp);
    const SE3 d = got[i].T_world_body.inverse() * truth[i].T_world_body;
    CHECK(d.translation.norm() < 2e-9);
    CHECK(logSo3(d.rotation).norm() < 5e-9);
    CHECK(!got[i].has_motion);
  }
  CHECK(warnings.lines().empty());
}

TEST_CASE("a TUM line has exactly 8 columns, qw is not negative", "[trajectory]") {
  const SE3 T(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {1, -2, 3});
  CHECK(formatTum({1403636579763555584}, T) ==
        "1403636579.763555584 1.000000000 -2.000000000 3.000000000 -0.500000000 0.500000000 -0.500000000 "
        "0.500000000");
}

TEST_CASE("stamps of TUM files: seconds or nanoseconds by size, between is refused", "[trajectory]") {
  const std::string pose = " 1 2 3 0 0 0 1\n";
  CHECK(ReadTrajectory("12.5" + pose).poses[0].stamp.ns == 12'500'000'000);
  CHECK(ReadTrajectory("# comment\n1403636579.763555584" + pose).poses[0].stamp.ns == 1403636579763555584);
  CHECK(ReadTrajectory("1403636579763555584.000000" + pose).poses[0].stamp.ns == 1403636579763555584);
  CHECK(ReadTrajectory("1403636579763555584" + pose).poses[0].stamp.ns == 1403636579763555584);
  const InputError error = errorOf([&] { ReadTrajectory("# c\n1403636579763" + pose); });
  CHECK(error.line == 2);
  CHECK(error.field == "timestamp");
}

TEST_CASE("both headers of EuRoC ground truth, quaternion wxyz", "[trajectory]") {
  const std::string row =
      "1403715274302142976,0.878612,2.142470,0.947262,0.060514,-0.828459,-0.058956,-0.553641,0.009474,-0."
      "014009,"
      "-0.002145,-0.002229,0.020700,0.076350,-0.012492,0.547666,0.069073\n";
  for (const char* header : {"#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []\n",
                             "#time(ns),px,py,pz,qw,qx,qy,qz,vx,vy,vz,bwx,bwy,bwz,bax,bay,baz\n", ""}) {
    const ReadTrajectory read(header + row);
    REQUIRE(read.poses.size() == 1);
    const TrajectoryPoint& p = read.poses[0];
    CHECK(p.stamp.ns == 1403715274302142976);
    CHECK(p.T_world_body.translation == Eigen::Vector3d(0.878612, 2.142470, 0.947262));
    CHECK(p.T_world_body.rotation.w() == Approx(0.060514).epsilon(1e-4));
    CHECK(p.T_world_body.rotation.x() == Approx(-0.828459).epsilon(1e-4));
    REQUIRE(p.has_motion);
    CHECK(p.v_world_body == Eigen::Vector3d(0.009474, -0.014009, -0.002145));
    CHECK(p.bias_gyro == Eigen::Vector3d(-0.002229, 0.0207, 0.07635));
    CHECK(p.bias_accel == Eigen::Vector3d(-0.012492, 0.547666, 0.069073));
  }
  CHECK(
      !ReadTrajectory("2235500000,0.094145,-0.561754,1.224272,0.9999092,0.0048240,-0.0061674,-0.0109673,0\n")
           .poses[0]
           .has_motion);
}

TEST_CASE("bad rows of trajectories name file, line and field", "[trajectory]") {
  const ReadTrajectory read(
      "1.0 0 0 0 0 0 0 1\n2.0 0 zero 0 0 0 0 1\n3.0 0 0 0 0 0 0 0.9\n4.0 0 0 0 0 0 0 1\n");
  CHECK(read.poses.size() == 2);
  CHECK(read.counters.bad_rows == 2);
  CHECK(anyContains(read.warnings.lines(), "file:2: ty: `zero`"));
  CHECK(anyContains(read.warnings.lines(), "file:3: quaternion: its norm is 0.9"));
  CHECK(errorOf([] { ReadTrajectory("1.0 0 0 0 0 0 0 0\n"); }).line == 1);
  CHECK(contains(errorOf([] { ReadTrajectory("# nothing\n"); }).message, "no poses"));
  LogCounters counters;
  LogWarnings warnings;
  CHECK(contains(errorOf([&] { readTrajectory("/nonexistent/file", counters, warnings); }).message,
                 "cannot be read"));
  CHECK(contains(errorOf([] { TumWriter writer("/nonexistent/file"); }).message, "cannot be written"));
}

TEST_CASE("UTF-16 is named, a byte order mark of UTF-8 is read", "[trajectory]") {
  const std::string rows = "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n";
  CHECK(ReadTrajectory("\xEF\xBB\xBF" + rows).poses.size() == 2);
  std::string wide("\xFF\xFE", 2);
  for (const char c : rows) wide += {c, '\0'};
  std::string big("\xFE\xFF", 2);
  for (const char c : rows) big += {'\0', c};
  for (const std::string& text : {wide, big}) {
    const InputError error = errorOf([&] { ReadTrajectory{text}; });
    CHECK(contains(error.message, "UTF-16"));
    CHECK(contains(error.remedy, "UTF-8"));
  }
  const test::TempFolder folder;
  const std::string file = (folder.path() / "wide.tum").string();
  test::writeText(file, wide);
  LogCounters counters;
  LogWarnings warnings;
  CHECK(errorOf([&] { readTrajectory(file, counters, warnings); }).file == file);
}

TEST_CASE("a bad stamp is repeated without what steers a terminal", "[trajectory]") {
  const ReadTrajectory read("1 0 0 0 0 0 0 1\n\x1b[2J 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  CHECK(anyContains(read.warnings.lines(), "file:2: timestamp: `?[2J` is not a plain decimal stamp"));
}

}  // namespace
}  // namespace swiftlet
