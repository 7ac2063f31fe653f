#include "drivers/calibration/bare_cameras.hpp"

namespace swiftlet {
namespace {

constexpr const char* kPlaceRemedy =
    "Write it as four rows of four numbers: the transform from camera to IMU coordinates, in metres";

}  // namespace

YamlField parseImu(const NamedText& imu) {
  const YamlField root = YamlField::parse(imu.name, imu.text);
  return root.has("imu0") ? root.at("imu0") : root;
}

bool readsRectified(const YamlField& imu) {
  if (!imu.has("images")) return false;
  const YamlField field = imu.at("images");
  const std::string images = field.text();
  if (images != "raw" && images != "rectified") {
    throw field.error("`" + images + "` is not a type of image pair", "Write raw or rectified");
  }
  return images == "rectified";
}

Calibration joinToImu(const BareCameras& bare, const YamlField& imu, Warnings warnings,
                      const CalibrationOptions& options) {
  Calibration calibration;
  calibration.form = bare.form;
  calibration.warnings = std::move(warnings);
  readImuModel(imu, calibration);
  calibration.noise = readNoise(imu, imu.has("rate_hz") ? "rate_hz" : "update_rate", calibration.warnings);
  std::vector<CameraEntry> entries = bare.cameras;
  const YamlField first = imu.at("T_imu_cam0", kPlaceRemedy);
  entries[0].T_body_cam = readTransform(first, calibration.warnings);
  if (entries.size() > 1 && bare.T_cam1_cam0) {
    if (imu.has("T_imu_cam1")) {
      throw imu.at("T_imu_cam1").error("the calibration of the pair already has it", "Remove one of the two");
    }
    entries[1].T_body_cam = entries[0].T_body_cam * bare.T_cam1_cam0->inverse();
  } else if (entries.size() > 1) {
    entries[1].T_body_cam = readTransform(imu.at("T_imu_cam1", kPlaceRemedy), calibration.warnings);
  }
  for (CameraEntry& entry : entries) {
    entry.shift_s = readShift(imu, calibration.warnings);
    entry.readout_s = readReadout(imu);
    if (!entry.file.empty()) continue;
    entry.file = first.file();
    entry.line = first.line();
    entry.field = first.name();
  }
  assembleRig(entries, options, calibration);
  return calibration;
}

}  // namespace swiftlet
