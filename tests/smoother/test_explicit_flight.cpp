// Explicit landmarks in the fixed-lag smoother on simulated flights: the interface, the same problem as
// without them, what they must not teach, and that every column is given back.

#include <Eigen/Cholesky>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "tests/smoother/plane_ties.hpp"

using namespace swiftlet;
using test::FlightRecord;
using test::PlaneTies;
using test::SmootherRun;
using test::TieSettings;
using test::TrackFlight;

namespace {

/// Promotes what the window shows, as long as there is room; how many.
int promoteAll(Smoother& smoother) {
  auto window = std::make_unique<SmoothedWindow>();
  smoother.window(*window);
  int count = 0;
  for (const WindowLandmark& landmark : window->landmarks) {
    if (smoother.promoted(landmark.id)) continue;
    count += smoother.promote(landmark.id).ok() ? 1 : 0;
  }
  return count;
}

/// Frame k without what it saw.
TrackedFrame blind(const TrackFlight& flight, std::size_t k) {
  TrackedFrame frame = flight.frames()[k];
  frame.features.clear();
  return frame;
}

}  // namespace

TEST_CASE("Promoting a landmark: what is refused", "[smoother][explicit]") {
  const TrackFlight flight(test::roomFlight(3, 1));
  SmootherRun run(flight);
  Smoother& smoother = run.smoother();
  CHECK(smoother.promote(7).code == StatusCode::kInvalidInput);
  CHECK_FALSE(smoother.promoted(7));
  auto window = std::make_unique<SmoothedWindow>();
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(run.step(k).ok());
                if (k == 0) {
                  // One state: a landmark is in no system yet.
                  CHECK(smoother.promote(flight.frames()[0].features[0].id).code == StatusCode::kNotReady);
                }
                if (k != 30) return;
                smoother.window(*window);
                std::size_t done = 0;
                int refused = 0;
                for (const WindowLandmark& landmark : window->landmarks) {
                  const double depth =
                      (landmark.p_world - smoother.newest().x.T_world_body.translation).norm();
                  const bool known = landmark.inverse_depth_sigma < 0.05 / depth;
                  const Status status = smoother.promote(landmark.id);
                  if (status.ok()) {
                    ++done;
                    CHECK(smoother.promoted(landmark.id));
                    CHECK(smoother.promote(landmark.id).ok());  // once more: no other column
                    CHECK(smoother.explicitLandmarks() == done);
                  } else {
                    ++refused;
                    // Of two reasons either may be told.
                    if (done < kMaxExplicitLandmarks || status.code != StatusCode::kCapacityReached) {
                      CHECK(status.code == StatusCode::kDegenerate);
                    }
                    if (known) CHECK(done == kMaxExplicitLandmarks);
                  }
                }
                CHECK(done == kMaxExplicitLandmarks);
                CHECK(refused > 0);
              });
}

TEST_CASE("A landmark whose depth is not known stays structureless", "[smoother][explicit]") {
  // One camera that has hardly moved yet.
  SimulationSettings settings = test::roomFlight(2, 1);
  settings.mono = true;
  const TrackFlight flight(settings);
  SmootherRun run(flight);
  int known = 0;
  int degenerate = 0;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(run.step(k).ok());
                if (k != 1) return;
                for (const TrackedFeature& feature : flight.frames()[k].features) {
                  const StatusCode code = run.smoother().promote(feature.id).code;
                  known += code == StatusCode::kOk ? 1 : 0;
                  degenerate += code == StatusCode::kDegenerate ? 1 : 0;
                }
              });
  INFO(known << " promoted, " << degenerate << " refused");
  CHECK(degenerate > 20);
  CHECK(known + degenerate > 50);
}

