#pragma once
// Base of live recordings: devices' threads put messages into fixed memory, low-priority writers take them
// from there. Messages without room are counted; nobody waits.
//
// Memory: kImagesAhead images per camera, kSamplesAhead samples.

#include <array>
#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"

namespace swiftlet {

class RecordSink : public SensorSink {
 public:
  struct Counters {
    std::uint64_t samples = 0;
    std::uint64_t samples_lost = 0;  ///< the disk was too slow
    std::array<std::uint64_t, kMaxCameras> images{};
    std::array<std::uint64_t, kMaxCameras> images_lost{};
  };

  /// `out`: name of the recording in messages.
  RecordSink(std::string out, const Calibration& calibration);

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override;
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& host) override;

  /// After the devices' threads have ended: writes what is queued. Throws if something could not be written.
  void finish();
  [[nodiscard]] Counters counters() const;
  /// Any thread: whether a writer has ended, for example because the disk is full; nothing more is kept then.
  [[nodiscard]] bool failed() const { return failed_.load(std::memory_order_relaxed); }

 protected:
  struct Image {
    Stamp stamp;
    std::vector<std::uint8_t> pixels;
  };

  /// Starts a thread that calls `step` until nothing is left after the end. `step` returns false if nothing
  /// was queued.
  void startWriter(std::function<bool()> step);
  /// Call in the destructor of the derived class, whose members the writers use.
  void stopWriters();
  /// Called by finish() after all writers have ended without error.
  virtual void close() {}

  [[nodiscard]] std::size_t cameras() const { return cameras_; }
  [[nodiscard]] int width(std::size_t camera) const { return camera_[camera].width; }
  [[nodiscard]] int height(std::size_t camera) const { return camera_[camera].height; }
  /// The oldest queued image; null: none. One writer per camera.
  [[nodiscard]] const Image* waitingImage(std::size_t camera) { return camera_[camera].images.front(); }
  void dropImage(std::size_t camera) { camera_[camera].images.pop(); }
  /// Reads the next sample as the sensor measured it: uncorrected, in its own axes. False: none.
  [[nodiscard]] bool nextSample(ImuSample& sample) {
    if (!samples_.tryPop(sample)) return false;
    if (!to_readings_.isIdentity()) to_readings_.apply(sample);
    return true;
  }

 private:
  /// Two seconds at 30 Hz: the longest observed write of an SD card while other writes continued.
  static constexpr std::size_t kImagesAhead = 64;
  static constexpr std::size_t kSamplesAhead = 4096;  // two seconds at 2 kHz

  struct Camera {
    int width = 0;
    int height = 0;
    SpscRing<Image, kImagesAhead> images;
    std::atomic<std::uint64_t> taken{0};
  };
  struct Writer {
    std::string error;  ///< empty: none
    std::thread thread;
  };

  void reserve(Camera& camera, const CameraModel& model);
  void write(const std::function<bool()>& step, std::string& error);

  std::string out_;
  std::size_t cameras_ = 0;
  ImuCorrection to_readings_;
  std::array<Camera, kMaxCameras> camera_;
  SpscRing<ImuSample, kSamplesAhead> samples_;
  std::atomic<std::uint64_t> samples_taken_{0};
  std::array<Writer, kMaxCameras + 1> writers_;
  std::size_t writer_count_ = 0;
  std::atomic<bool> ended_{false}, failed_{false};
};

}  // namespace swiftlet
