#pragma once
// A camera behind a ROS 2 topic: sensor_msgs/Image, or CompressedImage where the topic's name ends with
// "/compressed". Its images are lent out as they lie in the reader's memory.
//
// Encodings: those of drivers/image/ros_encoding.hpp, whose grey is taken as it is; JPEG and PNG. The size
// must be the one asked for. Stamps: the header's, CLOCK_REALTIME, on CLOCK_MONOTONIC
// (drivers/timesync/wall_stamps.hpp). What moment they mark no message says: it is taken for the start of the
// exposure. Losses: holes of the stamps up to a second, at the rate asked for, what DDS knows to be lost, and
// what was overrun because it was not taken in time; the first contains the others. Left out and counted:
// messages that are damaged (unknown encoding, step or data too short, another size, `damaged` and
// `too_short`), of another clock (`wrong_clock`), and not newer than the one before (`stale`). Errors:
// values. After kMostBad messages running that are damaged or of another clock the camera closes with what is
// wrong. open() waits for an image: first for seconds, in flight for a tenth of one. Threads: one. It
// allocates and locks: not for a thread of the flight path. Memory: TopicReader's, of which one image is lent
// out at a time.

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
  int width = 0;  ///< pixels, of both halves where two cameras share an image
  int height = 0;
  double rate = 0;                   ///< images a second
  std::optional<Duration> exposure;  ///< that the driver sets; empty: not known
  /// For the first image. Discovery takes some tenths of a second, a driver's start longer.
  Duration patience = Duration::fromMilliseconds(3000);
  std::function<HostClocks()> read_clocks = readHostClocks;  ///< another one in tests
};

/// What a message shows, without a copy; or why it is refused. A picture's own size is not looked at.
[[nodiscard]] DeviceFault rawImageOf(const TopicImage& message, int width, int height, RawImage& image);

class TopicCamera : public CameraSource {
 public:
  static constexpr int kMostBad = 5;

  explicit TopicCamera(TopicCameraSettings settings);

  DeviceFault open() override;
  void close() override;
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] int fd() const override { return bell_.fd(); }
  DeviceFault next(CapturedFrame& frame) override;
  [[nodiscard]] bool allocates() const override { return true; }
  bool nextRemark(DeviceFault& remark) override;

 private:
  void giveBack(std::uint32_t /*buffer*/) override { lent_ = false; }
  DeviceFault prepare();
  DeviceFault waitForImage(Duration patience);
  /// The next message in order whose stamp can be used; false: none. `fault`: why its image cannot be.
  bool takeMessage(RawImage& image, Stamp& stamp, Stamp& arrival, DeviceFault& fault);
  /// Of the first picture: the size that its header says.
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
  int bad_ = 0;  ///< messages running
  bool open_ = false;
  bool opened_ = false;  // ever
  bool lent_ = false;
};

}  // namespace swiftlet
