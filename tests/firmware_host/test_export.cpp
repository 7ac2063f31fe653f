// Run folders for other programs: ROS conventions, TUM files, what is refused. The bag itself:
// test_run_bag.cpp.

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <sstream>

#include "drivers/input/input_error.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/export/run_bag.hpp"
#include "firmware_host/lab/export/tum_files.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"
#include "tests/firmware_host/exported_run.hpp"
#include "tests/firmware_host/file_size_limit.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

using test::contains;
using test::errorOf;
using test::ExportedRun;
using test::run;
using test::textOf;

NavState someState() {
  NavState state;
  state.T_world_body = SE3(expSo3({0.4, -1.1, 2.0}), {3, -2, 1});
  state.v_world_body = {1.5, -0.5, 0.25};
  Matrix15d root = Matrix15d::Zero();
  for (int i = 0; i < kStateDim; ++i) {
    for (int j = 0; j <= i; ++j) root(i, j) = std::sin(3.0 * i + 7.0 * j + 1) * 0.1;
  }
  state.covariance = root * root.transpose();
  return state;
}

NavState perturbed(const NavState& state, int which, double step) {
  NavState moved = state;
  Eigen::Matrix<double, 9, 1> delta = Eigen::Matrix<double, 9, 1>::Zero();
  delta[which] = step;
  moved.T_world_body.rotation = state.T_world_body.rotation * expSo3(delta.head<3>());
  moved.T_world_body.translation += delta.segment<3>(3);
  moved.v_world_body += delta.tail<3>();
  return moved;
}

TEST_CASE("covariances are those of ROS's errors", "[export]") {
  const NavState state = someState();
  // Position, rotation about fixed axes, velocity in the child frame: by differences of the quantities.
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 9, 9> J;
  for (int i = 0; i < 9; ++i) {
    const NavState moved = perturbed(state, i, kStep);
    J.col(i).head<3>() = (moved.T_world_body.translation - state.T_world_body.translation) / kStep;
    J.col(i).segment<3>(3) =
        logSo3(moved.T_world_body.rotation * state.T_world_body.rotation.conjugate()) / kStep;
    J.col(i).tail<3>() = (bodyVelocity(moved) - bodyVelocity(state)) / kStep;
  }
  const Eigen::Matrix<double, 9, 9> expected = J * state.covariance.topLeftCorner<9, 9>() * J.transpose();
  CHECK((rosPoseCovariance(state) - expected.topLeftCorner<6, 6>()).norm() < 1e-6);
  const RosCovariance twist = rosTwistCovariance(state);
  CHECK((twist.topLeftCorner<3, 3>() - expected.bottomRightCorner<3, 3>()).norm() < 1e-6);
  CHECK(twist(3, 3) == kUnknownVariance);
  CHECK(twist.topRightCorner<3, 3>().isZero());
}

TEST_CASE("keyframes come back from states.csv as they were written", "[export]") {
  const ScratchFolder folder("states_back");
  KeyframeState keyframe;
  keyframe.state = someState();
  keyframe.state.stamp = Stamp{1403636579763555584};
  keyframe.state.health = Health::kDegraded;
  keyframe.state.epoch = 3;
  keyframe.state.bias_gyro = {1e-3, -2e-3, 3e-3};
  keyframe.state.bias_accel = {0.1, 0.2, -0.3};
  keyframe.statistics.tracks = 211;
  keyframe.statistics.reprojection_rms = 0.5;
  keyframe.statistics.iterations = 4;
  const std::string file = folder.file("states.csv");
  std::ofstream(file) << statesHeader() << '\n' << statesRow(keyframe) << '\n';
  const std::vector<KeyframeState> back = readKeyframes(file);
  REQUIRE(back.size() == 1);
  const NavState& state = back[0].state;
  CHECK(state.stamp == keyframe.state.stamp);
  CHECK(state.T_world_body.rotation.angularDistance(keyframe.state.T_world_body.rotation) < 1e-12);
  CHECK(state.T_world_body.translation == keyframe.state.T_world_body.translation);
  CHECK(state.v_world_body == keyframe.state.v_world_body);
  CHECK(state.bias_gyro == keyframe.state.bias_gyro);
  CHECK(state.bias_accel == keyframe.state.bias_accel);
  CHECK(state.covariance.topLeftCorner<6, 6>() == keyframe.state.covariance.topLeftCorner<6, 6>());
  CHECK(state.covariance.diagonal() == keyframe.state.covariance.diagonal());
  CHECK(state.health == Health::kDegraded);
  CHECK(state.epoch == 3);
  CHECK(back[0].statistics.tracks == 211);
  CHECK(back[0].statistics.reprojection_rms == 0.5);
  CHECK(back[0].statistics.iterations == 4);
}

