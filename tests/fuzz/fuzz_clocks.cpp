#include "tests/fuzz/fuzz_clocks.hpp"

#include <cstdint>
#include <limits>

#include "drivers/timesync/clock_map.hpp"
#include "drivers/timesync/trigger_matcher.hpp"
#include "drivers/timesync/two_way_clock_map.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

class ByteReader {
 public:
  explicit ByteReader(std::string_view text) : text_(text) {}
  [[nodiscard]] bool more() const { return at_ < text_.size(); }
  std::uint8_t byte() { return more() ? static_cast<std::uint8_t>(text_[at_++]) : 0; }
  std::int64_t any() {
    std::uint64_t value = 0;
    for (int i = 0; i < 8; ++i) value = value << 8U | byte();
    return static_cast<std::int64_t>(value);
  }
  /// Of any size from 1 ns to a day: a byte for the size, one for the rest.
  std::int64_t step() {
    constexpr unsigned kLargest = 46;
    const std::uint64_t size = std::uint64_t{1} << (byte() % kLargest);
    return static_cast<std::int64_t>(size + size / 256 * byte());
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
};

/// Wraps instead of overflowing: the fuzzer's own sums are not under test.
std::int64_t sum(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}

struct World {
  explicit World(ByteReader& bytes) : train({bytes.step()}), matcher(train, Duration{bytes.step()}) {}

  void sample(Stamp device, Stamp arrival) {
    Stamp out;
    if (!one_way.add(device, arrival, out).ok()) return;
    demand(out > last);
    last = out;
  }
  void frame(Stamp stamp, std::uint32_t sequence, Stamp arrival) {
    TriggerMatch match;
    if (!matcher.match({stamp, sequence, arrival}, match).ok()) return;
    const double off =
        static_cast<double>((stamp - match.edge).ns) - static_cast<double>(matcher.status().offset.ns);
    const double period = static_cast<double>(train.period().ns);
    demand(off <= 0.51 * period + 2 && off >= -0.51 * period - 2);
  }

  ClockMap one_way;
  TwoWayClockMap two_way;
  EdgeTrain train;
  TriggerMatcher matcher;
  Stamp last{std::numeric_limits<std::int64_t>::min()};
};

}  // namespace

void clocks(std::string_view text) {
  ByteReader bytes(text);
  World world(bytes);
  std::int64_t device = 0, host = 0;
  std::uint32_t sequence = 0;
  while (bytes.more()) {
    const std::uint8_t command = bytes.byte();
    const int times = 1 + command / 16;
    switch (command % 16) {
      case 0:
        device = bytes.any();
        break;
      case 1:
        host = bytes.any();
        break;
      case 2:
        sequence += bytes.byte();
        break;
      case 3:
        sequence = static_cast<std::uint32_t>(bytes.any());
        break;
      case 4:
        device = sum(device, -bytes.step());
        break;
      case 5:
        world.train.add({bytes.any()}, sequence);
        break;
      case 8:
        (void)world.two_way.add({{bytes.any()}, {device}, {bytes.any()}});
        break;
      case 9: {
        (void)world.one_way.toHost({bytes.any()});
        (void)world.two_way.toHost({bytes.any()});
        (void)world.train.at(bytes.any());
        (void)world.train.nearest({bytes.any()});
        break;
      }
      default: {
        // Both clocks go on; what comes of it depends on the command.
        const std::int64_t step = command % 16 > 12 ? world.train.period().ns : bytes.step();
        const std::int64_t late = bytes.step();
        for (int i = 0; i < times; ++i) {
          device = sum(device, step);
          host = sum(host, step);
          if (command % 2 == 0) world.sample({device}, {sum(host, late)});
          if (command % 4 == 1) (void)world.two_way.add({{host}, {device}, {sum(host, late)}});
          if (command % 16 > 12) world.train.add({host});
          if (command % 16 > 13) world.frame({sum(host, late % 1000)}, sequence++, {sum(host, late)});
        }
      }
    }
  }
  (void)world.one_way.status();
  (void)world.two_way.status();
  (void)world.matcher.status();
}

}  // namespace swiftlet::fuzz
