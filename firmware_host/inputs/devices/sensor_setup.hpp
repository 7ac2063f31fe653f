#pragma once
// A sensor on a serial port brought to the rate that its calibration says, when its port is opened.
//
// A sensor that already sends at that rate is left as its owner set it. Else it is asked, a step and its
// reply at a time, which takes 2.5 s at most; what it refuses or makes otherwise is a warning. It keeps
// nothing of it without power, so it is asked again each time that the port is opened, without listening
// first. Threads: one. Memory: 4 kB inside the object, nothing allocated.

#include <array>
#include <optional>
#include <string>

#include "drivers/serial/imu_configuration.hpp"
#include "drivers/serial/imu_decoder.hpp"
#include "firmware_host/interfaces/link_port.hpp"

namespace swiftlet {

class SensorSetup {
 public:
  /// `rate`: readings a second [Hz]; 0: nothing is asked.
  explicit SensorSetup(double rate) : rate_(rate) {}

  /// With the port open; `decoder` is started anew afterwards.
  void run(LinkPort& port, ImuDecoder& decoder);
  /// Until it says false.
  bool nextWarning(DeviceFault& warning);
  /// What was found and asked, in words; empty: nothing was.
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] double listen(LinkPort& port, ImuDecoder& decoder);
  /// False: refused, or no reply in time.
  bool ask(LinkPort& port, const ConfigurationStep& step);

  double rate_;
  bool asks_ = false;  ///< it had to be asked the first time
  bool listened_ = false;
  double found_ = 0;           ///< Hz
  std::optional<double> set_;  ///< Hz
  std::optional<DeviceFault> warning_;
  std::array<std::uint8_t, 4096> heard_;
  std::size_t count_ = 0;  ///< of heard_
  std::size_t reply_ = 0;  ///< where it begins
};

}  // namespace swiftlet