TEST_CASE("TUM files have eight columns and the run's rows", "[export]") {
  const ExportedRun exported;
  const std::string tum = exported.folder.file("tum");
  REQUIRE(run({"export", exported.run, "--tum", tum}) == kExitDone);
  CHECK(textOf(tum + "/odometry.tum") == textOf(exported.run + "/odometry.tum"));
  CHECK(textOf(tum + "/map.tum") == textOf(exported.run + "/map.tum"));
  CHECK(textOf(tum + "/imu_rate.tum") == textOf(exported.run + "/imu_rate.tum"));
  for (const char* name : {"odometry.tum", "map.tum", "imu_rate.tum", "keyframes.tum", "truth.tum"}) {
    std::ifstream file(tum + "/" + name);
    std::string line;
    std::size_t rows = 0;
    double last = 0;
    while (std::getline(file, line)) {
      std::istringstream columns(line);
      std::vector<double> v;
      for (double value = 0; columns >> value;) v.push_back(value);
      REQUIRE(columns.eof());
      REQUIRE(v.size() == 8);
      CHECK(v[0] > last);
      CHECK(std::abs(v[4] * v[4] + v[5] * v[5] + v[6] * v[6] + v[7] * v[7] - 1) < 1e-6);
      last = v[0];
      ++rows;
    }
    INFO(name);
    CHECK(rows > 10);
  }
  CHECK(run({"export", exported.run, "--tum", exported.run}) == kExitBadInput);
  // What a run no longer has does not stay from the export before.
  std::filesystem::remove(exported.run + "/map.tum");
  REQUIRE(run({"export", exported.run, "--tum", tum, "--no-truth"}) == kExitDone);
  CHECK_FALSE(std::filesystem::exists(tum + "/map.tum"));
  CHECK_FALSE(std::filesystem::exists(tum + "/truth.tum"));
}

TEST_CASE("TUM files are not written over another run, and old ones stay until all are written", "[export]") {
  const ExportedRun exported;
  const std::string other = exported.folder.file("other");
  std::filesystem::create_directories(other);
  for (const char* mark : {"/swiftlet_run.txt", "/summary.json"}) {
    std::ofstream(other + "/map.tum") << "theirs";
    std::ofstream(other + mark) << "";
    CHECK(run({"export", exported.run, "--tum", other}) == kExitBadInput);
    CHECK(textOf(other + "/map.tum") == "theirs");
    std::filesystem::remove(other + mark);
  }
  std::ofstream(other + "/truth.tum") << "theirs";
  std::filesystem::create_directories(other + "/keyframes.tum/in_the_way");
  CHECK(run({"export", exported.run, "--tum", other, "--no-truth"}) == kExitBadInput);
  CHECK(std::filesystem::exists(other + "/truth.tum"));
}

