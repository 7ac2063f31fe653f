// Finding and reading calibration files on disk.

#include "drivers/calibration/calibration.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <utility>

#include "drivers/calibration/yaml_field.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// A YAML file larger than this is not a calibration (the parser refuses it with a message).
constexpr std::size_t kMaxFileBytes = (1U << 20U) + 1U;

enum class FileKind { kOther, kCamchain, kImu, kBasalt, kCameraInfo, kOpenCv, kOpenCvPair };

std::string readText(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw InputError(path.string(), 0, "", "cannot be read",
                     "The calibration is needed; give it beside the log or with another path");
  }
  std::string text(kMaxFileBytes, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

bool hasAny(const YamlField& root, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) { return root.has(key); });
}

FileKind kindOf(const fs::path& path) {
  try {
    const YamlField root = YamlField::parse(path.string(), readText(path));
    if (root.has("cam0") && root.at("cam0").isMap()) return FileKind::kCamchain;
    if (root.has("imu0") && root.at("imu0").isMap()) return FileKind::kImu;
    if (root.has("gyroscope_noise_density") && hasAny(root, {"update_rate", "rate_hz"}))
      return FileKind::kImu;
    const YamlField inner = root.has("value0") && root.at("value0").isMap() ? root.at("value0") : root;
    if (inner.has("T_imu_cam") && inner.has("intrinsics")) return FileKind::kBasalt;
    const bool ros =
        hasAny(root, {"distortion_model", "projection_matrix", "rectification_matrix", "camera_name"});
    if (root.has("camera_matrix") && ros) return FileKind::kCameraInfo;
    const bool matrix =
        hasAny(root, {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "M1", "K1", "cameraMatrix1"});
    const bool lens = hasAny(
        root, {"distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D", "D1", "distCoeffs1"});
    if (matrix && lens) return FileKind::kOpenCv;
    if (root.has("R") && root.has("T")) return FileKind::kOpenCvPair;
  } catch (const InputError&) {
    // A file that is no YAML is no calibration either; the search goes on without it.
  }
  return FileKind::kOther;
}

bool describesCameras(FileKind kind) {
  return kind == FileKind::kCamchain || kind == FileKind::kBasalt || kind == FileKind::kCameraInfo ||
         kind == FileKind::kOpenCv;
}

std::vector<fs::path> yamlFilesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    if (entry.is_regular_file(error) &&
        (extension == ".yaml" || extension == ".yml" || extension == ".json")) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<fs::path> filesOf(const fs::path& folder, FileKind kind) {
  std::vector<fs::path> files = yamlFilesIn(folder);
  std::erase_if(files, [kind](const fs::path& file) { return kindOf(file) != kind; });
  return files;
}

void refuseMore(const fs::path& folder, const std::vector<fs::path>& files, std::size_t most,
                const char* what) {
  if (files.size() <= most) return;
  throw InputError(folder.string(), 0, "",
                   std::string(most == 1 ? "two " : "three ") + what + " files: " +
                       files[most - 1].filename().string() + " and " + files[most].filename().string(),
                   "Name the one to use");
}

/// The IMU file: the given one, or the one of the folder.
fs::path imuOf(const fs::path& folder, const std::string& imu_file) {
  if (!imu_file.empty()) return imu_file;
  const std::vector<fs::path> files = filesOf(folder, FileKind::kImu);
  refuseMore(folder, files, 1, "IMU");
  return files.empty() ? fs::path() : files.front();
}

Calibration readEuroc(const fs::path& mav0, const CalibrationOptions& options) {
  std::vector<std::string> names;
  std::vector<std::string> texts;
  for (const char* camera : {"cam0", "cam1"}) {
    const fs::path file = mav0 / camera / "sensor.yaml";
    // A sequence with one camera has no second folder; a folder without sensor.yaml is a fault.
    if (!names.empty() && !fs::exists(mav0 / camera)) break;
    names.push_back(file.string());
    texts.push_back(readText(file));
  }
  std::vector<NamedText> cameras;
  for (std::size_t i = 0; i < names.size(); ++i) cameras.push_back({names[i], texts[i]});
  const fs::path imu_file = mav0 / "imu0" / "sensor.yaml";
  const std::string imu_text = readText(imu_file);
  return parseEurocCalibration(cameras, {imu_file.string(), imu_text}, options);
}

Calibration readKalibr(const fs::path& camchain, const fs::path& imu, const CalibrationOptions& options) {
  const std::string chain_text = readText(camchain);
  const std::string imu_text = readText(imu);
  return parseKalibrCalibration({camchain.string(), chain_text}, {imu.string(), imu_text}, options);
}

