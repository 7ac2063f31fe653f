#pragma once
// The bytes that ask a sensor for the output that ImuDecoder reads. To be sent when the user asks for it,
// never at start by itself; nothing here is kept by the sensor when its power goes.
//
// Steps are sent in order, each after the reply of the one before. The rates stand in the bytes: VectorNav
// and Xsens 400 Hz, MIP the sensor's base rate, MAVLink 250 Hz.
// Source: the manuals named by each protocol's header; docs/serial.md explains the bytes.

#include <cstdint>
#include <span>

#include "drivers/serial/imu_decoder.hpp"

namespace swiftlet {

struct ConfigurationStep {
  std::span<const std::uint8_t> bytes;
  std::span<const std::uint8_t> reply;    ///< bytes that stand in the answer when it was taken; may be empty
  std::span<const std::uint8_t> refusal;  ///< bytes that stand in the answer when it was not; may be empty
  const char* what;                       ///< for the log
};

/// Empty for bridges: they send by themselves.
std::span<const ConfigurationStep> configurationSteps(ImuProtocol protocol);

}  // namespace swiftlet
