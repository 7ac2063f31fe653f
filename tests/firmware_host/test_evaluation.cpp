// Evaluation against values computed by hand and by the definitions of evo.

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/accuracy_report.hpp"
#include "firmware_host/lab/evaluation/common_stamps.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/lab/evaluation/loop_accuracy.hpp"
#include "firmware_host/lab/evaluation/position_accuracy.hpp"
#include "firmware_host/lab/evaluation/revisits.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

Stamp sinceStart(double seconds) { return {Duration::fromSeconds(seconds).ns}; }

TrajectoryPoint point(double seconds, const SE3& pose) {
  TrajectoryPoint result;
  result.stamp = sinceStart(seconds);
  result.T_world_body = pose;
  return result;
}

Eigen::Quaterniond yaw(double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
}

SE3 randomPose(Random& random) {
  const Eigen::Vector3d phi(random.normal(), random.normal(), random.normal());
  return {expSo3(phi), {random.normal(), random.normal(), random.normal()}};
}

/// A smooth flight, 20 Hz.
Trajectory flight(double seconds) {
  Trajectory result;
  for (int i = 0; i * 0.05 <= seconds; ++i) {
    const double t = i * 0.05;
    const Eigen::Vector3d p(2 * std::sin(0.7 * t), 1.5 * std::cos(0.5 * t), 1 + 0.3 * std::sin(1.1 * t));
    result.push_back(point(t, SE3(expSo3({0.2 * std::sin(t), 0.1 * std::cos(t), 0.4 * t}), p)));
  }
  return result;
}

Trajectory moved(Trajectory trajectory, const SE3& T, double scale = 1) {
  for (TrajectoryPoint& p : trajectory) {
    p.T_world_body.translation *= scale;
    p.T_world_body = T * p.T_world_body;
  }
  return trajectory;
}

TEST_CASE("statistics of a list, as evo defines them") {
  const ErrorStatistics s = statisticsOf({3, 1, 4, 2});
  CHECK(s.count == 4);
  CHECK(s.mean == Approx(2.5));
  CHECK(s.median == Approx(2.5));
  CHECK(s.sse == Approx(30));
  CHECK(s.rmse == Approx(std::sqrt(7.5)));
  CHECK(s.deviation == Approx(std::sqrt(1.25)));
  CHECK(s.min == 1);
  CHECK(s.max == 4);
  CHECK(statisticsOf({5, 1, 2}).median == 2);
  CHECK(statisticsOf({}).count == 0);
}

TEST_CASE("truth is interpolated within the gap, never extrapolated") {
  Trajectory truth = {point(0, SE3(yaw(0), {0, 0, 0})), point(0.01, SE3(yaw(0.2), {1, 2, 3})),
                      point(0.1, SE3(yaw(0.3), {2, 2, 2}))};
  const Duration gap = Duration::fromMilliseconds(20);
  const auto middle = interpolate(truth, sinceStart(0.0025), gap);
  REQUIRE(middle);
  CHECK((middle->translation - Eigen::Vector3d(0.25, 0.5, 0.75)).norm() < 1e-12);
  CHECK(logSo3(middle->rotation).z() == Approx(0.05));
  CHECK(interpolate(truth, sinceStart(0.1), gap));           // an exact stamp needs no neighbour
  CHECK_FALSE(interpolate(truth, sinceStart(0.05), gap));    // within a gap of 90 ms
  CHECK_FALSE(interpolate(truth, sinceStart(-0.001), gap));  // before
  CHECK_FALSE(interpolate(truth, sinceStart(0.101), gap));   // after
  CHECK_FALSE(interpolate({}, sinceStart(0), gap));

  // Opposite signs of one rotation are one rotation.
  truth[1].T_world_body.rotation.coeffs() *= -1;
  CHECK(logSo3(interpolate(truth, sinceStart(0.0025), gap)->rotation).z() == Approx(0.05));
}

TEST_CASE("association counts what it leaves out") {
  const Trajectory estimate = flight(4);
  Trajectory truth(estimate.begin() + 20, estimate.end());
  AssociationOptions options;
  const Association all = associate(estimate, truth, options);
  CHECK(all.estimates == 81);
  CHECK(all.without_truth == 20);
  CHECK(all.pairs.size() == 61);
  options.from = sinceStart(3);
  options.until = sinceStart(3.5);
  const Association part = associate(estimate, truth, options);
  CHECK(part.pairs.size() == 11);
  CHECK(part.pairs.front().estimate_index == 60);
}