/// ROS's or OpenCV's files, which hold cameras alone.
Calibration readBare(FileKind kind, const std::vector<fs::path>& cameras, const fs::path& imu,
                     const CalibrationOptions& options) {
  if (imu.empty()) {
    throw InputError(
        cameras.front().string(), 0, "",
        "holds cameras alone: the IMU's noise, and its place beside camera 0, are missing",
        "Write imu.yaml beside it with update_rate, gyroscope_noise_density, gyroscope_random_walk, "
        "accelerometer_noise_density, accelerometer_random_walk and T_imu_cam0 (docs/formats.md has "
        "an example)");
  }
  std::vector<std::string> texts;
  for (const fs::path& file : cameras) texts.push_back(readText(file));
  std::vector<NamedText> named;
  for (std::size_t i = 0; i < cameras.size(); ++i) named.push_back({cameras[i].string(), texts[i]});
  const std::string imu_text = readText(imu);
  const NamedText imu_named{imu.string(), imu_text};
  return kind == FileKind::kCameraInfo ? parseCameraInfoCalibration(named, imu_named, options)
                                       : parseOpenCvCalibration(named, imu_named, options);
}

bool hasEuroc(const fs::path& folder) { return fs::exists(folder / "cam0" / "sensor.yaml"); }

/// One file, and for Kalibr, ROS and OpenCV the IMU file beside it.
Calibration readFile(const fs::path& given, const std::string& imu_file, const CalibrationOptions& options) {
  const fs::path folder = fs::absolute(given).parent_path();
  if (given.filename() == "sensor.yaml") return readEuroc(folder.parent_path(), options);
  const FileKind kind = kindOf(given);
  const std::string text = readText(given);
  switch (kind) {
    case FileKind::kBasalt:
      return parseBasaltCalibration({given.string(), text}, options);
    case FileKind::kCameraInfo:
    case FileKind::kOpenCv:
      return readBare(kind, {given}, imuOf(folder, imu_file), options);
    case FileKind::kCamchain: {
      const fs::path imu = imuOf(folder, imu_file);
      if (imu.empty()) {
        throw InputError(folder.string(), 0, "", "no Kalibr IMU file",
                         "Give Kalibr's IMU YAML beside the camchain, or name it");
      }
      return readKalibr(given, imu, options);
    }
    default:
      // Parsing shows what is wrong with it.
      throw YamlField::parse(given.string(), text)
          .error(
              "not a calibration of cameras: no Kalibr camchain, Basalt JSON, ROS camera_info or OpenCV file",
              "Give one of these, or a EuRoC folder");
  }
}

}  // namespace

bool hasCalibration(const std::string& path) {
  const fs::path given(path);
  if (!fs::is_directory(given)) return fs::exists(given);
  if (hasEuroc(given / "mav0") || hasEuroc(given)) return true;
  const std::vector<fs::path> files = yamlFilesIn(given);
  return std::any_of(files.begin(), files.end(),
                     [](const fs::path& f) { return describesCameras(kindOf(f)); });
}

Calibration readCalibration(const std::string& path, const std::string& imu_file,
                            const CalibrationOptions& options) {
  const fs::path given(path);
  if (!fs::exists(given)) {
    throw InputError(path, 0, "", "does not exist", "Give a calibration file or a folder that has one");
  }
  if (!fs::is_directory(given)) return readFile(given, imu_file, options);
  if (hasEuroc(given / "mav0")) return readEuroc(given / "mav0", options);
  if (hasEuroc(given)) return readEuroc(given, options);
  for (const auto& [kind, name] : {std::pair{FileKind::kCamchain, "Kalibr camchain"},
                                   std::pair{FileKind::kBasalt, "Basalt calibration"}}) {
    const std::vector<fs::path> files = filesOf(given, kind);
    refuseMore(given, files, 1, name);
    if (!files.empty()) return readFile(files.front(), imu_file, options);
  }
  std::vector<fs::path> cameras = filesOf(given, FileKind::kCameraInfo);
  refuseMore(given, cameras, kMaxCameras, "camera_info");
  if (!cameras.empty()) return readBare(FileKind::kCameraInfo, cameras, imuOf(given, imu_file), options);
  cameras = filesOf(given, FileKind::kOpenCv);
  refuseMore(given, cameras, 1, "OpenCV");
  if (cameras.empty()) {
    throw InputError(
        path, 0, "", "no calibration of cameras",
        "Give EuRoC cam0/sensor.yaml and imu0/sensor.yaml, Kalibr's camchain and IMU YAML, Basalt's "
        "JSON, or ROS or OpenCV files with imu.yaml");
  }
  const std::vector<fs::path> pair = filesOf(given, FileKind::kOpenCvPair);
  cameras.insert(cameras.end(), pair.begin(), pair.end());
  return readBare(FileKind::kOpenCv, cameras, imuOf(given, imu_file), options);
}

}  // namespace swiftlet
