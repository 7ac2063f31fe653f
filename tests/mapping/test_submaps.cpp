// When a submap begins, and where loop closure moves it.

#include "mapping/map/submaps.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace swiftlet;

namespace {

constexpr double kTolerance = 0.005;  // m

Submap imageAt(double seconds, std::uint64_t frame, const SE3& T_map_world = {}, std::uint32_t epoch = 0) {
  SE3 T_world_body;
  T_world_body.translation = {seconds, 0, 0};
  return {
      Stamp{static_cast<std::int64_t>(seconds * 1e9)}, frame, epoch, T_world_body, T_map_world, T_map_world};
}

/// A keyframe whose body is where imageAt() had it, in a world that lies so in the map.
WorldInMap worldAt(std::uint64_t frame, std::uint32_t epoch, const SE3& T_map_world) {
  return {frame, epoch, T_map_world, {}};
}

SE3 shifted(double x) { return {Eigen::Quaterniond::Identity(), {x, 0, 0}}; }

}  // namespace

TEST_CASE("a submap begins with the first image, after two seconds, and where poses were corrected") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  CHECK(submaps.follow(imageAt(0, 0)));
  CHECK_FALSE(submaps.follow(imageAt(1.9, 19)));
  CHECK_FALSE(submaps.follow(imageAt(1.95, 20, shifted(0.9 * kTolerance))));
  CHECK(submaps.follow(imageAt(1.96, 21, shifted(1.1 * kTolerance))));
  CHECK_FALSE(submaps.follow(imageAt(3.9, 39, shifted(1.1 * kTolerance))));
  CHECK(submaps.follow(imageAt(4, 40, shifted(1.1 * kTolerance))));
  CHECK(submaps.follow(imageAt(4.1, 41, {}, 1)));
  CHECK(submaps.newest() == 3);
  // A turn counts by what it moves some metres away.
  CHECK(submaps.follow(
      imageAt(4.2, 42, {Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ())), {}}, 1)));
}

TEST_CASE("given poses make one submap of an epoch") {
  Submaps submaps(MapPoses::kGiven, kTolerance);
  CHECK(submaps.follow(imageAt(0, 0)));
  for (int i = 1; i < 100; ++i) CHECK_FALSE(submaps.follow(imageAt(i, static_cast<std::uint64_t>(i))));
  CHECK(submaps.staleBefore() == 0);
  CHECK(submaps.follow(imageAt(100, 100, {}, 1)));
}

TEST_CASE("what was seen last more than ten seconds ago is stale") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  for (int i = 0; i <= 20; i += 2) {
    submaps.follow(imageAt(i, static_cast<std::uint64_t>(i)));
    // Submap n began at 2 n seconds.
    CHECK(submaps.staleBefore() == std::max(0, (i - 10 + 1) / 2));
  }
}

TEST_CASE("between two keyframes the map moves evenly; before the first and after the last as these") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  for (int i = 0; i < 20; ++i) submaps.follow(imageAt(2 * i, static_cast<std::uint64_t>(i)));
  REQUIRE(submaps.size() == 20);
  CHECK(submaps.correct(std::vector<WorldInMap>{worldAt(5, 0, {}), worldAt(9, 0, shifted(0.4))}).moved);
  for (std::size_t i = 0; i < submaps.size(); ++i) {
    const double part = std::clamp((static_cast<double>(i) - 5) / 4, 0.0, 1.0);
    if (i == 5 || i == 9) continue;  // keyframes themselves: the next test
    CHECK(submaps[i].motion().translation.x() == Approx(0.4 * part).margin(1e-9));
    CHECK((submaps.outdated()[i] != 0) == (0.4 * part > kTolerance));
    CHECK(submaps[i].hasMoved() == (part > 0));
  }
  // The newest has moved: no more images go into it.
  CHECK(submaps.follow(imageAt(38.1, 20, shifted(0.4))));
  CHECK_FALSE(submaps.correct(std::vector<WorldInMap>{worldAt(5, 0, {}), worldAt(9, 0, shifted(0.4))}).moved);
  CHECK_FALSE(submaps.correct({}).moved);
}

TEST_CASE("a submap whose anchor is a keyframe goes where the keyframe is, as the smoother has it by now") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  const Submap image = imageAt(3, 7);
  submaps.follow(image);
  SE3 refined = image.T_world_body;
  refined.translation.y() += 0.03;
  CHECK(
      submaps.correct(std::vector<WorldInMap>{{5, 0, {}, {}}, {7, 0, shifted(1) * refined, refined}}).moved);
  CHECK((submaps[0].motion() * image.T_world_body.translation - Eigen::Vector3d(4, 0.03, 0)).norm() < 1e-9);
}