TEST_CASE("damaged and missing files of a run are named", "[export]") {
  const ExportedRun exported;
  const std::string tum = exported.folder.file("tum");
  const auto refused = [&] { return errorOf([&] { readRunFolder(exported.run); }); };
  const auto damage = [&](const std::string& name, const std::function<void(std::string&)>& how) {
    std::string text = textOf(exported.run + "/" + name);
    how(text);
    std::ofstream(exported.run + "/" + name, std::ios::binary) << text;
  };
  SECTION("a line cut short") {
    damage("odometry.tum", [](std::string& text) { text.resize(text.size() - 40); });
    const InputError error = refused();
    CHECK(contains(error.file, "odometry.tum"));
    CHECK(error.line > 10);
    CHECK_FALSE(error.field.empty());
    CHECK(contains(error.remedy, "delete the row"));
    CHECK(run({"export", exported.run, "--tum", tum}) == kExitBadInput);
    CHECK_FALSE(std::filesystem::exists(tum));
  }
  SECTION("a stamp that goes back") {
    damage("map.tum", [](std::string& text) { text += text.substr(0, text.find('\n') + 1); });
    const InputError error = refused();
    CHECK(contains(error.file, "map.tum"));
    CHECK(error.field == "timestamp");
    CHECK(error.line > 10);
  }
  SECTION("a number that is none") {
    damage("states.csv", [](std::string& text) { text.replace(text.find('\n') + 25, 3, ",nan,"); });
    const InputError error = refused();
    CHECK(contains(error.file, "states.csv"));
    CHECK(error.line == 2);
  }
  SECTION("an event without a stamp") {
    damage("events.log", [](std::string& text) { text += "today reset 1\n"; });
    const InputError error = refused();
    CHECK(contains(error.file, "events.log"));
    CHECK(error.field == "stamp");
  }
  SECTION("a missing file") {
    std::filesystem::remove(exported.run + "/states.csv");
    CHECK(contains(refused().file, "states.csv"));
    std::filesystem::remove(exported.run + "/odometry.tum");
    CHECK(contains(refused().message, "no odometry.tum"));
  }
  SECTION("a summary cut short") {
    damage("summary.json", [](std::string& text) { text.resize(text.size() / 2); });
    CHECK(contains(refused().message, "JSON"));
  }
}

TEST_CASE("the truth is laid on the run, and left out where it does not belong", "[export]") {
  const ExportedRun exported;
  const RunFolder folder = readRunFolder(exported.run);
  // The run itself, turned about gravity and moved: the fit gives the motion back.
  const SE3 T_truth_world(Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ())), {5, -3, 2});
  Trajectory truth = folder.odometry;
  for (TrajectoryPoint& point : truth) point.T_world_body = T_truth_world * point.T_world_body;
  const BagTruth beside = truthBeside(folder, truth);
  CHECK(beside.poses.size() == truth.size());
  CHECK((beside.T_world_truth.translation - T_truth_world.inverse().translation).norm() < 1e-6);
  for (TrajectoryPoint& point : truth) point.stamp.ns += 1'000'000'000'000;
  CHECK(truthBeside(folder, truth).poses.empty());
}

TEST_CASE("export says what it needs", "[export]") {
  const ExportedRun exported;
  CHECK(run({"export", exported.run}) == kExitBadInput);
  CHECK(run({"export", exported.folder.file("nothing"), "--tum", exported.folder.file("tum")}) ==
        kExitBadInput);
  CHECK(run({"export", exported.run, "--tum", exported.folder.file("tum"), "--body-frame", "odom"}) ==
        kExitBadInput);
  const std::string bag = exported.folder.file("run.bag");
  CHECK(run({"export", exported.run, "--bag", bag}) == kExitDone);
  CHECK(std::filesystem::exists(bag));
}

#ifdef SWIFTLET_NO_RUN_BAG
TEST_CASE("a run as a ROS 1 bag", "[export]") {
  skipCase("built without librosbag-storage-dev and ROS's message packages",
           "toolchain/install.sh optional, then toolchain/test.sh");
}
#endif

TEST_CASE("what an export would ignore is refused", "[export]") {
  const ExportedRun exported;
  const std::string log = exported.folder.file("log");
  REQUIRE(run({"simulate", "--tracks", "--duration", "0.3", "--out", log}) == kExitDone);
  const std::string file = exported.folder.file("out.mcap");
  CHECK(run({"export", log, "--truth", "nothere", "--mcap", file}) == kExitBadInput);
  CHECK(run({"export", exported.run, "--calibration", "nothere", "--mcap", file}) == kExitBadInput);
  CHECK(run({"export", exported.run, "--mcap", file, "--bag", exported.folder.file("./out.mcap")}) ==
        kExitBadInput);
  CHECK_FALSE(std::filesystem::exists(file));
}

TEST_CASE("a full disk leaves no part of a bag", "[export]") {
  const ExportedRun exported;
  for (const char* form : {"--bag", "--mcap"}) {
    INFO(form);
    const std::string file = exported.folder.file("full");
    {
      const FileSizeLimit limit(60'000);
      CHECK(run({"export", exported.run, form, file}) == kExitBadInput);
    }
    CHECK_FALSE(std::filesystem::exists(file));
    CHECK_FALSE(std::filesystem::exists(file + ".part"));
  }
}

}  // namespace
}  // namespace swiftlet
