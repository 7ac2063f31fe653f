#pragma once
// An autopilot as PX4 behaves on one link, with frames of its own making: written from MAVLink's and PX4's
// documents, not from drivers/mavlink, so that a mistake there is not made here too.
//
// It beats once a second, asks for the time ten times a second and answers at once, sends HIGHRES_IMU 50
// times a second until COMMAND_LONG asks for another interval, and ATTITUDE beside. Its readings are means
// over kInterval, stamped at the interval's end with its own clock; their first number tells which reading it
// is. All that it sends and hears is delayed at random and paced to the link's bytes a second.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet::test {

class FarAutopilot {
 public:
  using Bytes = std::vector<std::uint8_t>;
  static constexpr Duration kInterval = Duration::fromMilliseconds(5);  ///< IMU_INTEG_RATE 200
  /// Numbers of readings within this; a float holds them exactly, and a thousandth of them to 1e-5.
  static constexpr int kNumbers = 32'768;

  struct Options {
    double bytes_per_second = 92'000;
    double most_delay = 2e-3;  ///< s, one way, even from 0
    double skew = 40e-6;
    double offset = 777;  ///< s, of its clock
    bool has_highres = true;
    std::uint64_t seed = 1;
  };

  explicit FarAutopilot(Stamp begin, const Options& options)
      : options_(options), begin_(begin), random_(options.seed), next_reading_(begin) {}

  /// What it did and heard.
  std::vector<Stamp> middles;  ///< of each reading's interval, host's clock
  std::map<std::uint32_t, std::uint64_t> heard;
  std::uint64_t garbled_bytes = 0, sequence_gaps = 0, poses_back = 0, requests = 0;
  double asked_interval = 0;            ///< s, of the newest command
  std::vector<double> pose_errors;      ///< s, of each pose's stamp from the reading that it names
  std::vector<double> clock_errors;     ///< s, of the offset that each answer to TIMESYNC tells
  std::vector<Stamp> pose_times;        ///< when each pose was heard
  std::vector<std::uint32_t> commands;  ///< the messages asked for

  [[nodiscard]] Stamp clock(Stamp host) const {
    const double since = (host - begin_).seconds();
    return Stamp{static_cast<std::int64_t>((options_.offset + since * (1 + options_.skew)) * 1e6) * 1000};
  }
  [[nodiscard]] Stamp host(std::int64_t clock_ns) const {
    return begin_ + Duration::fromSeconds((static_cast<double>(clock_ns) * 1e-9 - options_.offset) /
                                          (1 + options_.skew));
  }
  /// As a restart does: the interval that was asked for is gone.
  void forget() { interval_ = kDefaultInterval; }

  /// Bytes that came from the vehicle's computer by `now`.
  void receive(Stamp now, std::span<const std::uint8_t> bytes) {
    if (!bytes.empty()) down_.push(now, {bytes.begin(), bytes.end()}, delay());
  }
  /// What it has to say by `now`, each with when it is through: `emit(bytes, at)`. `read_clock(at)`: the time
  /// at which what was through at `at` is handled; of a simulation that very time.
  template <typename Clock, typename Emit>
  void step(Stamp now, Clock&& read_clock, Emit&& emit) {
    Stamp at;
    for (Bytes bytes; down_.pop(now, kUnlimited, bytes, at);) {
      waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
      parse(read_clock(at));
    }
    for (; next_reading_ <= now; next_reading_ = next_reading_ + kInterval) sense(next_reading_);
    if (now >= next_beat_) {
      next_beat_ = now + Duration::fromMilliseconds(1000);
      beat(now);
    }
    if (now >= next_ask_) {
      next_ask_ = now + Duration::fromMilliseconds(100);
      const Stamp asked = read_clock(now);
      Payload payload;
      payload.add(std::int64_t{0});
      payload.add(clock(asked).ns);
      send(asked, 111, 34, payload);
    }
    budget_ = std::min(budget_ + (now - stepped_).seconds() * options_.bytes_per_second, kMostBurst);
    stepped_ = now;
    for (Bytes bytes; up_.pop(now, budget_, bytes, at);) {
      budget_ -= static_cast<double>(bytes.size());
      emit(bytes, at);
    }
  }

 private:
  static constexpr double kUnlimited = 1e9;
  static constexpr double kMostBurst = 200;  ///< bytes: what two milliseconds carry
  static constexpr Duration kDefaultInterval = Duration::fromMilliseconds(20);

