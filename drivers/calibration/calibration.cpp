// Finding and reading calibration files on disk.

#include "drivers/calibration/calibration.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "drivers/calibration/yaml_field.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// A YAML file larger than this is not a calibration (the parser refuses it with a message).
constexpr std::size_t kMaxFileBytes = (1U << 20U) + 1U;

enum class FileKind { kOther, kCamchain, kKalibrImu };

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

FileKind kindOf(const fs::path& path) {
  try {
    const YamlField root = YamlField::parse(path.string(), readText(path));
    if (root.has("cam0") && root.at("cam0").isMap()) return FileKind::kCamchain;
    if (root.has("imu0") && root.at("imu0").isMap()) return FileKind::kKalibrImu;
    if (root.has("gyroscope_noise_density") && root.has("update_rate")) return FileKind::kKalibrImu;
  } catch (const InputError&) {
    // A file that is no YAML is no calibration either; the search goes on without it.
  }
  return FileKind::kOther;
}

std::vector<fs::path> yamlFilesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    if (entry.is_regular_file(error) && (extension == ".yaml" || extension == ".yml")) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

fs::path findOne(const fs::path& folder, FileKind kind, const char* what) {
  std::optional<fs::path> found;
  for (const fs::path& file : yamlFilesIn(folder)) {
    if (kindOf(file) != kind) continue;
    if (found) {
      throw InputError(folder.string(), 0, "",
                       std::string("two ") + what + " files: " + found->filename().string() + " and " +
                           file.filename().string(),
                       "Name the one to use");
    }
    found = file;
  }
  if (!found) {
    throw InputError(folder.string(), 0, "", std::string("no ") + what + " file",
                     "Give EuRoC cam0/sensor.yaml and imu0/sensor.yaml, or Kalibr's camchain and IMU YAML");
  }
  return *found;
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

bool hasEuroc(const fs::path& folder) { return fs::exists(folder / "cam0" / "sensor.yaml"); }

}  // namespace

bool hasCalibration(const std::string& path) {
  const fs::path given(path);
  if (!fs::is_directory(given)) return fs::exists(given);
  if (hasEuroc(given / "mav0") || hasEuroc(given)) return true;
  const std::vector<fs::path> files = yamlFilesIn(given);
  return std::any_of(files.begin(), files.end(),
                     [](const fs::path& f) { return kindOf(f) == FileKind::kCamchain; });
}

Calibration readCalibration(const std::string& path, const std::string& imu_file,
                            const CalibrationOptions& options) {
  const fs::path given(path);
  if (!fs::exists(given)) {
    throw InputError(path, 0, "", "does not exist", "Give a calibration file or a folder that has one");
  }
  if (!fs::is_directory(given)) {
    if (given.filename() == "sensor.yaml")
      return readEuroc(fs::absolute(given).parent_path().parent_path(), options);
    if (kindOf(given) != FileKind::kCamchain) {
      // Parsing shows what is wrong with it.
      const YamlField root = YamlField::parse(path, readText(given));
      throw root.error("no `cam0`: this is not a Kalibr camchain", "Give the camchain, or a EuRoC folder");
    }
    const fs::path imu = imu_file.empty()
                             ? findOne(fs::absolute(given).parent_path(), FileKind::kKalibrImu, "Kalibr IMU")
                             : fs::path(imu_file);
    return readKalibr(given, imu, options);
  }
  if (hasEuroc(given / "mav0")) return readEuroc(given / "mav0", options);
  if (hasEuroc(given)) return readEuroc(given, options);
  const fs::path camchain = findOne(given, FileKind::kCamchain, "Kalibr camchain");
  const fs::path imu =
      imu_file.empty() ? findOne(given, FileKind::kKalibrImu, "Kalibr IMU") : fs::path(imu_file);
  return readKalibr(camchain, imu, options);
}

}  // namespace swiftlet
