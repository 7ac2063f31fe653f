#pragma once
// A camera behind a ROS 2 topic: sensor_msgs/Image, or CompressedImage if the topic's name ends with
// "/compressed". Its images are lent from the reader's memory without a copy.
//
// Encodings: those of drivers/image/ros_encoding.hpp, grey used unchanged; JPEG and PNG. The size must be the
// requested one. Stamps: from the header, CLOCK_REALTIME, converted to CLOCK_MONOTONIC
// (drivers/timesync/wall_stamps.hpp). Messages do not say which event they stamp: the start of the exposure
// is assumed. Losses: gaps of the stamps of up to a second at the requested rate, losses reported by DDS, and
// images overwritten because they were not taken in time; the first count includes the others. Skipped and
// counted: damaged messages (unknown encoding, step or data too short, another size: `damaged` and
// `too_short`), messages with another clock (`wrong_clock`), and messages not newer than the previous one
// (`stale`). Errors: values. After kMostBad consecutive messages that are damaged or of another clock the
// camera closes with the reason. open() waits for an image: seconds in the first call, a tenth of a second in
// flight. Threads: one. It allocates and locks: not for a thread of the flight path. Memory: that of
// TopicReader, of which one image is lent at a time.

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/dds/topic_reader.hpp"
#include "drivers/image/camera_source.hpp"
#include "drivers/timesync/wall_stamps.hpp"

namespace swiftlet {

struct TopicCameraSettings {
  DdsNetwork network;
  std::string topic;
  int width = 0;  ///< pixels; if two cameras share an image, of both halves
  int height = 0;
  double rate = 0;                   ///< images per second
  std::optional<Duration> exposure;  ///< as set in the driver; empty: unknown
  /// Wait for the first image. Discovery takes some tenths of a second, the start of a driver longer.
  Duration patience = Duration::fromMilliseconds(3000);
  std::function<HostClocks()> read_clocks = readHostClocks;  ///< replaced in tests
};

/// View of a message's image without a copy, or why it is refused. Does not check the size inside a
/// compressed image.
[[nodiscard]] DeviceFault rawImageOf(const TopicImage& message, int width, int height, RawImage& image);

class TopicCamera : public CameraSource {
 public:
  static constexpr int kMostBad = 5;

  explicit TopicCamera(TopicCameraSettings settings);

  DeviceFault open() override;
  void close() override;
  /// The stream belongs to the publisher, so restarting it here has no effect.
  [[nodiscard]] bool restarts() const override { return false; }
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] int fd() const override { return bell_.fd(); }
  DeviceFault next(CapturedFrame& frame) override;
  [[nodiscard]] bool allocates() const override { return true; }
  bool nextRemark(DeviceFault& remark) override;

 private:
  void giveBack(std::uint32_t /*buffer*/) override { lent_ = false; }
  DeviceFault prepare();
  DeviceFault waitForImage(Duration patience);
  /// The next message in order with a usable stamp; false: none. `fault`: why its image is not usable, if so.
  bool takeMessage(RawImage& image, Stamp& stamp, Stamp& arrival, DeviceFault& fault);
  /// Checks the size in the header of the first compressed image.
  [[nodiscard]] DeviceFault checkPicture(const RawImage& image) const;

  TopicCameraSettings settings_;
  TopicType type_;
  std::shared_ptr<DdsDomain> domain_;
  TopicBell bell_;
  TopicReader reader_;
  WallStamps stamps_;
  std::optional<DeviceFault> remark_;
  std::optional<Stamp> newest_;
  std::uint64_t sequence_ = 0;
  int bad_ = 0;  ///< consecutive unusable messages
  bool open_ = false;
  bool opened_ = false;  // at least once
  bool lent_ = false;
};

}  // namespace swiftlet
