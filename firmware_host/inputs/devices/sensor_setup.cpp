#include "firmware_host/inputs/devices/sensor_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/device/monotonic_now.hpp"

namespace swiftlet {
namespace {

/// Long enough for 50 readings at 100 Hz.
constexpr Duration kListening = Duration::fromMilliseconds(500);
/// Sensors answer within tens of milliseconds.
constexpr Duration kPatience = Duration::fromMilliseconds(500);
constexpr Duration kRound = Duration::fromMilliseconds(5);
/// Relative deviation from the rate up to which a sensor is not configured.
constexpr double kTolerance = 0.05;
/// With fewer readings the rate is unknown.
constexpr int kFewest = 10;

}  // namespace

void SensorSetup::run(LinkPort& port, ImuDecoder& decoder) {
  ImuConfiguration configuration(decoder.protocol(), rate_);
  if (rate_ <= 0 || configuration.steps() == 0) return;
  if (!asks_ || !set_) {
    listened_ = true;
    found_ = listen(port, decoder);
    decoder.restart();
    asks_ = std::abs(found_ - rate_) > kTolerance * rate_;
  }
  if (!asks_) return;
  set_.reset();
  for (std::size_t i = 0; i < configuration.steps(); ++i) {
    const ConfigurationStep step = configuration.step(i);
    if (ask(port, step)) {
      configuration.answered(i, std::span(heard_).subspan(reply_, step.answer_length));
      continue;
    }
    warning_ =
        deviceFault(DeviceFaultKind::kUnsupported, 0,
                    "%.0f Hz requested, but \"%s\" got %s: set the output rate with the maker's program",
                    rate_, step.what, reply_ < count_ ? "a refusal" : "no reply");
    // The last step lets the sensor send again.
    static_cast<void>(ask(port, configuration.step(configuration.steps() - 1)));
    return;
  }
  set_ = configuration.rate();
  if (std::abs(*set_ - rate_) > kTolerance * rate_) {
    warning_ = deviceFault(DeviceFaultKind::kChanged, 0, "%.0f Hz requested, %.1f Hz set", rate_, *set_);
  }
}

double SensorSetup::listen(LinkPort& port, ImuDecoder& decoder) {
  Stamp first, last;
  int readings = 0;
  const Stamp end = monotonicNow() + kListening;
  while (monotonicNow() < end) {
    port.wait(kRound);
    std::size_t count = 0;
    Stamp read_at;
    if (!port.read(heard_, count, read_at).ok()) return 0;
    static_cast<void>(decoder.feed(std::span(heard_).first(count), read_at, port.byteTime()));
    for (ImuReading reading; decoder.next(reading); ++readings) {
      last = reading.device.value_or(reading.arrival);
      if (readings == 0) first = last;
    }
  }
  if (readings < kFewest || last <= first) return 0;
  return (readings - 1) / (last - first).seconds();
}

bool SensorSetup::ask(LinkPort& port, const ConfigurationStep& step) {
  count_ = reply_ = 0;
  if (!port.write(std::span<const std::uint8_t>(step.bytes.data(), step.bytes.size())).ok()) return false;
  const Stamp end = monotonicNow() + kPatience;
  while (monotonicNow() < end) {
    port.wait(kRound);
    // Readings that keep arriving push older bytes out.
    if (count_ > heard_.size() / 2) {
      std::copy(heard_.begin() + static_cast<std::ptrdiff_t>(count_ / 2),
                heard_.begin() + static_cast<std::ptrdiff_t>(count_), heard_.begin());
      count_ -= count_ / 2;
    }
    std::size_t count = 0;
    Stamp read_at;
    if (!port.read(std::span(heard_).subspan(count_), count, read_at).ok()) return false;
    count_ += count;
    const auto heard = std::span<const std::uint8_t>(heard_).first(count_);
    const auto begin = std::search(heard.begin(), heard.end(), step.reply.begin(), step.reply.end());
    reply_ = static_cast<std::size_t>(begin - heard.begin());
    if (count_ - reply_ >= step.answer_length) return true;
    if (step.refusal.empty() || reply_ < count_) continue;
    const auto refused = std::search(heard.begin(), heard.end(), step.refusal.begin(), step.refusal.end());
    // If a refusal differs from a reply only in its last bytes, wait for these.
    if (static_cast<std::size_t>(heard.end() - refused) < std::max(step.refusal.size(), step.reply.size()))
      continue;
    reply_ = static_cast<std::size_t>(refused - heard.begin());
    return false;
  }
  reply_ = count_;
  return false;
}

bool SensorSetup::nextWarning(DeviceFault& warning) {
  if (!warning_) return false;
  warning = *warning_;
  warning_.reset();
  return true;
}

std::string SensorSetup::text() const {
  if (!listened_) return {};
  if (!asks_) return fmt::format("sends at {:.0f} Hz: unchanged", found_);
  if (set_) return fmt::format("sent at {:.0f} Hz, set to {:.1f} Hz", found_, *set_);
  return fmt::format("sends at {:.0f} Hz and could not be set to {:.0f} Hz", found_, rate_);
}

}  // namespace swiftlet