TEST_CASE("a moved copy has no error under the alignment that can undo the move, and only there") {
  Random random(5);
  const Trajectory truth = flight(20);
  AccuracyOptions options;
  const auto ate = [&](const Trajectory& estimate, AlignKind kind) {
    options.align = kind;
    return accuracyOf(estimate, truth, options).absolute.translation.rmse;
  };
  const Trajectory tilted = moved(truth, randomPose(random));
  CHECK(ate(tilted, AlignKind::kSe3) < 1e-9);
  CHECK(ate(tilted, AlignKind::kSim3) < 1e-9);
  CHECK(ate(tilted, AlignKind::kYaw) > 0.1);
  const Trajectory turned = moved(truth, SE3(yaw(1.1), {3, -2, 1}));
  CHECK(ate(turned, AlignKind::kYaw) < 1e-9);
  const Trajectory scaled = moved(truth, randomPose(random), 1.25);
  CHECK(ate(scaled, AlignKind::kSim3) < 1e-9);
  CHECK(ate(scaled, AlignKind::kSe3) > 0.1);
  options.align = AlignKind::kSim3;
  CHECK(accuracyOf(scaled, truth, options).absolute.alignment.scale == Approx(0.8));
}

TEST_CASE("ATE by hand: one point off in a symmetric cross") {
  // Truth: a cross of four points at distance 1. Estimate: the same with z = +-h alternating, which
  // no rigid motion of the plane explains: by symmetry the best fit is the identity, rmse = h.
  constexpr double kHeight = 0.01;
  std::vector<PosePair> pairs;
  const std::vector<Eigen::Vector3d> cross = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  for (std::size_t i = 0; i < cross.size(); ++i) {
    const double z = i % 2 == 0 ? kHeight : -kHeight;
    const SE3 estimate(Eigen::Quaterniond::Identity(), cross[i] + Eigen::Vector3d(0, 0, z));
    pairs.push_back({sinceStart(static_cast<double>(i)), estimate, SE3(yaw(0.1), cross[i]), i});
  }
  const TrajectoryError error = trajectoryError(pairs, AlignKind::kSe3);
  CHECK(error.translation.rmse == Approx(kHeight).epsilon(1e-9));
  CHECK(error.axis_rmse.z() == Approx(kHeight).epsilon(1e-9));
  CHECK(error.axis_rmse.head<2>().norm() < 1e-9);
  CHECK(error.rotation.rmse == Approx(0.1 * kDegrees).epsilon(1e-9));
  CHECK(error.path_length == Approx(3 * std::sqrt(2)));
  // All rotations are off by the same turn: their own fit takes it away.
  CHECK(error.attitude.max < 1e-9);
  CHECK(error.tilt.max < 1e-9);
  // Their tilt is what no alignment may take away.
  for (PosePair& pair : pairs) {
    pair.estimate.rotation = expSo3(Eigen::Vector3d(0.2, 0, 0)) * pair.estimate.rotation;
  }
  const TrajectoryError tilted = trajectoryError(pairs, AlignKind::kSe3);
  CHECK(tilted.tilt.rmse == Approx(0.2 * kDegrees).epsilon(1e-9));
  CHECK(tilted.attitude.max < 1e-9);
}

TEST_CASE("ATE is the minimum over all rigid motions (evo's definition), to 1e-6") {
  Random random(9);
  const Trajectory truth = flight(10);
  Trajectory estimate = moved(truth, randomPose(random));
  for (TrajectoryPoint& p : estimate) {
    p.T_world_body.translation += 0.05 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  }
  AccuracyOptions options;
  const Accuracy found = accuracyOf(estimate, truth, options);
  const auto rmse = [&](const SE3& T) {
    double sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      sum += (truth[i].T_world_body.translation - T * estimate[i].T_world_body.translation).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(truth.size()));
  };
  const SE3 best = found.absolute.alignment.T_to_from;
  CHECK(rmse(best) == Approx(found.absolute.translation.rmse).margin(1e-12));
  // No neighbour is better: first-order optimal in all six directions, and a minimum.
  for (int axis = 0; axis < 6; ++axis) {
    for (const double step : {-1e-3, 1e-3}) {
      Eigen::Matrix<double, 6, 1> d = Eigen::Matrix<double, 6, 1>::Zero();
      d[axis] = step;
      CHECK(rmse(SE3(expSo3(d.head<3>()), d.tail<3>()) * best) > found.absolute.translation.rmse);
    }
  }
  CHECK(found.absolute.translation.rmse < 0.05 * std::sqrt(3.0) * 1.1);
}

