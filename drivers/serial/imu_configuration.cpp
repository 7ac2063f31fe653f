#include "drivers/serial/imu_configuration.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "drivers/device/byte_fields.hpp"
#include "drivers/serial/mip.hpp"

namespace swiftlet {
namespace {

/// A literal's characters without the final 0.
template <std::size_t kSize>
constexpr std::array<std::uint8_t, kSize - 1> bytesOf(const char (&text)[kSize]) {
  std::array<std::uint8_t, kSize - 1> bytes = {};
  for (std::size_t i = 0; i + 1 < kSize; ++i) bytes[i] = static_cast<std::uint8_t>(text[i]);
  return bytes;
}

template <typename... Bytes>
constexpr std::array<std::uint8_t, sizeof...(Bytes)> bytes(Bytes... values) {
  return {static_cast<std::uint8_t>(values)...};
}

void append(FixedVector<std::uint8_t, 40>& to, std::span<const std::uint8_t> from) {
  for (const std::uint8_t byte : from) static_cast<void>(to.tryPushBack(byte));
}

/// Integer divisor of `base` that comes nearest to `rate`.
std::uint16_t divisorOf(double base, double rate) {
  constexpr double kMost = 65'535;
  return static_cast<std::uint16_t>(std::clamp(std::round(base / rate), 1.0, kMost));
}

constexpr double kVnBaseRate = 800;
constexpr auto kVnReply = bytesOf("$VNWRG,75");
constexpr auto kVnRefusal = bytesOf("$VNERR");

/// Register 75 (binary output 1) on both ports, group Common, TimeStartup and Imu.
ConfigurationStep vectorNavStep(double rate) {
  ConfigurationStep step;
  step.reply = kVnReply;
  step.refusal = kVnRefusal;
  step.answer_length = kVnReply.size();
  step.what = "set binary output 1";
  std::array<char, 40> line = {};
  const int length = std::snprintf(line.data(), line.size(), "$VNWRG,75,3,%u,01,0201",
                                   static_cast<unsigned>(divisorOf(kVnBaseRate, rate)));
  unsigned sum = 0;
  for (int i = 1; i < length; ++i) sum ^= static_cast<std::uint8_t>(line.at(static_cast<std::size_t>(i)));
  const std::size_t used = static_cast<std::size_t>(length);
  std::snprintf(line.data() + used, line.size() - used, "*%02X\r\n", sum);
  for (std::size_t i = 0; line.at(i) != 0; ++i)
    static_cast<void>(step.bytes.tryPushBack(static_cast<std::uint8_t>(line.at(i))));
  return step;
}

constexpr std::size_t kXsOutput = 1;
constexpr std::uint16_t kXsAcceleration = 0x4020;
constexpr std::uint16_t kXsRateOfTurn = 0x8020;
constexpr std::uint16_t kXsEachMessage = 0xFFFF;
constexpr auto kXsConfig = bytes(0xFA, 0xFF, 0x30, 0x00, 0xD1);
constexpr auto kXsConfigReply = bytes(0xFA, 0xFF, 0x31);
constexpr auto kXsOutputReply = bytes(0xFA, 0xFF, 0xC1);
constexpr auto kXsMeasure = bytes(0xFA, 0xFF, 0x10, 0x00, 0xF1);
constexpr auto kXsMeasureReply = bytes(0xFA, 0xFF, 0x11);
constexpr auto kXsRefusal = bytes(0xFA, 0xFF, 0x42);
/// Preamble, bus, message, length, four items of identifier and rate, checksum.
constexpr std::size_t kXsOutputLength = 4 + 16 + 1;

ConfigurationStep xsensStep(std::size_t index, double rate) {
  ConfigurationStep step;
  step.refusal = kXsRefusal;
  if (index != kXsOutput) {
    const bool first = index == 0;
    append(step.bytes, first ? kXsConfig : kXsMeasure);
    step.reply = first ? kXsConfigReply : kXsMeasureReply;
    step.answer_length = step.reply.size();
    step.what = first ? "stop measuring" : "measure";
    return step;
  }
  std::array<std::uint8_t, kXsOutputLength> message = {};
  BigFieldWriter writer(message);
  writer.copy(bytes(0xFA, 0xFF, 0xC0, 0x10));
  const auto hertz = static_cast<std::uint16_t>(std::clamp(std::round(rate), 1.0, 2000.0));
  // PacketCounter and SampleTimeFine in every message.
  for (const std::uint16_t value : {std::uint16_t{0x1020}, kXsEachMessage, std::uint16_t{0x1060},
                                    kXsEachMessage, kXsAcceleration, hertz, kXsRateOfTurn, hertz}) {
    writer.u16(value);
  }
  std::uint8_t sum = 0;
  for (std::size_t i = 1; i + 1 < message.size(); ++i) sum = static_cast<std::uint8_t>(sum + message.at(i));
  message.back() = static_cast<std::uint8_t>(-sum);
  append(step.bytes, message);
  step.reply = kXsOutputReply;
  step.answer_length = kXsOutputLength;
  step.what = "set counter, fine time, acceleration and rate of turn";
  return step;
}

// Each command is answered by a field F1: the command and a result, 0 for accepted.
constexpr std::uint8_t kMipBase = 0x01;  // descriptor sets of commands
constexpr std::uint8_t kMipThreeDm = 0x0C;
constexpr std::uint8_t kMipSensorData = 0x80;
struct MipCommand {
  std::uint8_t set;
  std::uint8_t command;
  std::array<std::uint8_t, 4> reply;
  std::array<std::uint8_t, 3> refusal;
  const char* what;
};
constexpr MipCommand mipCommand(std::uint8_t set, std::uint8_t command, const char* what) {
  return {set, command, {0x04, 0xF1, command, 0x00}, {0x04, 0xF1, command}, what};
}
constexpr std::size_t kMipAskBase = 1, kMipFormat = 2, kMipStream = 3;
constexpr std::array<MipCommand, 5> kMip = {
    {mipCommand(kMipBase, 0x02, "idle"), mipCommand(kMipThreeDm, 0x0E, "tell the base rate"),
     mipCommand(kMipThreeDm, 0x0F, "set reference time, acceleration and rate"),
     mipCommand(kMipThreeDm, 0x11, "stream on"), mipCommand(kMipBase, 0x06, "resume")}};
/// The acknowledgement, then length, 8E, descriptor set and rate.
constexpr std::size_t kMipBaseAnswer = 4 + 5;

ConfigurationStep mipStep(std::size_t index, std::uint16_t decimation) {
  const MipCommand& command = kMip.at(index);
  const auto high = static_cast<std::uint8_t>(decimation >> 8U), low = static_cast<std::uint8_t>(decimation);
  FixedVector<std::uint8_t, 16> data;
  const auto add = [&data](std::initializer_list<int> values) {
    for (const int value : values) static_cast<void>(data.tryPushBack(static_cast<std::uint8_t>(value)));
  };
  constexpr int kApply = 1, kOn = 1;
  if (index == kMipAskBase) add({kMipSensorData});
  if (index == kMipFormat)
    add({kApply, kMipSensorData, 3, 0xD5, high, low, 0x04, high, low, 0x05, high, low});
  if (index == kMipStream) add({kApply, kMipSensorData, kOn});
  ConfigurationStep step;
  std::array<std::uint8_t, 40> packet = {};
  MipWriter writer(packet, command.set);
  writer.field(command.command, std::span<const std::uint8_t>(data.data(), data.size()));
  append(step.bytes, std::span(packet).first(writer.finish()));
  step.reply = command.reply;
  // An acknowledgement with another result than 0; searched after the reply.
  step.refusal = command.refusal;
  step.answer_length = index == kMipAskBase ? kMipBaseAnswer : step.reply.size();
  step.what = command.what;
  return step;
}

}  // namespace

std::size_t ImuConfiguration::steps() const {
  switch (protocol_) {
    case ImuProtocol::kVectorNav:
      return 1;
    case ImuProtocol::kXsens:
      return 3;
    case ImuProtocol::kMip:
      return kMip.size();
    case ImuProtocol::kMavlink:
    case ImuProtocol::kBridge:
      return 0;
  }
  return 0;
}

ConfigurationStep ImuConfiguration::step(std::size_t index) const {
  if (protocol_ == ImuProtocol::kVectorNav) return vectorNavStep(rate_);
  if (protocol_ == ImuProtocol::kXsens) return xsensStep(index, rate_);
  return mipStep(index, base_rate_ > 0 ? divisorOf(base_rate_, rate_) : std::uint16_t{1});
}

void ImuConfiguration::answered(std::size_t index, std::span<const std::uint8_t> answer) {
  if (protocol_ == ImuProtocol::kVectorNav) {
    set_ = kVnBaseRate / divisorOf(kVnBaseRate, rate_);
  } else if (protocol_ == ImuProtocol::kXsens && index == kXsOutput) {
    answeredByXsens(answer);
  } else if (protocol_ == ImuProtocol::kMip && index == kMipAskBase) {
    base_rate_ = BigFieldReader(answer.last(2)).u16();
    if (base_rate_ > 0) set_ = base_rate_ / divisorOf(base_rate_, rate_);
  }
}

/// The sensor returns the rates that it has set.
void ImuConfiguration::answeredByXsens(std::span<const std::uint8_t> answer) {
  constexpr std::size_t kHead = 4, kItems = 4;
  BigFieldReader items(answer.subspan(kHead));
  for (std::size_t i = 0; i < kItems; ++i) {
    const std::uint16_t identifier = items.u16(), hertz = items.u16();
    if (identifier == kXsAcceleration) set_ = hertz;
  }
}

}  // namespace swiftlet
