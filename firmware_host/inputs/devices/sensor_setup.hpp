#pragma once
// Sets a sensor on a serial port to the rate in its calibration when its port is opened.
//
// A sensor that already sends at that rate is not changed. Otherwise it is configured step by step, each step
// confirmed by its reply, in at most 2.5 s; a refused or changed step gives a warning. The sensor does not
// store the configuration and may have lost power, so its rate is checked each time the port is opened. A
// sensor that was configured before is configured again without checking first, which saves half a second.
// Threads: one. Memory: 4 kB inside the object, no allocation.

#include <array>
#include <optional>
#include <string>

#include "drivers/serial/imu_configuration.hpp"
#include "drivers/serial/imu_decoder.hpp"
#include "firmware_host/interfaces/link_port.hpp"

namespace swiftlet {

class SensorSetup {
 public:
  /// `rate`: sample rate [Hz]; 0: not configured.
  explicit SensorSetup(double rate) : rate_(rate) {}

  /// Call with the port open; `decoder` is restarted afterwards.
  void run(LinkPort& port, ImuDecoder& decoder);
  /// Call until it returns false.
  bool nextWarning(DeviceFault& warning);
  /// Describes what was found and requested; empty: nothing was.
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] double listen(LinkPort& port, ImuDecoder& decoder);
  /// False: refused, or no reply in time.
  bool ask(LinkPort& port, const ConfigurationStep& step);

  double rate_;
  bool asks_ = false;  ///< it sent at another rate when checked
  bool listened_ = false;
  double found_ = 0;           ///< Hz
  std::optional<double> set_;  ///< Hz
  std::optional<DeviceFault> warning_;
  std::array<std::uint8_t, 4096> heard_;
  std::size_t count_ = 0;  ///< bytes in heard_
  std::size_t reply_ = 0;  ///< position of the reply in heard_
};

}  // namespace swiftlet
