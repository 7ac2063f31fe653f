#include "drivers/timesync/accel_at_gyro.hpp"

namespace swiftlet {

void AccelAtGyro::add(Queue& queue, const Sample& sample) {
  if (queue.any && sample.stamp <= queue.newest) {
    ++counters_.stale;
    return;
  }
  queue.any = true;
  queue.newest = sample.stamp;
  if (queue.count == kRoom) {
    queue.pop();
    // Dropped accelerometer samples are not counted: once the gyro has stopped, they are not needed.
    if (&queue == &gyro_) ++counters_.overrun;
  }
  queue.samples[(queue.first + queue.count) % kRoom] = sample;
  ++queue.count;
}

bool AccelAtGyro::next(Stamp now, ImuReading& reading) {
  for (; gyro_.count > 0; gyro_.pop()) {
    const Sample& gyro = gyro_.at(0);
    // The newest accelerometer sample that is not after the gyro sample stays as the left neighbour.
    while (accel_.count >= 2 && accel_.at(1).stamp <= gyro.stamp) accel_.pop();
    const bool has_left = accel_.count > 0 && accel_.at(0).stamp <= gyro.stamp;
    const bool exact = has_left && accel_.at(0).stamp == gyro.stamp;
    const bool has_right = exact || (has_left ? accel_.count >= 2 : accel_.count > 0);
    if (!has_right && now - gyro.arrival < kPatience) return false;
    if (!has_right || !has_left) {
      ++counters_.unpaired;
      continue;
    }
    const Sample& left = accel_.at(0);
    const Sample& right = accel_.at(exact ? 0 : 1);
    const Duration gap = right.stamp - left.stamp;
    if (gap > kLongestGap) {
      ++counters_.unpaired;
      continue;
    }
    const double share =
        gap.ns > 0 ? static_cast<double>((gyro.stamp - left.stamp).ns) / static_cast<double>(gap.ns) : 0;
    reading = {};
    reading.arrival = gyro.arrival;
    reading.host = gyro.stamp;
    reading.gyro = gyro.value;
    reading.accel = left.value + share * (right.value - left.value);
    gyro_.pop();
    return true;
  }
  return false;
}

}  // namespace swiftlet
