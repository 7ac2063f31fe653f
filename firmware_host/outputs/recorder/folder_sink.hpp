#pragma once
// A live recording as an EuRoC/ASL folder: mav0/imu0, cam0, cam1 with data.csv and sensor.yaml, images as
// PNG. `swiftlet replay` reads it, and so does everybody's tool.
//
// The devices' threads leave messages in fixed memory; one writer a camera compresses and writes them. A row
// stands in data.csv once its image is on the disk. What finds no room is counted, never waited for.
// Memory: kImagesAhead images a camera.

#include <array>
#include <atomic>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"

namespace swiftlet {

class FolderSink : public SensorSink {
 public:
  struct Counters {
    std::uint64_t samples = 0;
    std::uint64_t samples_lost = 0;  ///< the disk was too slow
    std::array<std::uint64_t, kMaxCameras> images{};
    std::array<std::uint64_t, kMaxCameras> images_lost{};
  };

  /// Creates the folder and starts the writers. InputError where it exists with data or cannot be written.
  FolderSink(const std::string& folder, const Calibration& calibration, double camera_rate);
  ~FolderSink() override;

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override;
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& host) override;

  /// After the devices' threads have ended: writes what waits. What could not be written is thrown.
  void finish();
  [[nodiscard]] Counters counters() const;
  /// Any thread: a writer has ended, a full disk for one; nothing more will be kept.
  [[nodiscard]] bool failed() const { return failed_.load(std::memory_order_relaxed); }

 private:
  struct Image {
    Stamp stamp;
    std::vector<std::uint8_t> pixels;
  };
  /// Two seconds at 30 Hz: the longest that an SD card's write took while others went on.
  static constexpr std::size_t kImagesAhead = 64;
  static constexpr std::size_t kSamplesAhead = 4096;  // as long, at 2 kHz

  struct Camera {
    std::string folder;
    int width = 0;
    int height = 0;
    std::ofstream rows;
    SpscRing<Image, kImagesAhead> images;
    std::atomic<std::uint64_t> taken{0};
    std::thread writer;
    std::string error;  ///< of the writer; empty: none
  };

  void openImu(const Calibration& calibration);
  void openCamera(std::size_t index, const Calibration& calibration, double rate);
  void writeImages(Camera& camera);
  void writeSamples();
  template <typename Work>
  void write(Work&& work, std::string& error);

  std::string folder_;
  std::size_t cameras_ = 0;
  std::array<Camera, kMaxCameras> camera_;
  std::ofstream rows_;
  SpscRing<ImuSample, kSamplesAhead> samples_;
  std::atomic<std::uint64_t> samples_taken_{0};
  std::thread writer_;
  std::string error_;
  std::atomic<bool> ended_{false}, failed_{false};
};

}  // namespace swiftlet
