#include "firmware_host/lab/hil/played_imu.hpp"

#include <cmath>

namespace swiftlet {
namespace {

/// Reading of the sensor's clock at the log's first image: the sensor was switched on some time before.
constexpr Duration kSensorUptime = Duration::fromMilliseconds(1'234'567);
constexpr double kMillion = 1e6;

}  // namespace

PlayedImu::PlayedImu(std::unique_ptr<ImuWire> wire, LogReader& reader, const FaultTimeline& faults,
                     const ImuCorrection& correction, double skew_ppm)
    : wire_(std::move(wire)),
      reader_(reader),
      faults_(faults),
      to_readings_(correction.inverse()),
      rate_(1 + skew_ppm / kMillion),
      next_(reader.sample()) {}

void PlayedImu::begin(const FrameGrid& grid, Stamp last_log) {
  grid_ = grid;
  // Samples from before the first image are skipped: motion in front of black images would be inconsistent.
  while (next_ && next_->stamp < grid.first_log - grid.period) next_ = reader_.sample();
  last_log_ = last_log;
}

std::optional<Stamp> PlayedImu::due() const {
  if (!next_ || next_->stamp > last_log_) return std::nullopt;
  return grid_.toHost(next_->stamp);
}

DeviceFault PlayedImu::step(Stamp now) {
  const Duration time = now - grid_.first;
  const bool gone = faults_.active(FaultDevice::kImu, PlannedFaultKind::kUnplug, time) != nullptr;
  if (gone != unplugged_) {
    const DeviceFault fault = gone ? wire_->unplug() : wire_->open();
    if (!fault.ok()) return fault;
    unplugged_ = gone;
  }
  for (std::optional<Stamp> when = due(); when && *when <= now; when = due()) {
    lateness_.add((now - *when).seconds());
    if (const DeviceFault fault = send(*next_, *when - grid_.first); !fault.ok()) return fault;
    next_ = reader_.sample();
  }
  return {};
}

DeviceFault PlayedImu::send(const ImuSample& sample, Duration time) {
  const std::uint64_t number = number_++;
  const PlannedFault* drop = faults_.active(FaultDevice::kImu, PlannedFaultKind::kDrop, time);
  const bool dropped = drop != nullptr && faults_.strikes(*drop, number);
  if (unplugged_ || dropped || faults_.active(FaultDevice::kImu, PlannedFaultKind::kStall, time) != nullptr) {
    ++counters_.withheld;
    return {};
  }
  if (faults_.active(FaultDevice::kImu, PlannedFaultKind::kGarbage, time) != nullptr) {
    ++counters_.withheld;
    return wire_->sendGarbage(number);
  }
  ImuReading reading;
  reading.device =
      Stamp{} + kSensorUptime + Duration::fromSeconds(time.seconds() * rate_) + faults_.clockStep(time);
  reading.counter = number;
  reading.gyro = to_readings_.gyroOf(sample.gyro, sample.accel);
  reading.accel = to_readings_.accelOf(sample.accel);
  ++counters_.sent;
  return wire_->send(reading);
}

}  // namespace swiftlet