  /// What is on its way, in order.
  struct Way {
    std::deque<std::pair<Stamp, Bytes>> messages;
    Stamp last;
    void push(Stamp now, Bytes bytes, Duration delay) {
      last = std::max(last, now + delay);
      messages.emplace_back(last, std::move(bytes));
    }
    bool pop(Stamp now, double room, Bytes& bytes, Stamp& at) {
      if (messages.empty() || messages.front().first > now) return false;
      if (static_cast<double>(messages.front().second.size()) > room) return false;
      at = messages.front().first;
      bytes = std::move(messages.front().second);
      messages.pop_front();
      return true;
    }
  };
  struct Payload {
    Bytes bytes;
    template <typename T>
    void add(T value) {
      std::array<std::uint8_t, sizeof(T)> raw;
      std::memcpy(raw.data(), &value, sizeof(T));  // little-endian hosts
      bytes.insert(bytes.end(), raw.begin(), raw.end());
    }
  };
  template <typename T>
  static T field(std::span<const std::uint8_t> payload, std::size_t at) {
    std::array<std::uint8_t, sizeof(T)> raw = {};
    for (std::size_t i = 0; i < sizeof(T) && at + i < payload.size(); ++i) raw.at(i) = payload[at + i];
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }

  /// X.25, bit by bit, as the MAVLink guide describes it.
  static std::uint16_t checksum(std::span<const std::uint8_t> bytes, std::uint8_t extra) {
    std::uint16_t crc = 0xFFFF;
    const auto take = [&crc](std::uint8_t byte) {
      for (int bit = 0; bit < 8; ++bit, byte = static_cast<std::uint8_t>(byte >> 1U)) {
        const bool odd = ((crc ^ byte) & 1U) != 0;
        crc = static_cast<std::uint16_t>(crc >> 1U);
        if (odd) crc ^= 0x8408U;
      }
    };
    for (const std::uint8_t byte : bytes) take(byte);
    take(extra);
    return crc;
  }

  Duration delay() { return Duration::fromSeconds(options_.most_delay * random_.uniform()); }

  void send(Stamp now, std::uint32_t id, std::uint8_t extra, Payload payload) {
    Bytes& body = payload.bytes;
    while (body.size() > 1 && body.back() == 0) body.pop_back();
    Bytes frame = {0xFD,
                   static_cast<std::uint8_t>(body.size()),
                   0,
                   0,
                   sequence_++,
                   1,
                   1,
                   static_cast<std::uint8_t>(id),
                   static_cast<std::uint8_t>(id >> 8U),
                   0};
    frame.insert(frame.end(), body.begin(), body.end());
    const std::uint16_t crc = checksum(std::span(frame).subspan(1), extra);
    frame.push_back(static_cast<std::uint8_t>(crc));
    frame.push_back(static_cast<std::uint8_t>(crc >> 8U));
    up_.push(now, std::move(frame), delay());
  }

  void beat(Stamp now) {
    Payload payload;
    payload.add(std::uint32_t{0});
    for (const int value : {2, 12, 81, 3, 3})
      payload.add(static_cast<std::uint8_t>(value));  // a quadrotor with PX4
    send(now, 0, 50, payload);
  }

  void sense(Stamp end) {
    ++intervals_;
    if (intervals_ % 4 == 0) {  // ATTITUDE, 50 a second
      Payload attitude;
      attitude.add(static_cast<std::uint32_t>((clock(end) - Stamp{}).seconds() * 1e3));
      for (int i = 0; i < 6; ++i) attitude.add(0.125F * static_cast<float>(i + 1));
      send(end, 30, 39, attitude);
    }
    if (end < next_stream_) return;
    // By the interval on the mean.
    next_stream_ = std::max(next_stream_ + interval_, end + Duration{interval_.ns / 2});
    const auto number = static_cast<float>(middles.size() % kNumbers);
    if (options_.has_highres) {
      Payload imu;
      imu.add(static_cast<std::uint64_t>(clock(end).ns / 1000));
      for (const float value : {number, 2.F, -9.8F, 0.25F, -0.5F, 0.125F}) imu.add(value);
      for (int i = 0; i < 7; ++i) imu.add(0.5F);  // magnetometer, pressures, temperature
      imu.add(std::uint16_t{0x3F});
      middles.push_back(end - Duration{kInterval.ns / 2});
      send(end, 105, 93, imu);
    } else if (raw_) {
      Payload imu;
      imu.add(static_cast<std::uint64_t>(clock(end).ns / 1000));
      for (const int value : {static_cast<int>(number), 200, -1000, 250, -500, 125, 1, 2, 3})
        imu.add(static_cast<std::int16_t>(value));
      middles.push_back(end);
      send(end, 27, 144, imu);
    }
  }

