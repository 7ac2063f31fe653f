// Finding and reading the files of a calibration.

#include "drivers/calibration/calibration.hpp"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <utility>

#include "drivers/calibration/yaml_field.hpp"
#include "drivers/input/file_tree.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// A YAML file larger than this is not a calibration (the parser refuses it with a message).
constexpr std::size_t kMaxFileBytes = (1U << 20U) + 1U;

enum class FileKind { kOther, kCamchain, kImu, kBasalt, kCameraInfo, kOpenCv, kOpenCvPair };

std::string readText(FileTree& tree, const std::string& path) {
  std::vector<std::uint8_t> bytes;
  if (!tree.read(path, bytes)) {
    throw InputError(tree.name(path), 0, "", "cannot be read",
                     "A calibration is required: place it beside the log, or give another path");
  }
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), kMaxFileBytes))};
}

bool hasAny(const YamlField& root, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) { return root.has(key); });
}

FileKind kindOf(FileTree& tree, const std::string& path) {
  try {
    const YamlField root = YamlField::parse(tree.name(path), readText(tree, path));
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
    // A file that is not YAML is not a calibration either; the search continues.
  }
  return FileKind::kOther;
}

bool describesCameras(FileKind kind) {
  return kind == FileKind::kCamchain || kind == FileKind::kBasalt || kind == FileKind::kCameraInfo ||
         kind == FileKind::kOpenCv;
}

std::string within(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

std::vector<std::string> textFilesIn(const FileTree& tree, const std::string& folder) {
  std::vector<std::string> files;
  for (const std::string& name : tree.list(folder)) {
    const bool text = name.ends_with(".yaml") || name.ends_with(".yml") || name.ends_with(".json");
    if (text && tree.isFile(within(folder, name))) files.push_back(within(folder, name));
  }
  return files;
}

std::vector<std::string> filesOf(FileTree& tree, const std::string& folder, FileKind kind) {
  std::vector<std::string> files = textFilesIn(tree, folder);
  std::erase_if(files, [&](const std::string& file) { return kindOf(tree, file) != kind; });
  return files;
}

void refuseMore(const FileTree& tree, const std::string& folder, const std::vector<std::string>& files,
                std::size_t most, const char* what) {
  if (files.size() <= most) return;
  throw InputError(tree.name(folder), 0, "",
                   std::string(most == 1 ? "two " : "three ") + what +
                       " files: " + fs::path(files[most - 1]).filename().string() + " and " +
                       fs::path(files[most]).filename().string(),
                   "Specify the one to use");
}

/// A file of a calibration: from the calibration's tree, or the IMU file from any place on disk.
struct Text {
  std::string name;
  std::string text;
  [[nodiscard]] NamedText named() const { return {name, text}; }
};

Text textOf(FileTree& tree, const std::string& path) { return {tree.name(path), readText(tree, path)}; }

/// The IMU file: `imu_file` on disk if given, else the one in the folder.
std::optional<Text> imuOf(FileTree& tree, const std::string& folder, const std::string& imu_file) {
  if (!imu_file.empty()) {
    const fs::path path(imu_file);
    const auto disk = openFolder(path.parent_path().string());
    return Text{imu_file, readText(*disk, path.filename().string())};
  }
  const std::vector<std::string> files = filesOf(tree, folder, FileKind::kImu);
  refuseMore(tree, folder, files, 1, "IMU");
  if (files.empty()) return std::nullopt;
  return textOf(tree, files.front());
}

Calibration readEuroc(FileTree& tree, const std::string& mav0, const CalibrationOptions& options) {
  std::vector<Text> texts;
  for (const char* camera : {"cam0", "cam1"}) {
    // A sequence with one camera has no second folder; a folder without sensor.yaml is a fault.
    if (!texts.empty() && !tree.isFolder(within(mav0, camera))) break;
    texts.push_back(textOf(tree, within(mav0, camera) + "/sensor.yaml"));
  }
  std::vector<NamedText> cameras;
  for (const Text& text : texts) cameras.push_back(text.named());
  const Text imu = textOf(tree, within(mav0, "imu0/sensor.yaml"));
  return parseEurocCalibration(cameras, imu.named(), options);
}

/// Reads ROS or OpenCV files, which contain only cameras.
Calibration readBare(FileTree& tree, FileKind kind, const std::vector<std::string>& cameras,
                     const std::optional<Text>& imu, const CalibrationOptions& options) {
  if (!imu) {
    throw InputError(
        tree.name(cameras.front()), 0, "",
        "holds only cameras: the IMU's noise and its pose relative to camera 0 are missing",
        "Write imu.yaml beside it with update_rate, gyroscope_noise_density, gyroscope_random_walk, "
        "accelerometer_noise_density, accelerometer_random_walk and T_imu_cam0 (docs/formats.md has "
        "an example)");
  }
  std::vector<Text> texts;
  for (const std::string& file : cameras) texts.push_back(textOf(tree, file));
  std::vector<NamedText> named;
  for (const Text& text : texts) named.push_back(text.named());
  return kind == FileKind::kCameraInfo ? parseCameraInfoCalibration(named, imu->named(), options)
                                       : parseOpenCvCalibration(named, imu->named(), options);
}

bool hasEuroc(const FileTree& tree, const std::string& folder) {
  return tree.isFile(within(folder, "cam0/sensor.yaml"));
}

/// Reads one file; for Kalibr, ROS and OpenCV also the IMU file beside it in `folder`.
Calibration readFile(FileTree& tree, const std::string& folder, const std::string& path,
                     const std::string& imu_file, const CalibrationOptions& options) {
  const FileKind kind = kindOf(tree, path);
  const Text text = textOf(tree, path);
  switch (kind) {
    case FileKind::kBasalt:
      return parseBasaltCalibration(text.named(), options);
    case FileKind::kCameraInfo:
    case FileKind::kOpenCv:
      return readBare(tree, kind, {path}, imuOf(tree, folder, imu_file), options);
    case FileKind::kCamchain: {
      const std::optional<Text> imu = imuOf(tree, folder, imu_file);
      if (!imu) {
        throw InputError(tree.name(folder), 0, "", "no Kalibr IMU file",
                         "Give Kalibr's IMU YAML beside the camchain, or its path");
      }
      return parseKalibrCalibration(text.named(), imu->named(), options);
    }
    default:
      // Parsing produces a message that shows what is wrong.
      throw YamlField::parse(text.name, text.text)
          .error(
              "not a camera calibration: not a Kalibr camchain, Basalt JSON, ROS camera_info or OpenCV file",
              "Give one of these, or a EuRoC folder");
  }
}

}  // namespace

