// A smoother that is given less: fewer features, a shorter window, and back again.

#include <Eigen/Cholesky>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <memory>
#include <set>
#include <vector>

#include "estimator/smoother/smoother.hpp"
#include "tests/smoother/smoother_run.hpp"

using namespace swiftlet;
using test::SmootherRun;
using test::TrackFlight;

namespace {

// Frames of a flight with little effort; full effort before and after. 20 frames a second.
constexpr std::size_t kLittleFrom = 120;
constexpr std::size_t kLittleTo = 200;
constexpr double kSeconds = 16;
constexpr std::size_t kRecent = 4;  // SmootherSettings::max_recent

bool little(std::size_t k) { return k >= kLittleFrom && k < kLittleTo; }

// Pose NEES, summed.
struct Consistency {
  double sum = 0;
  double worst = 0;
  int samples = 0;

  void add(const TrackFlight& flight, std::size_t k, const Smoother& smoother) {
    const Vector15d error = flight.truth(k).minus(smoother.newest().x);
    const double nees =
        error.head<6>().dot(smoother.covariance().topLeftCorner<6, 6>().llt().solve(error.head<6>()));
    sum += nees;
    worst = std::max(worst, nees);
    ++samples;
  }
  void check(const char* what) const {
    std::printf("%s: pose NEES %.2f, largest %.1f, over %d frames\n", what, sum / samples, worst, samples);
    // Frames of a flight are correlated, the two flights are not: at the worst two samples, whose sum is
    // chi-square with 12 degrees of freedom; 0.1 % and 99.9 %. 36 is 5 sigma of a single one's spread.
    CHECK(sum / samples > 2.2 / 2);
    CHECK(sum / samples < 32.9 / 2);
    CHECK(worst < 6 * 6);
  }
};

std::size_t keyframesBehindRecent(const SmoothedWindow& window) {
  return window.poses.size() > kRecent ? window.poses.size() - kRecent : 0;
}

}  // namespace

TEST_CASE("Smoother: of a frame's features the smallest ids are taken", "[smoother][effort]") {
  constexpr int kFew = 40;
  const TrackFlight flight(test::roomFlight(3, 11));
  SmootherRun run(flight);
  run.max_features = kFew;
  std::set<TrackId> taken;
  auto window = std::make_unique<SmoothedWindow>();
  bool limited = false;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                std::vector<TrackId> ids;
                for (const TrackedFeature& feature : flight.frames()[k].features) ids.push_back(feature.id);
                std::sort(ids.begin(), ids.end());
                limited = limited || ids.size() > static_cast<std::size_t>(kFew);
                ids.resize(std::min(ids.size(), static_cast<std::size_t>(kFew)));
                taken.insert(ids.begin(), ids.end());
                REQUIRE(run.step(k).ok());
                CHECK(run.smoother().statistics().tracks == static_cast<int>(ids.size()));
                run.smoother().window(*window);
                for (const WindowLandmark& landmark : window->landmarks) CHECK(taken.count(landmark.id) == 1);
              });
  CHECK(limited);
  CHECK(window->landmarks.size() > 20);
}

TEST_CASE("Smoother: fewer features for a while leave it consistent", "[smoother][effort]") {
  Consistency meanwhile;
  Consistency after;
  for (std::uint64_t seed = 12; seed <= 13; ++seed) {
    const TrackFlight flight(test::roomFlight(kSeconds, seed));
    SmootherRun run(flight);
    flight.play([&](const ImuSample& s) { run.addImu(s); },
                [&](std::size_t k) {
                  run.max_features = little(k) ? 30 : static_cast<int>(kMaxFeatures);
                  REQUIRE(run.step(k).ok());
                  if (k < kLittleFrom) return;
                  (little(k) ? meanwhile : after).add(flight, k, run.smoother());
                  CHECK((run.smoother().statistics().tracks <= 30) == little(k));
                });
  }
  meanwhile.check("30 features");
  after.check("all features again");
}