TEST_CASE("Planes: the interface", "[smoother][explicit]") {
  const TrackFlight flight(test::roomFlight(3, 1));
  SmootherRun run(flight);
  Smoother& smoother = run.smoother();
  std::optional<PlaneId> kept;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(run.step(k).ok());
                if (k == 30) {
                  REQUIRE(promoteAll(smoother) > 3);
                  std::vector<TrackId> ids;
                  for (const TrackedFeature& f : flight.frames()[k].features) {
                    if (smoother.promoted(f.id)) ids.push_back(f.id);
                  }
                  REQUIRE(ids.size() > 3);
                  CHECK(smoother.addPointOnPlane(ids[0], 1, 0.1).code == StatusCode::kInvalidInput);
                  std::vector<PlaneId> planes;
                  for (std::size_t p = 0; p < kMaxPlanes; ++p) {
                    const std::optional<PlaneId> id = smoother.addPlane(Plane(Eigen::Vector3d::UnitZ(), 0));
                    REQUIRE(id);
                    CHECK(std::find(planes.begin(), planes.end(), *id) == planes.end());
                    planes.push_back(*id);
                  }
                  CHECK_FALSE(smoother.addPlane(Plane()));
                  CHECK(smoother.planes() == kMaxPlanes);
                  smoother.removePlane(planes[0]);
                  CHECK(smoother.planes() == kMaxPlanes - 1);
                  CHECK_FALSE(smoother.plane(planes[0]));
                  CHECK(smoother.addPointOnPlane(ids[0], planes[0], 0.1).code == StatusCode::kInvalidInput);
                  CHECK(smoother.addPlaneDirection(planes[0], PlaneDirection::kVertical, 0.1).code ==
                        StatusCode::kInvalidInput);
                  kept = planes[1];
                  CHECK(smoother.addPointOnPlane(ids[0], *kept, 0.1).ok());
                  CHECK(smoother.addPointOnPlane(ids[0], *kept, 0.1).code == StatusCode::kInvalidInput);
                  CHECK(smoother.addPointOnPlane(ids[1], *kept, 0).code == StatusCode::kInvalidInput);
                  CHECK(smoother.addPointOnPlane(987654321, *kept, 0.1).code == StatusCode::kInvalidInput);
                  CHECK(smoother.addPointOnPlane(ids[1], *kept, 0.1).ok());
                  CHECK(smoother.addPointOnPlane(ids[2], *kept, 0.1).ok());
                  CHECK(smoother.plane(*kept)->points == 3);
                  smoother.removePointOnPlane(ids[2], *kept);
                  smoother.removePointOnPlane(ids[2], *kept);
                  CHECK(smoother.plane(*kept)->points == 2);
                  CHECK(smoother.addPlaneDirection(*kept, PlaneDirection::kVertical, 0.1).ok());
                  CHECK(smoother.addPlaneDirection(*kept, PlaneDirection::kHorizontal, 0.1).ok());
                  CHECK(smoother.plane(*kept)->points == 2);
                  CHECK(smoother.plane(*kept)->covariance.norm() == 0);  // not solved for yet
                } else if (k == 31) {
                  CHECK(smoother.planes() == 1);  // those without points have left
                  REQUIRE(smoother.plane(*kept));
                  const Eigen::Matrix3d P = smoother.plane(*kept)->covariance;
                  CHECK(Eigen::LLT<Eigen::Matrix3d>(P).info() == Eigen::Success);
                  CHECK((P - P.transpose()).norm() < 1e-12 * P.norm());
                  smoother.reset();
                  CHECK(smoother.planes() == 0);
                  CHECK(smoother.explicitLandmarks() == 0);
                  CHECK_FALSE(smoother.plane(*kept));
                }
              });
}

TEST_CASE("While nothing leaves the window, promoted landmarks change nothing", "[smoother][explicit]") {
  // Every frame stays; the states differ by what the iteration leaves undone.
  SimulationSettings simulation = test::roomFlight(1.2, 4);
  simulation.tracks.keyframe_interval = 10;
  const TrackFlight flight(simulation);
  SmootherSettings settings = test::settingsFor(flight);
  settings.max_recent = 22;
  SmootherRun plain(flight, settings);
  SmootherRun columns(flight, settings);
  plain.pose_tolerance = columns.pose_tolerance = 0;
  double worst = 0;
  double sigma = 0;
  flight.play(
      [&](const ImuSample& s) {
        plain.addImu(s);
        columns.addImu(s);
      },
      [&](std::size_t k) {
        if (k >= 20) return;
        REQUIRE(plain.step(k, 30).ok());
        REQUIRE(columns.step(k, 30).ok());
        if (k >= 2) static_cast<void>(promoteAll(columns.smoother()));
        const Vector15d difference = plain.smoother().newest().x.minus(columns.smoother().newest().x);
        worst = std::max(worst, difference.cwiseAbs().maxCoeff());
        const Matrix15d& P = plain.smoother().covariance();
        const Matrix15d& Q = columns.smoother().covariance();
        sigma = std::max(sigma, (P.diagonal().cwiseSqrt() - Q.diagonal().cwiseSqrt())
                                    .cwiseQuotient(P.diagonal().cwiseSqrt())
                                    .cwiseAbs()
                                    .maxCoeff());
      });
  CHECK(columns.smoother().explicitLandmarks() == kMaxExplicitLandmarks);
  std::printf("promoted or not: states differ by %.2g, sigmas by %.2g of themselves\n", worst, sigma);
  CHECK(worst < 2e-4);  // an iteration ends when its step is below 1e-4
  CHECK(sigma < 1e-3);
}