bool hasCalibration(FileTree& tree, const std::string& folder) {
  if (hasEuroc(tree, within(folder, "mav0")) || hasEuroc(tree, folder)) return true;
  return std::ranges::any_of(textFilesIn(tree, folder),
                             [&](const std::string& file) { return describesCameras(kindOf(tree, file)); });
}

bool hasCalibration(const std::string& path) {
  if (!fs::is_directory(path)) return fs::exists(path);
  return hasCalibration(*openFolder(path), "");
}

Calibration readCalibration(FileTree& tree, const std::string& folder, const std::string& imu_file,
                            const CalibrationOptions& options) {
  for (const std::string& mav0 : {within(folder, "mav0"), folder}) {
    if (hasEuroc(tree, mav0)) return readEuroc(tree, mav0, options);
  }
  for (const auto& [kind, name] : {std::pair{FileKind::kCamchain, "Kalibr camchain"},
                                   std::pair{FileKind::kBasalt, "Basalt calibration"}}) {
    const std::vector<std::string> files = filesOf(tree, folder, kind);
    refuseMore(tree, folder, files, 1, name);
    if (!files.empty()) return readFile(tree, folder, files.front(), imu_file, options);
  }
  std::vector<std::string> cameras = filesOf(tree, folder, FileKind::kCameraInfo);
  refuseMore(tree, folder, cameras, kMaxCameras, "camera_info");
  if (!cameras.empty()) {
    return readBare(tree, FileKind::kCameraInfo, cameras, imuOf(tree, folder, imu_file), options);
  }
  cameras = filesOf(tree, folder, FileKind::kOpenCv);
  refuseMore(tree, folder, cameras, 1, "OpenCV");
  if (cameras.empty()) {
    throw InputError(
        tree.name(folder), 0, "", "no camera calibration",
        "Give EuRoC cam0/sensor.yaml and imu0/sensor.yaml, Kalibr's camchain and IMU YAML, Basalt's "
        "JSON, or ROS or OpenCV files with imu.yaml");
  }
  const std::vector<std::string> pair = filesOf(tree, folder, FileKind::kOpenCvPair);
  cameras.insert(cameras.end(), pair.begin(), pair.end());
  return readBare(tree, FileKind::kOpenCv, cameras, imuOf(tree, folder, imu_file), options);
}

Calibration readCalibration(const std::string& path, const std::string& imu_file,
                            const CalibrationOptions& options) {
  const fs::path given(path);
  if (!fs::exists(given)) {
    throw InputError(path, 0, "", "does not exist", "Give a calibration file or a folder with one");
  }
  if (fs::is_directory(given)) return readCalibration(*openFolder(path), "", imu_file, options);
  if (given.filename() == "sensor.yaml") {
    return readEuroc(*openFolder(fs::absolute(given).parent_path().parent_path().string()), "", options);
  }
  return readFile(*openFolder(given.parent_path().string()), "", given.filename().string(), imu_file,
                  options);
}

}  // namespace swiftlet