TEST_CASE("Smoother: a window made shorter comes down two keyframes a step and grows again",
          "[smoother][effort]") {
  for (const int keyframes : {6, 2}) {
    Consistency meanwhile;
    Consistency after;
    for (std::uint64_t seed = 14; seed <= 15; ++seed) {
      const TrackFlight flight(test::roomFlight(kSeconds, seed));
      SmootherRun run(flight);
      auto window = std::make_unique<SmoothedWindow>();
      std::size_t before = 0;
      std::size_t left = 0;
      std::size_t given = 0;
      flight.play([&](const ImuSample& s) { run.addImu(s); },
                  [&](std::size_t k) {
                    run.max_keyframes = little(k) ? keyframes : static_cast<int>(kMaxStates);
                    REQUIRE(run.step(k).ok());
                    run.smoother().window(*window);
                    given += flight.frames()[k].keyframe || k == 0 ? 1 : 0;
                    left += run.left().size();
                    CHECK(run.left().size() <= 2);
                    if (k + 1 == kLittleFrom) before = keyframesBehindRecent(*window);
                    // Ten go, two a step, and a keyframe may arrive in each.
                    if (little(k) && k > kLittleFrom + 20) {
                      CHECK(keyframesBehindRecent(*window) <= static_cast<std::size_t>(keyframes));
                    }
                    if (k >= kLittleFrom) (little(k) ? meanwhile : after).add(flight, k, run.smoother());
                  });
      CHECK(before == 12);
      CHECK(keyframesBehindRecent(*window) == 12);
      FixedVector<KeyframeState, kMaxStates> rest;
      run.smoother().flush(rest);
      CHECK(left + rest.size() == given);
    }
    std::printf("%d keyframes\n", keyframes);
    meanwhile.check("  short window");
    after.check("  grown again");
  }
}

TEST_CASE("Smoother: steps end when the poses stand still, and lose little by it", "[smoother][effort]") {
  const TrackFlight flight(test::roomFlight(6, 17));
  SmootherRun usual(flight);
  SmootherRun patient(flight);
  patient.pose_tolerance = 0;
  int usual_steps = 0;
  int patient_steps = 0;
  double worst = 0;
  flight.play(
      [&](const ImuSample& s) {
        usual.addImu(s);
        patient.addImu(s);
      },
      [&](std::size_t k) {
        REQUIRE(usual.step(k).ok());
        REQUIRE(patient.step(k).ok());
        usual_steps += usual.smoother().statistics().iterations;
        patient_steps += patient.smoother().statistics().iterations;
        worst = std::max(worst, (usual.smoother().newest().x.T_world_body.translation -
                                 patient.smoother().newest().x.T_world_body.translation)
                                    .norm());
      });
  std::printf("steps %d for %d, poses apart by at most %.2g m\n", usual_steps, patient_steps, worst);
  CHECK(usual_steps < 0.8 * patient_steps);
  CHECK(worst < 2e-3);
}

TEST_CASE("Smoother: a step waits for the trim of the one before", "[smoother][effort]") {
  const TrackFlight flight(test::roomFlight(2, 16));
  SmootherRun run(flight);
  auto before = std::make_unique<SmoothedWindow>();
  auto trimmed = std::make_unique<SmoothedWindow>();
  FixedVector<KeyframeState, kMaxStates> left;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                if (k < 20) {
                  REQUIRE(run.step(k).ok());
                  return;
                }
                Smoother::StepInput input;
                input.frame = &flight.frames()[k];
                REQUIRE(run.smoother().step(input).ok());
                const BodyState x = run.smoother().newest().x;
                const Matrix15d covariance = run.smoother().covariance();
                run.smoother().window(*before);
                CHECK(run.smoother().step(input).code == StatusCode::kInvalidInput);
                run.smoother().trim(left);
                run.smoother().window(*trimmed);
                // What stands after the step still stands after the trim.
                CHECK(run.smoother().newest().x.T_world_body.translation == x.T_world_body.translation);
                CHECK(run.smoother().covariance() == covariance);
                CHECK(trimmed->poses.size() <= before->poses.size());
                CHECK(trimmed->poses.end()[-1].T_world_body.translation ==
                      before->poses.end()[-1].T_world_body.translation);
                run.smoother().trim(left);  // nothing is left to trim
                CHECK(left.size() == 0);
              });
}
