// Rates, gaps and pairs of what devices delivered.

#include <catch2/catch.hpp>

#include "firmware_host/inputs/devices/counting_sink.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

void image(CountingSink& sink, std::uint32_t camera, std::int64_t ns) {
  CameraFrame frame;
  frame.camera = camera;
  frame.stamp = {ns};
  sink.takeImage(frame, {});
}

void sample(CountingSink& sink, std::int64_t ns) {
  ImuSample sample;
  sample.stamp = {ns};
  sink.takeImu(sample, {ns}, {});
}

TEST_CASE("rate, usual and largest step are of the stamps") {
  CountingSink sink(1000);
  for (int i = 0; i <= 200; ++i) {
    if (i != 77 && i != 78) sample(sink, 1'000'000'000 + i * 5 * kMillisecond);
  }
  CHECK(sink.imu().rate() == Approx(198));
  CHECK(sink.imu().medianStep().ns == 5 * kMillisecond);
  CHECK(sink.imu().largestStep().ns == 15 * kMillisecond);
}

TEST_CASE("jitter is off the grid of the usual step, latency from stamp to arrival") {
  CountingSink sink(1000);
  for (int i = 0; i < 100; ++i) {
    if (i == 40 || i == 41) continue;
    CameraFrame frame;
    // Each tenth is 2 ms late, in its stamp and on its way.
    const std::int64_t late = i % 10 == 9 ? 2 * kMillisecond : 0;
    frame.stamp = {1'000'000'000 + i * 50 * kMillisecond + late};
    frame.arrival = {frame.stamp.ns + 7 * kMillisecond + late};
    sink.takeImage(frame, {});
  }
  CHECK(sink.camera(0).jitter(0.5).ns == 0);
  CHECK(sink.camera(0).jitter(0.99).ns == 2 * kMillisecond);
  CHECK(sink.camera(0).latency(0.5).ns == 7 * kMillisecond);
  CHECK(sink.camera(0).latency(0.99).ns == 9 * kMillisecond);
  CHECK(sink.camera(1).jitter(0.99).ns == 0);
  CHECK(sink.camera(1).latency(0.99).ns == 0);
}

TEST_CASE("none, one and equal stamps have no rate") {
  CountingSink sink(10);
  CHECK(sink.imu().rate() == 0);
  CHECK(sink.imu().largestStep().ns == 0);
  CHECK(sink.imu().medianStep().ns == 0);
  sample(sink, 5);
  CHECK(sink.imu().rate() == 0);
  sample(sink, 5);
  CHECK(sink.imu().rate() == 0);
}

TEST_CASE("what goes beyond the memory is counted, and the rate is of what was kept") {
  CountingSink sink(100);
  for (int i = 0; i < 150; ++i) sample(sink, i * 10 * kMillisecond);
  CHECK(sink.imu().stamps.size() == 100);
  CHECK(sink.imu().beyond == 50);
  CHECK(sink.imu().rate() == Approx(100));
}

TEST_CASE("images of camera 1 are measured against the nearest of camera 0") {
  CountingSink sink(100);
  CHECK(sink.pairDistances().empty());
  image(sink, 1, 0);
  CHECK(sink.pairDistances().empty());
  for (const std::int64_t ns : {100, 50, 200}) image(sink, 0, ns * kMillisecond);  // one driver's order
  for (const std::int64_t ns : {52, 99, 260}) image(sink, 1, ns * kMillisecond);
  std::vector<std::int64_t> apart;
  for (const Duration distance : sink.pairDistances()) apart.push_back(distance.ns / kMillisecond);
  CHECK(apart == std::vector<std::int64_t>{1, 2, 50, 60});
}

}  // namespace
}  // namespace swiftlet
