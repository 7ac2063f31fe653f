#pragma once
// A camera behind a V4L2 capture node: negotiated, streaming into the kernel's buffers, which are lent one by
// one and return when they are released. No copy here: GreyReader makes the only one.
//
// Memory: the kernel's buffers (`buffers` images), mapped at open; no allocation. Cost per frame: two calls.
// Source: linux/videodev2.h; the kernel's Documentation/userspace-api/media/v4l.

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
  /// With other settings than before.
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
  /// The first requested or supported format that comes with the requested size and rate.
  DeviceFault chooseFormat();
  DeviceFault setFormat(const PixelFormat& format, const NodeFormat& before);
  DeviceFault setRate();
  DeviceFault setBuffers();
  void describeDevice();
  /// The video node's own exposure, or that of the sensor before it.
  void findControls();
  void countSequence(std::uint32_t sequence);
  DeviceFault closedBy(const DeviceFault& fault);

  VideoNode node_;
  SensorNode sensor_;  ///< open where the exposure is its
  CameraControls controls_;
  CameraDeviceSettings settings_;
  bool opened_ = false;          // ever
  bool first_data_ = false;      // stampsFirstData()
  bool sequence_known_ = false;  // of this stream
  std::uint32_t raw_sequence_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace swiftlet