TEST_CASE("the section from 3 s is aligned over itself alone") {
  const Trajectory truth = flight(10);
  Trajectory estimate = truth;
  for (TrajectoryPoint& p : estimate) {
    if (p.stamp < sinceStart(3)) p.T_world_body.translation.x() += 5;  // a bad start
  }
  AccuracyOptions options;
  CHECK(accuracyOf(estimate, truth, options).absolute.translation.rmse > 0.1);
  options.association.from = sinceStart(3);
  const Accuracy later = accuracyOf(estimate, truth, options);
  CHECK(later.absolute.translation.rmse < 1e-9);
  CHECK(later.pairs == 141);
}

/// A straight flight along x at 1 m/s seen by an estimate whose scale is off and which turns in yaw.
std::vector<PosePair> driftingPairs(double scale, double yaw_rate) {
  std::vector<PosePair> pairs;
  for (std::size_t i = 0; i <= 400; ++i) {
    const double t = 0.05 * static_cast<double>(i);
    const SE3 truth(Eigen::Quaterniond::Identity(), {t, 0, 0});
    const SE3 estimate(yaw(yaw_rate * t), {scale * t, 0, 0});
    pairs.push_back({sinceStart(t), estimate, truth, i});
  }
  return pairs;
}

TEST_CASE("RPE over time and distance of a known drift") {
  // Scale 1.02 without turning: 2 cm over each second and 2 % over each distance.
  const auto scaled = driftingPairs(1.02, 0);
  const RelativeError time = relativeErrorOverTime(scaled, Duration::fromSeconds(1));
  CHECK(time.translation.count == 381);
  CHECK(time.translation.rmse == Approx(0.02).epsilon(1e-9));
  CHECK(time.rotation.max < 1e-9);
  const RelativeError distance = relativeErrorOverDistance(scaled, 8);
  CHECK(distance.translation.count == 241);
  CHECK(distance.translation.mean == Approx(2).epsilon(1e-9));
  // Longer than the flight: nothing, rather than a made-up figure.
  CHECK(relativeErrorOverDistance(scaled, 40).translation.count == 0);

  // Turning by 0.01 rad/s: the angle over 1 s and per metre.
  const auto turning = driftingPairs(1, 0.01);
  CHECK(relativeErrorOverTime(turning, Duration::fromSeconds(1)).rotation.mean == Approx(0.01 * kDegrees));
  CHECK(relativeErrorOverDistance(turning, 8).rotation.mean == Approx(0.01 * kDegrees));
}

TEST_CASE("RPE does not bridge gaps") {
  auto pairs = driftingPairs(1.02, 0);
  pairs.erase(pairs.begin() + 100, pairs.begin() + 200);
  const RelativeError time = relativeErrorOverTime(pairs, Duration::fromSeconds(1));
  CHECK(time.translation.max == Approx(0.02).epsilon(0.5));
  CHECK(time.translation.count < 301);
}

TEST_CASE("NEES of errors drawn from the covariance averages its degrees of freedom") {
  Random random(3);
  Matrix6d root = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) root(i, j) = 0.01 * random.normal();
    root(i, i) = 0.02;
  }
  const Matrix6d covariance = root * root.transpose();
  // The estimate lives in a world turned in yaw: NEES must not notice.
  const SE3 T_estimate_truth(yaw(2.0), {5, 6, 7});
  Matrix6d turned = Matrix6d::Identity();
  turned.bottomRightCorner<3, 3>() = T_estimate_truth.R();
  std::vector<ConsistencySample> samples;
  for (int i = 0; i < 4000; ++i) {
    ConsistencySample sample;
    sample.truth = randomPose(random);
    Eigen::Matrix<double, 6, 1> e;
    for (double& x : e) x = random.normal();
    e = root * e;
    if (i == 0) e.setZero();
    // truth = estimate (+) error: R_truth = R_estimate Exp(phi), p_truth = p_estimate + p.
    SE3 estimate = sample.truth;
    estimate.rotation = estimate.rotation * expSo3(-e.head<3>());
    estimate.translation -= e.tail<3>();
    sample.estimate = T_estimate_truth * estimate;
    sample.covariance = turned * covariance * turned.transpose();
    samples.push_back(sample);
  }
  const Consistency found = consistency(samples);
  CHECK(found.count == 3999);
  // 4 sigma of the mean of 3999 chi-square values: sqrt(2 n / 3999) = 0.055 and 0.039.
  CHECK(found.nees_pose == Approx(6).margin(0.22));
  CHECK(found.nees_rotation == Approx(3).margin(0.16));
  CHECK(found.nees_position == Approx(3).margin(0.16));
  CHECK(found.inside_3_sigma == Approx(0.9973).margin(0.002));

  for (ConsistencySample& sample : samples) sample.covariance *= 0.25;
  CHECK(consistency(samples).nees_pose == Approx(24).margin(0.9));
  for (ConsistencySample& sample : samples) sample.covariance.setZero();
  CHECK(consistency(samples).without_covariance == 3999);
  CHECK(consistency({}).count == 0);
}

