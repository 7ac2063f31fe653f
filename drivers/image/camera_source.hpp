#pragma once
// A camera of any kind: frames lent one by one with their stamps, and counters.
//
// Threads: one. Nothing blocks: poll fd() for POLLIN, then call next() until it gives no frame. Errors:
// values. A fault of next() closes the camera; open() reopens it, with all negotiation, once it is back.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "drivers/device/device_fault.hpp"
#include "drivers/image/raw_image.hpp"
#include "estimator/camera/exposure_control.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Which instant a source's stamp marks.
enum class StampEvent : std::uint8_t {
  kStartOfExposure,
  kEndOfExposure,  ///< of the first row, when its readout begins
  kEndOfFrame,
  kArrival,  ///< the capture time is unknown: when the frame arrived at the host
};

/// Exposure that can be set in flight: range and current setting.
struct ExposureAbility {
  ExposureRange range;
  ExposureSetting now;
};

/// Properties of the open camera, as negotiated and read back.
struct CameraFacts {
  std::array<char, 17> driver = {};
  std::array<char, 33> card = {};
  std::array<char, 33> bus = {};
  PixelFormat format = kGrey8;
  int width = 0;
  int height = 0;
  int stride = 0;                    ///< bytes
  double rate = 0;                   ///< frames per second; 0: unknown
  std::optional<Duration> exposure;  ///< empty: not known in units of time
  std::optional<std::int32_t> gain;
  StampEvent event = StampEvent::kEndOfFrame;
  std::size_t buffers = 0;
};

/// Since construction; unplugging does not reset them.
struct CameraCounters {
  std::uint64_t frames = 0;       ///< delivered
  std::uint64_t missed = 0;       ///< gaps in `sequence`: no buffer was free, or the driver dropped the frame
  std::uint64_t damaged = 0;      ///< flagged by the driver and not delivered, or not decodable
  std::uint64_t too_short = 0;    ///< fewer bytes than the size requires; returned without being delivered
  std::uint64_t stamp_ahead = 0;  ///< stamps later than their arrival
  std::uint64_t requeue_failed = 0;  ///< buffers that could not be returned to the driver
  std::uint64_t reopened = 0;
  // Topics only.
  std::uint64_t stale = 0;        ///< not newer than the previous one: late or repeated; skipped
  std::uint64_t wrong_clock = 0;  ///< stamped by another clock than this computer's; skipped
  std::uint64_t lost = 0;         ///< lost in transport, as far as DDS knows; included in `missed`
  std::uint64_t overrun = 0;      ///< not taken in time; included in `missed`
};

class CameraSource;

/// A frame in the source's memory, returned when this object is destroyed. It must not outlive the source,
/// and after close() `image` is invalid.
class CapturedFrame {
 public:
  CapturedFrame() = default;
  CapturedFrame(CapturedFrame&& other) noexcept { *this = std::move(other); }
  CapturedFrame& operator=(CapturedFrame&& other) noexcept;
  ~CapturedFrame() { release(); }

  [[nodiscard]] bool valid() const { return source_ != nullptr; }
  void release();

  RawImage image;
  Stamp stamp;                                 ///< from the source, CLOCK_MONOTONIC
  StampEvent event = StampEvent::kEndOfFrame;  ///< the event that `stamp` marks
  Stamp arrival;                               ///< CLOCK_MONOTONIC, when it was taken from the source
  std::uint64_t sequence = 0;                  ///< the source's count, unwrapped; continues after a reopen

 private:
  friend class CameraSource;
  CameraSource* source_ = nullptr;
  std::uint32_t buffer_ = 0;
  std::uint32_t generation_ = 0;
};

class CameraSource {
 public:
  static constexpr std::size_t kMostWarnings = 4;  // exposure, gain, buffers, stamps

  CameraSource() = default;
  CameraSource(const CameraSource&) = delete;
  CameraSource& operator=(const CameraSource&) = delete;
  virtual ~CameraSource() = default;

  /// Negotiates and starts. Ok: streaming; warnings() lists deviations that do not prevent flying (a clamped
  /// exposure). kMissing while the camera is absent; call again a few times a second.
  virtual DeviceFault open() = 0;
  virtual void close() = 0;
  [[nodiscard]] virtual bool isOpen() const = 0;
  [[nodiscard]] virtual int fd() const = 0;
  /// True: taking or returning frames allocates and locks, which a thread of the flight path must not do.
  [[nodiscard]] virtual bool allocates() const { return false; }

  /// False: closing and reopening a silent stream cannot help.
  [[nodiscard]] virtual bool restarts() const { return true; }

  /// Remarks about the camera that are not faults, for the user; call until it returns false.
  virtual bool nextRemark(DeviceFault& /*remark*/) { return false; }

  /// The oldest waiting frame. Ok with `frame.valid()` false: none.
  virtual DeviceFault next(CapturedFrame& frame) = 0;

  /// Call for an open source; empty: its exposure cannot be set in flight.
  [[nodiscard]] virtual std::optional<ExposureAbility> exposureAbility() const { return {}; }
  /// Sets the exposure of later images, rounded to what the camera supports; the first call disables
  /// automatic control. Waits for the camera's bus, up to some ms.
  virtual DeviceFault setExposure(const ExposureSetting& setting);

  [[nodiscard]] const CameraFacts& facts() const { return facts_; }
  [[nodiscard]] const CameraCounters& counters() const { return counters_; }
  [[nodiscard]] std::span<const DeviceFault> warnings() const { return {warnings_.data(), warning_count_}; }

 protected:
  friend class CapturedFrame;

  /// Makes `frame` a frame of this source; `buffer` is the number for giveBack().
  void lend(CapturedFrame& frame, std::uint32_t buffer);
  /// Takes back the buffer of a released frame.
  virtual void giveBack(std::uint32_t buffer) = 0;
  /// Call in every close(): frames lent before are then no longer returned.
  void forgetLent() { ++generation_; }
  void warn(const DeviceFault& fault);

  CameraFacts facts_;
  CameraCounters counters_;
  std::array<DeviceFault, kMostWarnings> warnings_;
  std::size_t warning_count_ = 0;

 private:
  std::uint32_t generation_ = 0;
};

}  // namespace swiftlet