TEST_CASE("Promoted landmarks teach nothing of position and yaw", "[smoother][explicit][observability]") {
  SimulationSettings settings = test::roomFlight(20, 2);
  settings.flight.aggressiveness = 1.6;
  const TrackFlight flight(settings);
  const FlightRecord plain = test::fly(flight, nullptr);
  const auto information_at = [](const FlightRecord& record, std::size_t k) {
    const auto N = test::unobservable(record.x[k]);
    return Eigen::Vector4d((N.transpose() * record.covariance[k].llt().solve(N)).diagonal());
  };
  const auto largest_rise = [&](const FlightRecord& record) {
    Eigen::Vector4d lowest = information_at(record, 1);
    double rise = 0;
    for (std::size_t k = 2; k < record.x.size(); ++k) {
      const Eigen::Vector4d now = information_at(record, k);
      rise = std::max(rise, now.cwiseQuotient(lowest).maxCoeff() - 1);
      lowest = lowest.cwiseMin(now);
    }
    return rise;
  };
  const double plain_rise = largest_rise(plain);
  for (const bool planes : {false, true}) {
    TieSettings tie_settings;
    tie_settings.planes = planes;
    tie_settings.directions = planes;
    PlaneTies ties(flight, tie_settings);
    const FlightRecord record = test::fly(flight, &ties);
    const double rise = largest_rise(record);
    const Eigen::Vector4d first = information_at(record, 1);
    const Eigen::Vector4d last = information_at(record, record.x.size() - 1);
    constexpr std::size_t kSettled = 100;  // frames: 5 s
    double ratio = 1e30;
    for (std::size_t k = kSettled + 1; k < record.x.size(); ++k) {
      ratio = std::min(ratio, information_at(plain, k).cwiseQuotient(information_at(record, k)).minCoeff());
    }
    std::printf(
        "%s: x, y, z, yaw after 20 s %.3g %.3g %.3g %.3g of the start's; largest rise %.2g (structureless "
        "%.2g); structureless over explicit at least %.2g\n",
        planes ? "planes" : "promoted", last[0] / first[0], last[1] / first[1], last[2] / first[2],
        last[3] / first[3], rise, plain_rise, ratio);
    // A landmark found again restores a little of what was lost, and explicit ones are kept longer.
    CHECK(rise < plain_rise + 0.05);
    CHECK(ratio > 0.85);
    for (int axis = 0; axis < 4; ++axis) CHECK(last[axis] < 0.5 * first[axis]);
  }
}

TEST_CASE("Columns are given back: nothing of what was promoted stays in the window",
          "[smoother][explicit]") {
  const TrackFlight flight(test::roomFlight(24, 3));
  SmootherRun run(flight);
  Smoother& smoother = run.smoother();
  TieSettings settings;
  settings.max_promoted = kMaxExplicitLandmarks;
  settings.planes = true;
  settings.directions = true;
  PlaneTies ties(flight, settings);
  const std::size_t last = flight.frames().size() - 100;
  std::size_t most = 0;
  auto window = std::make_unique<SmoothedWindow>();
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                if (k < last) {
                  REQUIRE(run.step(k).ok());
                  ties.update(smoother);
                  most = std::max(most, smoother.explicitLandmarks());
                  return;
                }
                // Five seconds without a feature, keyframes all the same.
                const TrackedFrame frame = blind(flight, k);
                FixedVector<KeyframeState, kMaxStates> left;
                Smoother::StepInput input;
                input.frame = &frame;
                REQUIRE(smoother.step(input).ok());
                smoother.trim(left);
              });
  std::printf("%d landmarks promoted in turn, at most %d at a time; %d planes\n", ties.promotions(),
              static_cast<int>(most), ties.planesMade());
  CHECK(ties.promotions() > 4 * static_cast<int>(kMaxExplicitLandmarks));
  CHECK(smoother.explicitLandmarks() == 0);
  CHECK(smoother.planes() == 0);
  smoother.window(*window);
  CHECK(window->landmarks.empty());
}

