#pragma once
// A camera behind a V4L2 capture node: negotiates the format and streams into kernel buffers, which are lent
// one by one and returned on release. Nothing is copied here; GreyReader makes the only copy.
//
// Memory: the kernel's buffers (`buffers` images), mapped in open(); no allocation. Cost per frame: two
// system calls. Source: linux/videodev2.h; the kernel's Documentation/userspace-api/media/v4l.

#include <cstdint>
#include <optional>

#include "drivers/image/camera_source.hpp"
#include "drivers/v4l2/camera_controls.hpp"
#include "drivers/v4l2/camera_settings.hpp"
#include "drivers/v4l2/sensor_node.hpp"
#include "drivers/v4l2/video_node.hpp"

namespace swiftlet {

class CameraDevice : public CameraSource {
 public:
  CameraDevice() = default;
  explicit CameraDevice(const CameraDeviceSettings& settings) : settings_(settings) {}
  ~CameraDevice() override { shut(); }

  DeviceFault open() override;
  /// Opens with other settings.
  DeviceFault open(const CameraDeviceSettings& settings) {
    settings_ = settings;
    return open();
  }
  void close() override { shut(); }

  [[nodiscard]] bool isOpen() const override { return node_.isOpen(); }
  [[nodiscard]] int fd() const override { return node_.fd(); }

  DeviceFault next(CapturedFrame& frame) override;

  [[nodiscard]] std::optional<ExposureAbility> exposureAbility() const override {
    return isOpen() ? controls_.ability() : std::nullopt;
  }
  DeviceFault setExposure(const ExposureSetting& setting) override;

 private:
  void giveBack(std::uint32_t buffer) override;
  void shut();
  DeviceFault negotiate();
  /// Chooses the first requested or supported format that is available with the requested size and rate.
  DeviceFault chooseFormat();
  DeviceFault setFormat(const PixelFormat& format, const NodeFormat& before);
  DeviceFault setRate();
  DeviceFault setBuffers();
  void describeDevice();
  /// Finds the exposure controls of the video node or, if it has none, of its sensor.
  void findControls();
  void countSequence(std::uint32_t sequence);
  DeviceFault closedBy(const DeviceFault& fault);

  VideoNode node_;
  SensorSubdevice sensor_;  ///< open if it has the exposure controls
  CameraControls controls_;
  CameraDeviceSettings settings_;
  bool opened_ = false;          // at least once
  bool first_data_ = false;      // result of stampsFirstData()
  bool sequence_known_ = false;  // in this stream
  std::uint32_t raw_sequence_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace swiftlet