TEST_CASE("two estimates are compared at the stamps of both") {
  const Trajectory truth = flight(10);
  // The one is off by 3 cm to and fro at every second pose, and by a metre where the other has no pose.
  Trajectory odometry;
  Trajectory map;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    TrajectoryPoint p = truth[i];
    if (i % 4 == 0) map.push_back(p);
    p.T_world_body.translation.x() += i % 4 == 0 ? (i % 8 == 0 ? 0.03 : -0.03) : 1.0;
    odometry.push_back(p);
  }
  map.push_back(point(11, SE3()));  // odometry has none there
  const CommonStamps found = compareAtCommonStamps(odometry, map, truth, {});
  CHECK(found.pairs == 51);
  CHECK(found.reference_rmse == Approx(0.03).epsilon(0.02));
  CHECK(found.other_rmse < 1e-9);
  CHECK(found.ratio() < 1e-6);
  CHECK(compareAtCommonStamps(odometry, {point(99, SE3())}, truth, {}).pairs == 0);
  CHECK(CommonStamps{}.ratio() == 0);
  CHECK(atStampsOf(map, odometry).size() == 51);
}

TEST_CASE("a flight there and back revisits, one way does not") {
  Trajectory there;
  Trajectory back;
  for (int i = 0; i <= 800; ++i) {  // 40 s at 20 Hz, 0.5 m/s
    const double t = 0.05 * i;
    there.push_back(point(t, SE3(yaw(0), {0.5 * t, 0, 0})));
    const double x = 0.5 * std::min(t, 40 - t);
    back.push_back(point(t, SE3(yaw(0), {x, 0, 0})));
  }
  CHECK(countRevisits(there).revisiting == 0);
  const Revisits found = countRevisits(back);
  CHECK(found.samples == 81);
  // At t it is where it was at 40 - t and 1 m (2 s) to either side of it: earlier by more than 20 s if t
  // > 29.
  CHECK(found.revisiting == 22);
  Trajectory turned = back;
  for (TrajectoryPoint& p : turned) {
    if (p.stamp > sinceStart(20)) p.T_world_body.rotation = yaw(std::numbers::pi);
  }
  CHECK(countRevisits(turned).revisiting == 0);
}

TEST_CASE("no truth at all gives no figures and a status") {
  AccuracyOptions options;
  const Accuracy none = accuracyOf(flight(1), {}, options);
  CHECK(none.pairs == 0);
  CHECK(none.coverage() == 0);
  CHECK(none.absolute.status.code == StatusCode::kInvalidInput);
}

TEST_CASE("a figure of nothing is not written as 0") {
  const Trajectory truth = flight(4);
  for (const std::size_t poses : {1U, 2U}) {
    const Trajectory few(truth.begin(), truth.begin() + static_cast<long>(poses));
    const Accuracy accuracy = accuracyOf(few, truth, {});
    CHECK(accuracy.pairs == poses);
    CHECK_FALSE(toJson(accuracy).contains("ate_m"));
    CHECK_THAT(toText("few", accuracy), Catch::Matchers::Contains("fewer than 3 pairs"));
    CHECK(toJson(compareAtCommonStamps(few, few, truth, {}))["ratio"].is_null());
  }
  // Half a second has no interval of one second.
  const auto json = toJson(accuracyOf(flight(0.5), truth, {}));
  CHECK(json["ate_m"]["rmse"].get<double>() < 1e-9);
  CHECK(json["rpe_time"]["translation_m"]["count"] == 0);
  CHECK(json["rpe_time"]["translation_m"]["rmse"].is_null());
  CHECK(toJson(Consistency{})["nees_pose_6dof"].is_null());
  CHECK(toJson(Consistency{})["states"] == 0);
}

