#include "firmware_host/lab/hil/imu_wire.hpp"

#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "drivers/can/can_bus.hpp"
#include "drivers/can/raw_imu.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// A pseudo-terminal, with a link to it under the port's name.
class SerialWire : public ImuWire {
 public:
  explicit SerialWire(const ImuLinkGroup& settings)
      : link_(settings.device), encoder_(imuProtocol(settings.protocol).value_or(ImuProtocol::kBridge)) {}
  ~SerialWire() override { removeLink(); }

  DeviceFault open() override {
    std::error_code error;
    const bool taken = fs::exists(fs::symlink_status(link_, error)) && !fs::is_symlink(link_, error);
    if (taken) {
      return deviceFault(DeviceFaultKind::kBusy, 0,
                         "is the name of a real device: set another imu_link.device");
    }
    if (const DeviceFault fault = terminal_.open(); !fault.ok()) return fault;
    removeLink();
    fs::create_symlink(terminal_.path(), link_, error);
    if (error) return openFault(error.value(), "linking the port's name to a pseudo-terminal");
    probed_ = false;
    return {};
  }

  DeviceFault unplug() override {
    removeLink();
    terminal_.hangUp();
    return {};
  }

  bool isRead() override {
    // A reader discards what was queued before it opened the port.
    std::size_t taken = 0;
    constexpr std::array<std::uint8_t, 1> kProbe = {0};
    if (!probed_) static_cast<void>(terminal_.send(kProbe, taken));
    probed_ = true;
    return terminal_.unread() == 0;
  }

  DeviceFault send(const ImuReading& reading) override {
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame;
    const std::size_t length = encoder_.encode(reading, frame);
    // Bytes from the program, for example for an autopilot, are read and discarded.
    std::array<std::uint8_t, 256> heard;
    std::size_t count = 0;
    static_cast<void>(terminal_.receive(heard, count));
    return write(std::span(frame).first(length));
  }

  DeviceFault sendGarbage(std::uint64_t seed) override {
    Random random(seed);
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> noise;
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random.next());
    return write(noise);
  }

 private:
  DeviceFault write(std::span<const std::uint8_t> bytes) {
    // Bytes without a reader are lost, as on a real wire.
    std::size_t taken = 0;
    return terminal_.send(bytes, taken);
  }
  void removeLink() const {
    std::error_code error;
    if (fs::is_symlink(link_, error)) fs::remove(link_, error);
  }

  fs::path link_;
  PseudoTerminal terminal_;
  ImuEncoder encoder_;
  bool probed_ = false;
};

class CanWire : public ImuWire {
 public:
  explicit CanWire(const ImuLinkGroup& settings)
      : name_(settings.device),
        node_(static_cast<std::uint8_t>(settings.can_node > 0 ? settings.can_node : 42)) {
    settings_.setInterface(settings.device.c_str());
  }

  DeviceFault open() override {
    if (const DeviceFault fault = setUp(true); !fault.ok()) return fault;
    return bus_.isOpen() ? DeviceFault{} : bus_.open(settings_);
  }
  DeviceFault unplug() override {
    // A socket on an interface that goes down keeps the error until the next send.
    bus_.close();
    return setUp(false);
  }
  bool isRead() override { return true; }

  DeviceFault send(const ImuReading& reading) override {
    RawImu message;
    message.stamp_us = static_cast<std::uint64_t>(reading.device.value_or(reading.arrival).ns / 1000);
    message.interval = kInterval;
    message.rate = reading.gyro.cast<float>();
    message.force = reading.accel.cast<float>();
    message.rate_integral = message.rate * kInterval;
    message.force_integral = message.force * kInterval;
    std::array<std::uint8_t, kMaxRawImuBytes> payload;
    const std::size_t length = encodeRawImu(message, false, payload);
    DroneCanFrames frames;
    constexpr std::uint8_t kPriority = 16;
    if (!encodeTransfer(rawImuType(), kPriority, node_, transfer_++, false, std::span(payload).first(length),
                        frames)) {
      return deviceFault(DeviceFaultKind::kFailed, 0, "a reading that does not fit a transfer");
    }
    for (std::size_t i = 0; i < frames.count; ++i) {
      const DeviceFault fault = bus_.send(frames.frames[i]);
      if (!fault.ok()) return fault.kind == DeviceFaultKind::kBusy ? DeviceFault{} : fault;
    }
    return {};
  }

  DeviceFault sendGarbage(std::uint64_t /*seed*/) override { return {}; }

 private:
  DeviceFault setUp(bool up) const {
    if (const DeviceFault fault = settings_.nameFault(); !fault.ok()) return fault;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return openFault(errno, "a socket");
    ifreq request{};
    std::strncpy(request.ifr_name, name_.c_str(), IFNAMSIZ - 1);
    DeviceFault fault;
    if (ioctl(fd, SIOCGIFFLAGS, &request) != 0) fault = openFault(errno, "reading its flags");
    const bool is_up = (request.ifr_flags & IFF_UP) != 0;
    if (fault.ok() && is_up != up) {
      request.ifr_flags = static_cast<short>(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
      if (ioctl(fd, SIOCSIFFLAGS, &request) != 0)
        fault = openFault(errno, up ? "bringing it up" : "taking it down");
    }
    ::close(fd);
    return fault;
  }

  /// Interval stated in the message, s. Readers use the means, which do not depend on it.
  static constexpr float kInterval = 0.0025F;

  std::string name_;
  std::uint8_t node_;
  CanBusSettings settings_;
  CanBus bus_;
  unsigned transfer_ = 0;
};

}  // namespace

std::unique_ptr<ImuWire> makeImuWire(const ImuLinkGroup& settings) {
  if (settings.protocol == "dronecan") return std::make_unique<CanWire>(settings);
  return std::make_unique<SerialWire>(settings);
}

}  // namespace swiftlet
