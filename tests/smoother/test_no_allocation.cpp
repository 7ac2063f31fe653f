// A step of the smoother allocates nothing, with planes and promotions between the steps: malloc is counted.

#include <catch2/catch.hpp>
#include <memory>

#include "tests/smoother/plane_ties.hpp"
#include "tests/support/counted_malloc.hpp"

#ifdef SWIFTLET_COUNTS_MALLOC

using namespace swiftlet;

TEST_CASE("Neither a step nor what happens between two steps allocates", "[smoother][allocation]") {
  const test::TrackFlight flight(test::roomFlight(10, 1));
  test::SmootherRun run(flight);
  test::TieSettings settings;
  settings.max_promoted = kMaxExplicitLandmarks;
  settings.planes = true;
  settings.directions = true;
  test::PlaneTies ties(flight, settings);
  const bool counting = test::mallocIsCounted();
  long allocated = 0;
  bool ok = true;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                const long before = test::malloc_calls;
                ok = run.step(k).ok() && ok;
                ties.update(run.smoother());
                if (k % 40 == 39) {
                  for (const auto& surface : ties.surfaces()) {
                    if (surface.id) run.smoother().removePlane(*surface.id);
                  }
                }
                allocated += test::malloc_calls - before;
              });
  CHECK(counting);
  CHECK(ok);
  CHECK(allocated == 0);
  CHECK(ties.ties() > 100);
}

#endif