TEST_CASE("loops are judged by the truth at both ends, and survive their file") {
  Trajectory truth;
  for (int k = 0; k <= 100; ++k) {
    truth.push_back({Stamp{} + Duration::fromMilliseconds(100 * k),
                     SE3(expSo3(Eigen::Vector3d(0, 0, 0.02 * k)), Eigen::Vector3d(0.1 * k, 0, 1))});
  }
  const auto loopBetween = [&](std::size_t i, std::size_t j, const SE3& error, LoopVerdict verdict) {
    MapLoop loop;
    loop.old_stamp = truth[i].stamp;
    loop.new_stamp = truth[j].stamp;
    loop.T_old_new = truth[i].T_world_body.inverse() * truth[j].T_world_body * error;
    loop.inliers = 40;
    loop.rotation_sigma = 0.01;
    loop.translation_sigma = 0.02;
    loop.verdict = verdict;
    return loop;
  };
  const SE3 near(expSo3(Eigen::Vector3d(0.01, 0, 0)), Eigen::Vector3d(0, 0.03, 0.04));
  std::vector<MapLoop> loops = {
      loopBetween(3, 80, near, LoopVerdict::kSelected), loopBetween(4, 81, near, LoopVerdict::kInconsistent),
      loopBetween(5, 82, SE3(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), {0.5, 0, 0}),
                  LoopVerdict::kAgainstOdometry),
      loopBetween(6, 83, SE3(expSo3(Eigen::Vector3d(0, 0.2, 0)), {0, 0, 0}), LoopVerdict::kUnsupported),
      loopBetween(7, 84, near, LoopVerdict::kSelected)};
  loops.back().new_stamp = Stamp{} + Duration::fromSeconds(20);  // the truth has ended by then
  const ScratchFolder folder("loops");
  writeLoops(folder.file("loops.csv"), loops);
  const std::vector<MapLoop> read = readLoops(folder.file("loops.csv"));
  REQUIRE(read.size() == loops.size());
  for (std::size_t i = 0; i < loops.size(); ++i) {
    CHECK(read[i].old_stamp == loops[i].old_stamp);
    CHECK(read[i].new_stamp == loops[i].new_stamp);
    CHECK(read[i].verdict == loops[i].verdict);
    CHECK(read[i].inliers == loops[i].inliers);
    CHECK((read[i].T_old_new.translation - loops[i].T_old_new.translation).norm() < 1e-7);
    CHECK(read[i].T_old_new.rotation.angularDistance(loops[i].T_old_new.rotation) < 1e-7);
  }
  AssociationOptions options;
  options.max_gap = Duration::fromMilliseconds(200);
  const LoopAccuracy accuracy = loopAccuracy(read, truth, options);
  CHECK(accuracy.verified == 4);
  CHECK(accuracy.verified_right == 2);
  CHECK(accuracy.selected == 1);
  CHECK(accuracy.selected_right == 1);
  CHECK(accuracy.without_truth == 1);
  CHECK(accuracy.median_distance == Approx(0.05).margin(1e-6));
  CHECK(accuracy.median_degrees == Approx(0.573).margin(1e-3));
  options.from = truth[81].stamp;
  options.until = truth[82].stamp;
  const LoopAccuracy section = loopAccuracy(read, truth, options);
  CHECK(section.verified == 2);
  CHECK(section.without_truth == 0);
  options.from = truth[82].stamp;
  const LoopAccuracy none_right = loopAccuracy(read, truth, options);
  CHECK(none_right.verified == 1);
  CHECK(toJson(none_right)["median_error_m"].is_null());
  CHECK_THAT(toText(none_right), !Catch::Matchers::Contains("median"));
}

TEST_CASE("positions of another clock: the shift and the error that is left", "[evaluation]") {
  const Trajectory estimate = flight(20);
  const SE3 T_truth_world(yaw(0.7), {100, -50, 3});
  std::vector<PositionPoint> truth;
  Random random(3, 0);
  constexpr double kSigma = 0.05;
  for (double t = 1; t < 19; t += 0.27) {
    const std::optional<SE3> pose = interpolate(estimate, sinceStart(t), Duration::fromMilliseconds(60));
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    truth.push_back({sinceStart(t - 2.345), T_truth_world * pose->translation + kSigma * noise});
  }
  PositionAccuracyOptions options;
  options.accuracy.align = AlignKind::kYaw;
  // As they are: the clocks are far apart, and so are the places.
  const PositionAccuracy before = positionAccuracy(estimate, truth, options);
  CHECK(before.shift.ns == 0);
  CHECK(before.absolute.translation.rmse > 10 * kSigma);
  options.reach = Duration::fromSeconds(5);
  const PositionAccuracy found = positionAccuracy(estimate, truth, options);
  CHECK(found.shift.seconds() == Approx(2.345).margin(0.02));
  CHECK(found.pairs == truth.size());
  CHECK(found.absolute.translation.rmse == Approx(std::sqrt(3.0) * kSigma).epsilon(0.15));
  CHECK(found.absolute.rotation.count == 0);
  // No shift fits when none is near enough.
  options.reach = Duration::fromSeconds(0.5);
  CHECK(positionAccuracy(estimate, truth, options).absolute.translation.rmse > 10 * kSigma);
}

}  // namespace
}  // namespace swiftlet
