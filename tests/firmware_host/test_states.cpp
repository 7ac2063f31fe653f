// states.csv: what is written reads back, and other readers of EuRoC-like files take it.

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <sstream>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

KeyframeState randomKeyframe(std::int64_t ns, Random& random) {
  const auto v = [&] { return Eigen::Vector3d(random.normal(), random.normal(), random.normal()); };
  KeyframeState keyframe;
  keyframe.state.stamp = {ns};
  keyframe.state.health = Health::kGood;
  keyframe.state.T_world_body = SE3(expSo3(v()), v());
  keyframe.state.v_world_body = v();
  keyframe.state.bias_gyro = 0.01 * v();
  keyframe.state.bias_accel = 0.1 * v();
  keyframe.statistics = {.keyframe = true,
                         .at_rest = true,
                         .tracks = static_cast<int>(ns % 200),
                         .landmarks = 300,
                         .inliers_mono = 11,
                         .inliers_stereo = 140,
                         .track_length = 7.125,
                         .reprojection_rms = 0.75,
                         .noise = {},
                         .imu_residual = 1.5,
                         .iterations = 3};
  Matrix15d root;
  for (int i = 0; i < kStateDim; ++i) {
    for (int j = 0; j < kStateDim; ++j) root(i, j) = 0.01 * random.normal();
  }
  keyframe.state.covariance = root * root.transpose();
  return keyframe;
}

TEST_CASE("states.csv keeps pose and covariance to the last digit") {
  Random random(2);
  const ScratchFolder folder("states");
  const std::string path = folder.file("states.csv");
  std::vector<KeyframeState> written;
  {
    LineFile file(path);
    file.write(statesHeader());
    for (int i = 0; i < 20; ++i) {
      written.push_back(randomKeyframe(1'403'636'579'763'555'584 + i * 50'000'001LL, random));
      file.write(statesRow(written.back()));
    }
  }
  const auto states = readStates(path);
  REQUIRE(states.size() == written.size());
  LogCounters counters;
  LogWarnings warnings;
  const Trajectory trajectory = readTrajectory(path, counters, warnings);
  REQUIRE(trajectory.size() == written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    const NavState& state = written[i].state;
    CHECK(states[i].stamp == state.stamp);
    CHECK(states[i].covariance == state.covariance.topLeftCorner<6, 6>());
    CHECK(states[i].T_world_body.translation == state.T_world_body.translation);
    CHECK(states[i].v_world_body == state.v_world_body);
    CHECK(states[i].bias_gyro == state.bias_gyro);
    CHECK(states[i].bias_accel == state.bias_accel);
    CHECK(states[i].variances == state.covariance.diagonal());
    REQUIRE(states[i].has_figures);
    CHECK(states[i].figures.tracks == written[i].statistics.tracks);
    CHECK(states[i].figures.inliers_stereo == written[i].statistics.inliers_stereo);
    CHECK(states[i].figures.track_length == Approx(written[i].statistics.track_length));
    CHECK(states[i].figures.reprojection_rms == Approx(written[i].statistics.reprojection_rms));
    CHECK(states[i].figures.imu_residual == Approx(written[i].statistics.imu_residual));
    CHECK(states[i].figures.iterations == written[i].statistics.iterations);
    CHECK(states[i].T_world_body.rotation.angularDistance(state.T_world_body.rotation) < 1e-15);
    // The first 17 columns are EuRoC's.
    CHECK(trajectory[i].stamp == state.stamp);
    CHECK(trajectory[i].has_motion);
    CHECK(trajectory[i].v_world_body == state.v_world_body);
    CHECK(trajectory[i].bias_gyro == state.bias_gyro);
    CHECK(trajectory[i].bias_accel == state.bias_accel);
  }
}

TEST_CASE("header and rows have the same number of columns") {
  Random random(4);
  const std::string header = statesHeader();
  const std::string row = statesRow(randomKeyframe(1, random));
  CHECK(std::ranges::count(header, ',') == std::ranges::count(row, ','));
}

TEST_CASE("a states.csv of something else is refused with its line") {
  const ScratchFolder folder("states_bad");
  LineFile(folder.file("states.csv")).write("#timestamp,x\n1,2");
  CHECK_THROWS_AS(readStates(folder.file("states.csv")), InputError);
}

}  // namespace
}  // namespace swiftlet
