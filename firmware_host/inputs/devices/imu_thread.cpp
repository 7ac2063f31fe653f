#include "firmware_host/inputs/devices/imu_thread.hpp"

#include <poll.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/inputs/devices/device_times.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Two maps of one clock differ by the link's constant delay, which is shorter than this. If they differ by
/// more, one of them has not noticed a clock step yet.
constexpr Duration kLongestDelay = Duration::fromMilliseconds(100);
/// The constant delay hardly changes in flight. If the difference between the maps suddenly changes by more
/// than this, one of them has noticed a clock step; if the change lasts for kSettling, the link itself has
/// changed.
constexpr Duration kTransportChange = Duration::fromMilliseconds(3);
constexpr Duration kSettling = Duration::fromMilliseconds(10'000);

/// A device that sends nothing useful, or less than kLeastRate of its rate, for kRestartAfter may have lost
/// power and thereby its configuration. Shorter gaps are transmission losses.
constexpr Duration kRestartAfter = Duration::fromMilliseconds(2000);
/// Share of the expected rate. Sensors fall back to factory settings of 40 to 100 Hz; losses are smaller.
constexpr double kLeastRate = 0.5;

/// s; motors vibrate above 15 Hz, but move the image by little.
constexpr double kTurnSmoothing = 0.01;

Duration magnitude(Duration d) { return {std::abs(d.ns)}; }

}  // namespace

ImuThread::ImuThread(std::string name, std::unique_ptr<ImuLink> link, const ImuCorrection& correction,
                     Duration delay, double rate)
    : link_(std::move(link)),
      journal_(std::move(name)),
      correction_(correction),
      delay_(delay),
      clock_(delay),
      rate_(rate),
      restart_wait_(kFirstRestartWait) {}

void ImuThread::run(SensorSink& sink, const ImuEdges& edges, const RunControl& control) {
  // The arrival times of data queued before the flight are unknown.
  link_->discard();
  hear();
  while (!control.stopped()) {
    heart_.beat();
    if (!link_->isOpen()) {
      if (const DeviceFault fault = link_->open(); !fault.ok()) {
        journal_.fault(monotonicNow(), fault);
        sleepFor(kReopenPeriod);
        continue;
      }
      hear();
    }
    std::array<pollfd, 2> waiting = {{{link_->fd(), POLLIN, 0}, {link_->wakeFd(), POLLIN, 0}}};
    poll(waiting.data(), waiting.size(), kPollMilliseconds);
    const Stamp now = monotonicNow();
    DeviceFault fault = link_->receive(now);
    takeReadings(sink, edges);
    if (fault.ok()) fault = link_->send();
    for (DeviceFault remark; link_->nextRemark(remark);) journal_.note(now, remark);
    if (fault.ok()) {
      watchSilence(now);
      restart(now);
    } else {
      journal_.fault(now, fault);
    }
  }
}

void ImuThread::takeReadings(SensorSink& sink, const ImuEdges& edges) {
  const std::uint64_t handed = counted_.samples;
  ImuReading reading;
  std::size_t readings = 0;
  while (link_->next(reading)) {
    hand(reading, sink);
    ++readings;
  }
  TriggerEdge edge;
  while (link_->nextEdge(edge)) {
    if (edge.rising.value_or(edges.rising) != edges.rising || edge.line != edges.line.value_or(edge.line)) {
      continue;
    }
    const std::optional<Stamp> stamp = hostOf(edge.device);
    if (!stamp) continue;
    ++counted_.edges;
    counted_.edge = monotonicNow();
    for (EdgeRing* ring : edges.cameras) static_cast<void>(ring->tryPush({*stamp, edge.counter}));
  }
  if (readings == 0) return;
  if (counted_.samples > handed) {
    hear();
    watchQuality(readings);
  }
  status_.write(counted_);
}

void ImuThread::hear() {
  heard_ = monotonicNow();
  received_ = link_->received();
  refused_ = counted_.refused;
}

void ImuThread::hand(const ImuReading& reading, SensorSink& sink) {
  ImuSample sample;
  const bool stamped = stampOf(reading, sample.stamp);
  sample.stamp = sample.stamp - reading.mean_age;
  if (!stamped || sample.stamp <= newest_) {
    ++counted_.refused;
    return;
  }
  const double step = std::min((sample.stamp - newest_).seconds(), kTurnSmoothing);
  newest_ = sample.stamp;
  sample.gyro = correction_.gyroOf(reading.gyro, reading.accel);
  turning_ += step / kTurnSmoothing * (sample.gyro - turning_);
  turn_rate_.write({turning_.norm(), reading.arrival});
  sample.accel = correction_.accelOf(reading.accel);
  ++counted_.samples;
  sink.takeImu(sample, reading.arrival, {secondsOf(sample.stamp), wallSeconds()});
}

