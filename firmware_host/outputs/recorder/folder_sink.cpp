#include "firmware_host/outputs/recorder/folder_sink.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/asl_text.hpp"
#include "drivers/recorded/image_files.hpp"

namespace swiftlet {
namespace {

constexpr const char* kOrigin = "recorded by swiftlet record; stamps of CLOCK_MONOTONIC";

std::ofstream openRows(const std::filesystem::path& path, const std::string& header) {
  std::ofstream file(path, std::ios::binary);
  file << header;
  if (!file) {
    throw InputError(path.string(), 0, "", "cannot be written", "Give an --out that this user can write to");
  }
  return file;
}

}  // namespace

FolderSink::FolderSink(const std::string& folder, const Calibration& calibration, double camera_rate)
    : RecordSink(folder, calibration), folder_(folder) {
  if (std::filesystem::exists(std::filesystem::path(folder) / "mav0")) {
    throw InputError(folder, 0, "", "already holds a recording",
                     "Give another --out, or move the recording away");
  }
  openImu(calibration);
  for (std::size_t c = 0; c < cameras(); ++c) openCamera(c, calibration, camera_rate);
  startWriter([this] { return writeSamples(); });
  for (std::size_t c = 0; c < cameras(); ++c) startWriter([this, c] { return writeImage(c); });
}

void FolderSink::openImu(const Calibration& calibration) {
  const std::filesystem::path folder = std::filesystem::path(folder_) / "mav0" / "imu0";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!calibration.bare) {
    openRows(folder / "sensor.yaml",
             imuYaml(calibration.noise, kOrigin, SE3(calibration.R_body_imu, Eigen::Vector3d::Zero()),
                     imuMatricesYaml(calibration)));
  }
  rows_ = openRows(folder / "data.csv", imuCsvHeader());
}

void FolderSink::openCamera(std::size_t index, const Calibration& calibration, double rate) {
  const std::filesystem::path folder =
      std::filesystem::path(folder_) / "mav0" / ("cam" + std::to_string(index));
  std::error_code error;
  std::filesystem::create_directories(folder / "data", error);
  Camera& camera = files_[index];
  camera.folder = (folder / "data").string();
  if (!calibration.bare) {
    const std::string times =
        fmt::format("timeshift_cam_imu: {:.9f}\n", calibration.rig.camera_to_imu_shift.seconds()) +
        shutterYaml(calibration.rig.readout);
    openRows(folder / "sensor.yaml", cameraYaml(calibration.rig.camera[index],
                                                calibration.rig.T_body_cam[index], rate, kOrigin, times));
  }
  camera.rows = openRows(folder / "data.csv", "#timestamp [ns],filename\n");
}

bool FolderSink::writeImage(std::size_t index) {
  const Image* image = waitingImage(index);
  if (image == nullptr) return false;
  Camera& camera = files_[index];
  const std::string name = std::to_string(image->stamp.ns) + ".png";
  writePng8(camera.folder + "/" + name, image->pixels.data(), width(index), height(index));
  camera.rows << image->stamp.ns << ',' << name << '\n' << std::flush;
  if (!camera.rows) throw std::runtime_error(camera.folder + ": data.csv cannot be written");
  dropImage(index);
  return true;
}

bool FolderSink::writeSamples() {
  ImuSample sample;
  bool any = false;
  while (nextSample(sample)) {
    rows_ << imuCsvRow(sample);
    any = true;
  }
  rows_ << std::flush;
  if (!rows_) throw std::runtime_error(folder_ + "/mav0/imu0/data.csv: cannot be written");
  return any;
}

}  // namespace swiftlet