TEST_CASE("Promoted landmarks whose sightings go astray are given up", "[smoother][explicit]") {
  // Some that keyframes which have left saw (they are in the prior), some new ones.
  constexpr std::size_t kOld = 30;
  constexpr std::size_t kPromote = 80;
  constexpr std::size_t kAstray = 100;
  SimulationSettings simulation = test::roomFlight(8, 5);
  simulation.flight.speed = 0.25;
  simulation.flight.aggressiveness = 0.3;
  simulation.tracks.mean_lifetime = 100;
  const TrackFlight flight(simulation);
  SmootherRun run(flight);
  Smoother& smoother = run.smoother();
  std::vector<TrackId> old;
  std::vector<TrackId> astray;
  const auto contains = [](const std::vector<TrackId>& ids, TrackId id) {
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  };
  int in_prior = 0;
  int given_up = 0;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                TrackedFrame frame = flight.frames()[k];
                for (TrackedFeature& feature : frame.features) {
                  if (k == kOld) old.push_back(feature.id);
                  if (!contains(astray, feature.id)) continue;
                  for (auto& pixel : feature.pixel) pixel += Eigen::Vector2f(25, -20);
                }
                if (k < 20) {
                  REQUIRE(run.step(k).ok());
                  return;
                }
                FixedVector<KeyframeState, kMaxStates> left;
                Smoother::StepInput input;
                input.frame = &frame;
                REQUIRE(smoother.step(input).ok());
                smoother.trim(left);
                if (k == kPromote) {
                  for (const TrackId id : old) static_cast<void>(smoother.promote(id));
                } else if (k == kAstray) {
                  for (const TrackedFeature& f : frame.features) {
                    if (!smoother.promoted(f.id) || astray.size() == 4) continue;
                    astray.push_back(f.id);
                    ++in_prior;
                  }
                  for (const TrackedFeature& f : frame.features) {
                    if (contains(old, f.id) || astray.size() == 8 || !smoother.promote(f.id).ok()) continue;
                    astray.push_back(f.id);
                  }
                } else if (k == kAstray + 6) {
                  for (const TrackedFeature& f : frame.features) {
                    if (!contains(astray, f.id)) continue;
                    CHECK_FALSE(smoother.promoted(f.id));
                    ++given_up;
                  }
                }
              });
  CHECK(in_prior > 1);
  CHECK(given_up > 5);
  const std::size_t last = flight.frames().size() - 1;
  CHECK((smoother.newest().x.T_world_body.translation - flight.truth(last).T_world_body.translation).norm() <
        0.05);
}

TEST_CASE("Promoted landmarks while the calibration is estimated", "[smoother][explicit]") {
  const TrackFlight flight(test::roomFlight(15, 6));
  SmootherSettings settings = test::settingsFor(flight);
  settings.estimate_time_offset = true;
  settings.estimate_extrinsics = true;
  double error[2] = {0, 0};
  for (const bool with_planes : {false, true}) {
    SmootherRun run(flight, settings);
    TieSettings tie_settings;
    tie_settings.planes = true;
    PlaneTies ties(flight, tie_settings);
    double& sum = error[with_planes ? 1 : 0];
    flight.play([&](const ImuSample& s) { run.addImu(s); },
                [&](std::size_t k) {
                  REQUIRE(run.step(k).ok());
                  if (with_planes) ties.update(run.smoother());
                  sum += (flight.truth(k).T_world_body.translation -
                          run.smoother().newest().x.T_world_body.translation)
                             .squaredNorm();
                });
    sum = std::sqrt(sum / static_cast<double>(flight.frames().size()));
    CHECK(std::abs(run.smoother().timeOffset().seconds() - flight.rig().camera_to_imu_shift.seconds()) <
          1e-3);
  }
  std::printf("calibration estimated: %.4f m structureless, %.4f m with planes\n", error[0], error[1]);
  CHECK(error[1] < 1.2 * error[0] + 0.002);
}
