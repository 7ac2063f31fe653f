#pragma once
// A live recording as an EuRoC/ASL folder: mav0/imu0, cam0, cam1 with data.csv and sensor.yaml, images as
// PNG. `swiftlet replay` and other tools read it.
//
// One writer thread per camera compresses and writes images, one writes the samples. A row is added to
// data.csv after its image is on the disk.

#include <array>
#include <fstream>
#include <string>

#include "firmware_host/outputs/recorder/record_sink.hpp"

namespace swiftlet {

class FolderSink final : public RecordSink {
 public:
  /// Creates the folder and starts the writers. InputError if it exists with data or cannot be written.
  FolderSink(const std::string& folder, const Calibration& calibration, double camera_rate);
  ~FolderSink() override { stopWriters(); }

 private:
  struct Camera {
    std::string folder;
    std::ofstream rows;
  };

  void openImu(const Calibration& calibration);
  void openCamera(std::size_t index, const Calibration& calibration, double rate);
  bool writeImage(std::size_t camera);
  bool writeSamples();

  std::string folder_;
  std::array<Camera, kMaxCameras> files_;
  std::ofstream rows_;
};

}  // namespace swiftlet
