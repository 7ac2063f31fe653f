#include "drivers/serial/imu_configuration.hpp"

#include <array>

namespace swiftlet {
namespace {

/// A literal's characters without the 0 that ends it.
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

// Register 75 (binary output 1), port 2, 800 Hz / 2, group Common, TimeStartup and Imu.
constexpr auto kVnOutput = bytesOf("$VNWRG,75,2,2,01,0201*76\r\n");
constexpr auto kVnReply = bytesOf("$VNWRG,75");
constexpr auto kVnRefusal = bytesOf("$VNERR");
constexpr std::array<ConfigurationStep, 1> kVectorNav = {
    {{kVnOutput, kVnReply, kVnRefusal, "binary output 1 on port 2: TimeStartup and Imu at 400 Hz"}}};

constexpr auto kXsConfig = bytes(0xFA, 0xFF, 0x30, 0x00, 0xD1);
constexpr auto kXsConfigReply = bytes(0xFA, 0xFF, 0x31);
// Identifier and rate of each item; 0xFFFF: with every message. 0x0190: 400 Hz.
constexpr auto kXsOutput = bytes(0xFA, 0xFF, 0xC0, 0x10, 0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF, 0xFF, 0x40,
                                 0x20, 0x01, 0x90, 0x80, 0x20, 0x01, 0x90, 0x73);
constexpr auto kXsOutputReply = bytes(0xFA, 0xFF, 0xC1);
constexpr auto kXsMeasure = bytes(0xFA, 0xFF, 0x10, 0x00, 0xF1);
constexpr auto kXsMeasureReply = bytes(0xFA, 0xFF, 0x11);
constexpr auto kXsRefusal = bytes(0xFA, 0xFF, 0x42);
constexpr std::array<ConfigurationStep, 3> kXsens = {
    {{kXsConfig, kXsConfigReply, kXsRefusal, "stop measuring"},
     {kXsOutput, kXsOutputReply, kXsRefusal,
      "counter and fine time with every message, acceleration and rate of turn at 400 Hz"},
     {kXsMeasure, kXsMeasureReply, kXsRefusal, "measure"}}};

// Each is answered by a field F1: the command and 0 for accepted.
constexpr auto kMipIdle = bytes(0x75, 0x65, 0x01, 0x02, 0x02, 0x02, 0xE1, 0xC7);
constexpr auto kMipIdleReply = bytes(0x04, 0xF1, 0x02, 0x00);
constexpr auto kMipFormat = bytes(0x75, 0x65, 0x0C, 0x0E, 0x0E, 0x0F, 0x01, 0x80, 0x03, 0xD5, 0x00, 0x01,
                                  0x04, 0x00, 0x01, 0x05, 0x00, 0x01, 0x76, 0x62);
constexpr auto kMipFormatReply = bytes(0x04, 0xF1, 0x0F, 0x00);
constexpr auto kMipStream = bytes(0x75, 0x65, 0x0C, 0x05, 0x05, 0x11, 0x01, 0x80, 0x01, 0x83, 0x18);
constexpr auto kMipStreamReply = bytes(0x04, 0xF1, 0x11, 0x00);
constexpr auto kMipResume = bytes(0x75, 0x65, 0x01, 0x02, 0x02, 0x06, 0xE5, 0xCB);
constexpr auto kMipResumeReply = bytes(0x04, 0xF1, 0x06, 0x00);
constexpr std::array<ConfigurationStep, 4> kMip = {
    {{kMipIdle, kMipIdleReply, {}, "idle"},
     {kMipFormat, kMipFormatReply, {}, "reference time, acceleration and rate at the sensor's base rate"},
     {kMipStream, kMipStreamReply, {}, "stream on"},
     {kMipResume, kMipResumeReply, {}, "resume"}}};

// COMMAND_LONG from 1/191 to 1/1: SET_MESSAGE_INTERVAL of message 105 to 4000 us. Other addresses and rates:
// mavlink::write(CommandLong).
constexpr auto kMavlinkInterval =
    bytes(0xFD, 0x20, 0, 0, 0, 0x01, 0xBF, 0x4C, 0, 0, 0, 0, 0xD2, 0x42, 0, 0, 0x7A, 0x45, 0, 0, 0, 0, 0, 0,
          0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0x01, 0x01, 0x01, 0x2E, 0x33);
constexpr std::array<ConfigurationStep, 1> kMavlink = {
    {{kMavlinkInterval, {}, {}, "HIGHRES_IMU every 4 ms"}}};

}  // namespace

std::span<const ConfigurationStep> configurationSteps(ImuProtocol protocol) {
  switch (protocol) {
    case ImuProtocol::kVectorNav:
      return kVectorNav;
    case ImuProtocol::kXsens:
      return kXsens;
    case ImuProtocol::kMip:
      return kMip;
    case ImuProtocol::kMavlink:
      return kMavlink;
    case ImuProtocol::kBridge:
      return {};
  }
  return {};
}

}  // namespace swiftlet
