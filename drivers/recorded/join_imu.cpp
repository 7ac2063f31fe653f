#include "drivers/recorded/join_imu.hpp"

namespace swiftlet {
namespace {

// Accelerometers run at 60 Hz and more. A longer gap means lost samples, and interpolation across it would be
// wrong.
constexpr Duration kLongestGap = Duration::fromMilliseconds(100);

}  // namespace

std::vector<ImuSample> joinImu(const std::vector<ImuSample>& gyro, const std::vector<ImuSample>& accel,
                               std::uint64_t& left_out) {
  std::vector<ImuSample> joined;
  joined.reserve(gyro.size());
  std::size_t after = 0;  // first accelerometer sample not before the gyroscope's
  for (const ImuSample& sample : gyro) {
    while (after < accel.size() && accel[after].stamp < sample.stamp) ++after;
    const bool same = after < accel.size() && accel[after].stamp == sample.stamp;
    const bool between =
        after > 0 && after < accel.size() && accel[after].stamp - accel[after - 1].stamp <= kLongestGap;
    if (!same && !between) {
      ++left_out;
      continue;
    }
    ImuSample both = sample;
    both.accel = accel[after].accel;
    if (!same) {
      const ImuSample& before = accel[after - 1];
      const double part =
          (sample.stamp - before.stamp).seconds() / (accel[after].stamp - before.stamp).seconds();
      both.accel = before.accel + part * (accel[after].accel - before.accel);
    }
    joined.push_back(both);
  }
  return joined;
}

}  // namespace swiftlet