TEST_CASE("a body far from its world's origin is turned where it is") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  Submap image = imageAt(0, 5);
  image.T_world_body.translation = {1000, 0, 0};
  submaps.follow(image);
  // Both keyframes have the body where it was, turned by 0 and 2 degrees.
  const auto turned = [&](double angle) {
    SE3 body = image.T_world_body;
    body.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ());
    return body * image.T_world_body.inverse();
  };
  submaps.correct(std::vector<WorldInMap>{worldAt(0, 0, turned(0)), worldAt(10, 0, turned(0.035))});
  const SE3 body = submaps[0].T_map_world * image.T_world_body;
  CHECK((body.translation - image.T_world_body.translation).norm() < 1e-6);
  CHECK(body.rotation.angularDistance(Eigen::Quaterniond::Identity()) == Approx(0.0175));
}

TEST_CASE("keyframes of another epoch say nothing of a submap") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  submaps.follow(imageAt(0, 0));
  submaps.follow(imageAt(2, 10));
  submaps.follow(imageAt(4, 20, {}, 1));
  submaps.correct(std::vector<WorldInMap>{worldAt(21, 1, shifted(0.3)), worldAt(30, 1, shifted(0.3))});
  CHECK_FALSE(submaps[0].hasMoved());
  CHECK_FALSE(submaps[1].hasMoved());
  CHECK(submaps[2].motion().translation.x() == Approx(0.3));
  submaps.correct(std::vector<WorldInMap>{worldAt(5, 0, shifted(0.1)), worldAt(21, 1, shifted(0.3))});
  CHECK(submaps[0].motion().translation.x() == Approx(0.1));
  CHECK(submaps[1].motion().translation.x() == Approx(0.1));
}

TEST_CASE("when there are as many submaps as there can be the last goes on") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  for (std::size_t i = 0; i < Submaps::kMost; ++i)
    REQUIRE(submaps.follow(imageAt(2.0 * static_cast<double>(i), i)));
  CHECK_FALSE(submaps.follow(imageAt(1e6, 1'000'000)));
  CHECK(submaps.size() == Submaps::kMost);
  // Else its blocks would begin anew with every image.
  submaps.correct(std::vector<WorldInMap>{worldAt(0, 0, shifted(1))});
  CHECK(submaps.outdated()[0] == 1);
  CHECK(submaps.outdated()[Submaps::kMost - 1] == 0);
}

TEST_CASE("when there are as many submaps as there can be, the last takes no image of another epoch") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  for (std::size_t i = 0; i < Submaps::kMost; ++i) {
    CHECK(submaps.takes(i < 10 ? 0 : 1));
    submaps.follow(imageAt(2.0 * static_cast<double>(i), i, {}, 1));
  }
  CHECK(submaps.takes(1));
  CHECK_FALSE(submaps.takes(2));
  CHECK(submaps.isInMap(0));
  CHECK_FALSE(submaps.follow(imageAt(1e6, 1'000'000, {}, 2)));
  // The vehicle is in another world by now.
  CHECK_FALSE(submaps.isInMap(0));
  CHECK_FALSE(submaps.isInMap(Submaps::kMost - 1));
  submaps.correct(std::vector<WorldInMap>{worldAt(5, 1, shifted(1)), worldAt(1'000'000, 2, {})});
  CHECK(submaps.isInMap(0));
}

TEST_CASE("a submap of an older epoch lies in the map once loops tie its epoch to the newest") {
  Submaps submaps(MapPoses::kEstimated, kTolerance);
  submaps.follow(imageAt(0, 0));
  submaps.correct(std::vector<WorldInMap>{worldAt(0, 0, shifted(0.1))});
  submaps.follow(imageAt(2, 10, {}, 1));
  CHECK_FALSE(submaps.isInMap(0));
  CHECK(submaps.isInMap(1));
  // What was said before the new epoch began comes late.
  submaps.correct(std::vector<WorldInMap>{worldAt(0, 0, shifted(0.2))});
  CHECK_FALSE(submaps.isInMap(0));
  submaps.correct(std::vector<WorldInMap>{worldAt(0, 0, shifted(0.2)), worldAt(11, 1, {})});
  CHECK(submaps.isInMap(0));
  submaps.correct(std::vector<WorldInMap>{worldAt(11, 1, {})});
  CHECK_FALSE(submaps.isInMap(0));
}
