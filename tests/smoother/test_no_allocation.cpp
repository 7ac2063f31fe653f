// A step of the smoother allocates nothing, with planes and promotions between the steps: malloc is counted.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <memory>

#include "tests/smoother/plane_ties.hpp"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

namespace {
long allocation_count = 0;
}  // namespace

extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++allocation_count;
  return __libc_malloc(size);
}

using namespace swiftlet;

TEST_CASE("Neither a step nor what happens between two steps allocates", "[smoother][allocation]") {
  const test::TrackFlight flight(test::roomFlight(10, 1));
  test::SmootherRun run(flight);
  test::TieSettings settings;
  settings.max_promoted = kMaxExplicitLandmarks;
  settings.planes = true;
  settings.directions = true;
  test::PlaneTies ties(flight, settings);
  const long control = allocation_count;
  free(malloc(8));
  const bool counting = allocation_count > control;
  long allocated = 0;
  bool ok = true;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                const long before = allocation_count;
                ok = run.step(k).ok() && ok;
                ties.update(run.smoother());
                if (k % 40 == 39) {
                  for (const auto& surface : ties.surfaces()) {
                    if (surface.id) run.smoother().removePlane(*surface.id);
                  }
                }
                allocated += allocation_count - before;
              });
  CHECK(counting);
  CHECK(ok);
  CHECK(allocated == 0);
  CHECK(ties.ties() > 100);
}

#endif
