// Simulated flights with landmarks tied to the floor, ceiling and walls that they are on, some to others.

#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "tests/smoother/plane_ties.hpp"
#include "tests/support/long_run.hpp"

using namespace swiftlet;
using test::FlightRecord;
using test::PlaneTies;
using test::TieSettings;
using test::TrackFlight;

namespace {

/// Over some flights.
struct Sum {
  double squares = 0;
  double nees = 0;
  double worst = 0;
  int flights = 0;

  void add(const FlightRecord& record) {
    squares += record.error * record.error;
    nees += record.nees;
    worst = std::max(worst, record.error);
    ++flights;
  }
  [[nodiscard]] double error() const { return std::sqrt(squares / flights); }
  [[nodiscard]] double meanNees() const { return nees / flights; }
};

}  // namespace

TEST_CASE("Planes of the room help or do no harm, wrong ties are bounded", "[smoother][plane_flight][long]") {
  Sum structureless;
  Sum promoted;
  Sum tied;
  Sum wrong;
  const std::uint64_t flights = longOr<std::uint64_t>(4, 1);
  for (std::uint64_t seed = 2; seed < 2 + flights; ++seed) {
    const TrackFlight flight(test::roomFlight(25, seed));
    structureless.add(test::fly(flight, nullptr));
    TieSettings settings;
    PlaneTies columns(flight, settings);
    promoted.add(test::fly(flight, &columns));
    CHECK(columns.promotions() > 300);

    settings.planes = true;
    settings.directions = true;
    PlaneTies planes(flight, settings);
    tied.add(test::fly(flight, &planes));
    CHECK(planes.ties() > 300);
    CHECK(planes.mostPlanes() >= 3);

    settings.wrong_share = 0.2;
    PlaneTies astray(flight, settings);
    wrong.add(test::fly(flight, &astray));
    CHECK(astray.wrongTies() > 50);
  }
  std::printf(
      "%llu flights of 25 s: structureless %.4f m (NEES %.2f), promoted %.4f (%.2f), planes %.4f (%.2f), "
      "one tie in five wrong %.4f (%.2f)\n",
      static_cast<unsigned long long>(flights), structureless.error(), structureless.meanNees(),
      promoted.error(), promoted.meanNees(), tied.error(), tied.meanNees(), wrong.error(), wrong.meanNees());
  // Of one flight alone the errors' ratio scatters by a tenth.
  const double harm = longOr(1.1, 1.3);
  CHECK(promoted.error() < harm * structureless.error());
  CHECK(tied.error() < harm * structureless.error());
  CHECK(wrong.error() < 1.5 * structureless.error());
  for (const Sum& sum : {promoted, tied, wrong}) {
    CHECK(sum.meanNees() > 1.5);
    CHECK(sum.meanNees() < 2.5 * 6);
  }
}

TEST_CASE("An estimated plane is where the surface is, to within its sigmas", "[smoother][plane_flight]") {
  const TrackFlight flight(test::roomFlight(20, 8));
  TieSettings settings;
  settings.planes = true;
  PlaneTies ties(flight, settings);
  test::SmootherRun run(flight);
  double nees = 0;
  double worst_angle = 0;
  double worst_height = 0;
  int samples = 0;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(run.step(k).ok());
                if (k > 100 && k % 20 == 0) {
                  for (const PlaneTies::Surface& surface : ties.surfaces()) {
                    if (!surface.id) continue;
                    const std::optional<PlaneEstimate> estimate = run.smoother().plane(*surface.id);
                    if (!estimate || estimate->points < 6) continue;
                    if (!(estimate->covariance.trace() < 0.1 * 0.1)) continue;
                    const Eigen::Vector3d error = surface.truth.minus(estimate->plane);
                    nees += error.dot(estimate->covariance.inverse() * error);
                    worst_angle = std::max(worst_angle, error.head<2>().norm());
                    worst_height = std::max(worst_height,
                                            std::abs(surface.truth.distance() - estimate->plane.distance()));
                    ++samples;
                  }
                }
                ties.update(run.smoother());
              });
  REQUIRE(samples > 20);
  std::printf("planes: NEES %.2f over %d, normals off by at most %.4f rad, distances %.4f m\n",
              nees / samples, samples, worst_angle, worst_height);
  CHECK(nees / samples < 2.5 * 3);
  CHECK(nees / samples > 0.5);
  CHECK(worst_angle < 0.05);
  CHECK(worst_height < 0.15);
}