  void parse(Stamp now) {
    static const std::map<std::uint32_t, std::uint8_t> kExtras = {{0, 50},   {76, 152}, {102, 158}, {111, 34},
                                                                  {253, 83}, {330, 23}, {331, 91}};
    constexpr std::size_t kHeader = 10, kAround = 12;
    while (!waiting_.empty()) {
      const std::size_t length = waiting_.size() > 1 ? waiting_[1] + kAround : kAround;
      if (waiting_[0] == 0xFD && waiting_.size() < length) return;
      const auto frame = std::span<const std::uint8_t>(waiting_).first(std::min(length, waiting_.size()));
      const std::uint32_t id = frame.size() < kAround ? 0 : field<std::uint32_t>(frame, 7) & 0xFFFFFFU;
      const auto extra = kExtras.find(id);
      const bool whole =
          frame.size() >= kAround && frame[0] == 0xFD && extra != kExtras.end() &&
          checksum(frame.subspan(1, length - 3), extra->second) == field<std::uint16_t>(frame, length - 2);
      if (!whole) {
        ++garbled_bytes;
        waiting_.erase(waiting_.begin());
        continue;
      }
      const int sender = frame[5] * 256 + frame[6];
      const auto before = sequences_.find(sender);
      if (before != sequences_.end() && static_cast<std::uint8_t>(before->second + 1) != frame[4])
        ++sequence_gaps;
      sequences_[sender] = frame[4];
      ++heard[id];
      take(id, frame[5], frame[6], frame.subspan(kHeader, length - kAround), now);
      waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(length));
    }
  }

  void take(std::uint32_t id, std::uint8_t system, std::uint8_t component,
            std::span<const std::uint8_t> payload, Stamp now) {
    if (id == 111) {
      const auto tc1 = field<std::int64_t>(payload, 0), ts1 = field<std::int64_t>(payload, 8);
      if (tc1 == 0) {
        Payload answer;
        answer.add(clock(now).ns);
        answer.add(ts1);
        answer.add(system);
        answer.add(component);
        send(now, 111, 34, answer);
      } else {
        // As PX4 reckons: the host's clock at the middle of the trip.
        const double middle = ((clock(now) - Stamp{}).seconds() + static_cast<double>(ts1) * 1e-9) / 2;
        const Stamp at = host(static_cast<std::int64_t>(middle * 1e9));
        clock_errors.push_back(std::abs((Stamp{tc1} - at).seconds()));
      }
    } else if (id == 76 && field<std::uint16_t>(payload, 28) == 511) {
      command(now, field<float>(payload, 0), field<float>(payload, 4), system, component);
    } else if (id == 331) {
      takePose(payload, now);
    }
  }

  void command(Stamp now, float message, float interval_us, std::uint8_t system, std::uint8_t component) {
    ++requests;
    commands.push_back(static_cast<std::uint32_t>(message));
    const bool taken = (message == 105 && options_.has_highres) || (message == 27 && !options_.has_highres);
    if (taken) {
      asked_interval = static_cast<double>(interval_us) * 1e-6;
      interval_ = Duration::fromSeconds(asked_interval);
      raw_ = message == 27;
    }
    Payload ack;
    ack.add(std::uint16_t{511});
    for (const int value : {taken ? 0 : 4, 0}) ack.add(static_cast<std::uint8_t>(value));
    ack.add(std::int32_t{0});
    ack.add(system);
    ack.add(component);
    send(now, 77, 143, ack);
  }

  void takePose(std::span<const std::uint8_t> payload, Stamp now) {
    const auto usec = field<std::uint64_t>(payload, 0);
    if (usec <= newest_pose_) ++poses_back;
    newest_pose_ = usec;
    pose_times.push_back(now);
    // The newest reading with this number.
    const int number = static_cast<int>(std::lround(field<float>(payload, 8) * 1000));
    const int newest = static_cast<int>(middles.size()) - 1;
    const int back = ((newest - number) % kNumbers + kNumbers) % kNumbers;
    if (back > newest) return;
    const Stamp truth = middles.at(static_cast<std::size_t>(newest - back));
    pose_errors.push_back(std::abs(static_cast<double>(usec) * 1e-6 - (truth - Stamp{}).seconds()));
  }

  Options options_;
  Stamp begin_;
  Random random_;
  Way up_, down_;
  Bytes waiting_;
  std::uint8_t sequence_ = 0;
  std::map<int, std::uint8_t> sequences_;
  Duration interval_ = kDefaultInterval;
  bool raw_ = false;
  Stamp next_reading_, next_stream_, next_beat_, next_ask_;
  std::uint64_t intervals_ = 0;
  std::uint64_t newest_pose_ = 0;
  double budget_ = 0;
  Stamp stepped_;
};

}  // namespace swiftlet::test