bool ImuThread::stampOf(const ImuReading& reading, Stamp& stamp) {
  if (reading.host) {
    stamp = *reading.host - delay_;
    ++counted_.by_driver;
    return true;
  }
  if (!reading.device) {
    stamp = reading.arrival - delay_;
    ++counted_.by_arrival;
    return true;
  }
  // Also while the exchange is certain: it notices a clock step some tenths of a second later than this map.
  if (!clock_.add(*reading.device, reading.arrival, stamp).ok()) return false;
  arrival_ = reading.arrival;
  const std::optional<Stamp> one_way = clock_.toHost(*reading.device);
  const std::optional<Stamp> exchanged = one_way ? byExchange(*reading.device, *one_way) : std::nullopt;
  if (!exchanged || *exchanged > reading.arrival) {
    stamp = stamp - transport_.value_or(Duration{});
    return true;
  }
  transport_ = *one_way - *exchanged;
  agreed_ = reading.arrival;
  stamp = *exchanged;
  ++counted_.by_exchange;
  return true;
}

std::optional<Stamp> ImuThread::byExchange(Stamp device, Stamp one_way) const {
  const std::optional<Stamp> exchanged = link_->toHost(device);
  if (!exchanged) return std::nullopt;
  const Duration apart = one_way - (*exchanged - delay_);
  if (magnitude(apart) > kLongestDelay) return std::nullopt;
  const bool lately = transport_ && arrival_ - agreed_ < kSettling;
  if (lately && magnitude(apart - *transport_) > kTransportChange) return std::nullopt;
  return *exchanged - delay_;
}

std::optional<Stamp> ImuThread::hostOf(Stamp device) const {
  const std::optional<Stamp> one_way = clock_.toHost(device);
  if (!one_way) return std::nullopt;
  const std::optional<Stamp> exchanged = byExchange(device, *one_way);
  return exchanged ? exchanged : *one_way - transport_.value_or(Duration{});
}

/// Watches the clock and the rate of a device that sends.
void ImuThread::watchQuality(std::size_t readings) {
  const TimesyncStatus before = counted_.clock;
  counted_.clock = clock_.status();
  if (counted_.clock.resets > before.resets) {
    journal_.note(heard_, deviceFault(DeviceFaultKind::kClockJumped, 0, "by %.3f s",
                                      (before.offset - counted_.clock.offset).seconds()));
  }
  const bool returned = journal_.standing() != DeviceFaultKind::kNone;
  journal_.works(heard_);
  if (returned) {
    rate_.restart(heard_);
    slow_since_.reset();
  } else if (rate_.add(heard_, readings)) {
    watchRate();
    if (rate_.tooFew()) {
      journal_.defect(heard_,
                      deviceFault(DeviceFaultKind::kLossy, 0, "%.0f of %.0f expected samples in a second",
                                  rate_.seen(), rate_.expected()));
    } else {
      journal_.sound(heard_);
    }
  }
}

void ImuThread::watchRate() {
  if (rate_.seen() >= kLeastRate * rate_.expected()) {
    was_at_rate_ = true;
    slow_since_.reset();
    restart_wait_ = kFirstRestartWait;
  } else if (was_at_rate_ && !slow_since_) {
    // A device that never reached the rate was reported when it was opened; a restart would only interrupt
    // it.
    slow_since_ = heard_;
  }
}

void ImuThread::restart(Stamp now) {
  const bool silent = now - heard_ > kRestartAfter;
  const bool slow = slow_since_ && now - *slow_since_ > kRestartAfter;
  if ((!silent && !slow) || now < restart_at_ || !link_->restart()) return;
  restart_at_ = now + restart_wait_;
  restart_wait_ = std::min(restart_wait_ + restart_wait_, kLongestRestartWait);
  slow_since_.reset();
  rate_.restart(now);
}

void ImuThread::watchSilence(Stamp now) {
  if (!link_->isOpen() || now - heard_ < kLongestSilence) return;
  const double silent = (now - heard_).seconds();
  const auto received = static_cast<unsigned long long>(link_->received() - received_);
  const auto refused = static_cast<unsigned long long>(counted_.refused - refused_);
  if (received == 0) {
    journal_.fault(now, deviceFault(DeviceFaultKind::kSilent, 0, "no data for %.1f s", silent));
  } else if (refused == 0) {
    journal_.fault(
        now, deviceFault(DeviceFaultKind::kGarbage, 0, "%llu bytes or frames in %.1f s without an IMU sample",
                         received, silent));
  } else {
    journal_.fault(
        now, deviceFault(DeviceFaultKind::kFailed, 0,
                         "%llu samples in %.1f s, but the sensor's clock stands still or goes backwards",
                         refused, silent));
  }
}

}  // namespace swiftlet
