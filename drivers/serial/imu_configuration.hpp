#pragma once
// Configures a sensor to send what ImuDecoder reads, at a rate: step by step, each after the reply to the
// previous one. VectorNav, Xsens, MIP; a bridge needs none, and ImuStreamRequest (drivers/mavlink) configures
// an autopilot.
//
// Rates: VectorNav divides 800 Hz, MIP its base rate, which is queried; Xsens accepts a rate or returns
// another. The nearest is set, and rate() returns it. After a refusal or without a reply the last step must
// still be sent: it lets the sensor send again. Memory: fixed. Threads: one. Source: the manuals named in
// each protocol's header; docs/serial.md.

#include <array>
#include <cstdint>
#include <span>

#include "drivers/serial/imu_decoder.hpp"
#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {

struct ConfigurationStep {
  FixedVector<std::uint8_t, 40> bytes;
  std::span<const std::uint8_t> reply;    ///< first bytes of its answer if it was accepted
  std::span<const std::uint8_t> refusal;  ///< the same when it was not; may be empty
  std::size_t answer_length = 0;          ///< bytes that answered() needs, from the reply's first on
  const char* what = "";                  ///< in words
};

class ImuConfiguration {
 public:
  /// `rate`: readings a second [Hz], above 0.
  ImuConfiguration(ImuProtocol protocol, double rate) : protocol_(protocol), rate_(rate), set_(rate) {}

  [[nodiscard]] std::size_t steps() const;
  /// The step `index`, which may depend on the answers before.
  [[nodiscard]] ConfigurationStep step(std::size_t index) const;
  /// The answer to it, `answer_length` bytes.
  void answered(std::size_t index, std::span<const std::uint8_t> answer);
  /// What the sensor sends then [Hz], as far as it is known.
  [[nodiscard]] double rate() const { return set_; }

 private:
  void answeredByXsens(std::span<const std::uint8_t> answer);

  ImuProtocol protocol_;
  double rate_;
  double set_;
  double base_rate_ = 0;  ///< of a MIP sensor [Hz]
};

}  // namespace swiftlet
