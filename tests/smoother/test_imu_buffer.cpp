// The sliding sample store against a list that never forgets.

#include "estimator/smoother/imu_buffer.hpp"

#include <catch2/catch.hpp>

#include "estimator/core/random.hpp"

using namespace swiftlet;

namespace {

ImuSample sampleAt(std::int64_t ns) {
  const auto value = static_cast<double>(ns);
  return {Stamp{ns}, Eigen::Vector3d::Constant(value), Eigen::Vector3d::Constant(-value)};
}

// What `around` promises, said plainly: those inside [from, to], and one neighbour on each side
// where no sample lies on the border itself.
std::vector<std::int64_t> naiveAround(const std::vector<std::int64_t>& stamps, std::int64_t from,
                                      std::int64_t to) {
  std::vector<std::int64_t> result;
  for (std::size_t k = 0; k < stamps.size(); ++k) {
    const bool inside = stamps[k] >= from && stamps[k] <= to;
    const bool left = stamps[k] < from && (k + 1 == stamps.size() || stamps[k + 1] > from);
    const bool right = stamps[k] > to && (k == 0 || stamps[k - 1] < to);
    if (inside || left || right) result.push_back(stamps[k]);
  }
  return result;
}

std::vector<std::int64_t> stampsOf(std::span<const ImuSample> samples) {
  std::vector<std::int64_t> result;
  for (const ImuSample& s : samples) result.push_back(s.stamp.ns);
  return result;
}

}  // namespace

TEST_CASE("The IMU buffer gives an interval's samples and its neighbours", "[smoother][imu_buffer]") {
  constexpr std::size_t kCapacity = 32;
  Random random(3);
  ImuBuffer buffer(kCapacity);
  CHECK(buffer.empty());
  CHECK(buffer.around(Stamp{0}, Stamp{100}).empty());
  std::vector<std::int64_t> all;
  std::int64_t now = 0;
  for (int k = 0; k < 500; ++k) {
    now += 1 + random.below(9);
    buffer.push(sampleAt(now));
    all.push_back(now);
    if (all.size() > kCapacity) all.erase(all.begin());
    REQUIRE_FALSE(buffer.empty());
    CHECK(buffer.newest().stamp.ns == now);
    for (int query = 0; query < 20; ++query) {
      const auto span = static_cast<std::uint32_t>(now - all.front() + 20);
      const std::int64_t a = all.front() - 10 + random.below(span);
      const std::int64_t b = all.front() - 10 + random.below(span);
      const auto [from, to] = std::minmax(a, b);
      REQUIRE(stampsOf(buffer.around(Stamp{from}, Stamp{to})) == naiveAround(all, from, to));
    }
    // The content moves with the stamp.
    const auto found = buffer.around(Stamp{now}, Stamp{now});
    REQUIRE(found.size() == 1);
    CHECK(found.front().gyro.x() == static_cast<double>(now));
  }
  buffer.clear();
  CHECK(buffer.empty());
  CHECK(buffer.around(Stamp{0}, Stamp{now}).empty());
  buffer.push(sampleAt(5));
  CHECK(stampsOf(buffer.around(Stamp{0}, Stamp{9})) == std::vector<std::int64_t>{5});
}
