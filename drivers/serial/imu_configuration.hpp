#pragma once
// Configures a sensor to send the messages that ImuDecoder reads at a rate, step by step: each step follows
// the reply to the previous one. For VectorNav, Xsens and MIP; a bridge needs none, and ImuStreamRequest
// (drivers/mavlink) configures an autopilot.
//
// Rates: VectorNav divides 800 Hz, MIP its base rate, which is queried; Xsens accepts a rate or returns
// another one. The nearest rate is set; rate() returns it. After a refusal or a missing reply the last step
// must still be sent, because it makes the sensor send again. Memory: fixed. Threads: one. Source: the
// manuals named in each protocol's header; docs/serial.md.

#include <array>
#include <cstdint>
#include <span>

#include "drivers/serial/imu_decoder.hpp"
#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {

struct ConfigurationStep {
  FixedVector<std::uint8_t, 40> bytes;
  std::span<const std::uint8_t> reply;    ///< first bytes of the answer if the step was accepted
  std::span<const std::uint8_t> refusal;  ///< first bytes of the answer if it was refused; may be empty
  std::size_t answer_length = 0;          ///< bytes needed by answered(), from the reply's first byte
  const char* what = "";                  ///< description for messages
};

class ImuConfiguration {
 public:
  /// `rate`: readings per second [Hz], above 0.
  ImuConfiguration(ImuProtocol protocol, double rate) : protocol_(protocol), rate_(rate), set_(rate) {}

  [[nodiscard]] std::size_t steps() const;
  /// Step `index`, which can depend on earlier answers.
  [[nodiscard]] ConfigurationStep step(std::size_t index) const;
  /// Takes the answer to a step, `answer_length` bytes.
  void answered(std::size_t index, std::span<const std::uint8_t> answer);
  /// Rate that the sensor will send [Hz], as far as known.
  [[nodiscard]] double rate() const { return set_; }

 private:
  void answeredByXsens(std::span<const std::uint8_t> answer);

  ImuProtocol protocol_;
  double rate_;
  double set_;
  double base_rate_ = 0;  ///< [Hz] of a MIP sensor
};

}  // namespace swiftlet
