#include "drivers/recorded/asl_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <optional>

#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "drivers/recorded/recorded_log.hpp"

namespace swiftlet {
namespace {

// Numbers in image names; larger ones are stamps in ns (any time after the first 0.1 s).
constexpr std::int64_t kLargestNumber = 100'000'000;
constexpr int kAround = 2;  // largest number of folders that archives put around a log

std::string joined(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

std::string parentOf(const std::string& folder) {
  const std::size_t slash = folder.rfind('/');
  return slash == std::string::npos ? std::string() : folder.substr(0, slash);
}

/// Finds the folders that hold imu0 or cam0: `folder` or its mav0, else those up to `depth` levels below.
void findIn(const FileTree& tree, const std::string& folder, int depth, std::vector<std::string>& found) {
  for (const std::string& place : {joined(folder, "mav0"), folder}) {
    if (!tree.isFolder(joined(place, "imu0")) && !tree.isFolder(joined(place, "cam0"))) continue;
    found.push_back(place);
    return;
  }
  if (depth == 0) return;
  for (const std::string& name : tree.list(folder)) {
    if (tree.isFolder(joined(folder, name))) findIn(tree, joined(folder, name), depth - 1, found);
  }
}

class AslFolder final : public RecordedLog {
 public:
  AslFolder(AslFiles files, const LogOptions& options);
  using LogSource::groundTruth;
  [[nodiscard]] Trajectory groundTruth(LogWarnings& warnings) const override;
  [[nodiscard]] std::string groundTruthName() const override {
    return truth_.empty() ? truth_ : name(truth_);
  }
  [[nodiscard]] std::string trackFile() const override { return track_file_; }
  [[nodiscard]] std::span<const std::uint8_t> picture() const override { return bytes_; }

 protected:
  Fetched fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) override;

 private:
  void readCalibrationFiles();
  void readCameras();
  void readCamera(std::uint32_t camera);
  void stampNumbered(std::uint32_t camera, std::vector<ImageRow>& rows);
  std::vector<ImageRow> listImages(std::uint32_t camera);
  [[nodiscard]] bool listsImages() const;
  [[nodiscard]] bool locate(std::uint32_t camera, ImageRow& row) const;
  void chooseTruth();

  [[nodiscard]] std::string name(const std::string& path) const { return log_.tree->name(log_.at(path)); }
  [[nodiscard]] bool hasFile(const std::string& path) const { return log_.tree->isFile(log_.at(path)); }
  [[nodiscard]] bool hasFolder(const std::string& path) const { return log_.tree->isFolder(log_.at(path)); }
  [[nodiscard]] std::string text(const std::string& path) const { return log_.tree->text(log_.at(path)); }

  AslFiles log_;
  std::array<std::vector<std::string>, kMaxCameras> files_;  ///< relative to camN
  std::vector<std::uint8_t> bytes_;
  ImageDecoder decoder_;
  std::string truth_;  ///< relative to folder_; empty: none
  std::string track_file_;
};

AslFolder::AslFolder(AslFiles files, const LogOptions& options)
    : RecordedLog(options), log_(std::move(files)) {
  if (!options_.without_images && !listsImages() && hasFile("tracks0/data.csv"))
    track_file_ = name("tracks0/data.csv");
  readCalibrationFiles();
  const std::string imu = name("imu0/data.csv");
  const bool has_imu = hasFile("imu0/data.csv");
  if (!has_imu && !options_.uncalibrated) {
    throw InputError(imu, 0, "", "does not exist", "Give a log with IMU samples in imu0/data.csv");
  }
  if (has_imu) samples_ = readImuText(imu, text("imu0/data.csv"), counters_, warnings_);
  if (!options_.without_images && track_file_.empty()) readCameras();
  prepare(imu);
  if (files_[0].size() != files_[1].size() && !files_[0].empty() && !files_[1].empty()) {
    warnings_.add(fmt::format("{}: cam0 has {} images, cam1 has {}; frames without a partner are used alone",
                              name(""), files_[0].size(), files_[1].size()));
  }
  chooseTruth();
}

void AslFolder::readCalibrationFiles() {
  const CalibrationOptions& how = options_.calibration_options;
  if (options_.uncalibrated) {
    calibration_.rig.camera_count = kMaxCameras;
  } else if (!options_.calibration.empty()) {
    calibration_ = readCalibration(options_.calibration, options_.imu_calibration, how);
  } else if (hasFile("cam0/sensor.yaml")) {
    calibration_ = readCalibration(*log_.tree, log_.folder, options_.imu_calibration, how);
  } else {
    // Kalibr's files may lie beside the data; TUM-VI keeps them in dso/.
    const std::string above = parentOf(log_.folder);
    for (const std::string& place : {above, log_.folder, joined(above, "dso"), joined(log_.folder, "dso")}) {
      if (!hasCalibration(*log_.tree, place)) continue;
      calibration_ = readCalibration(*log_.tree, place, options_.imu_calibration, how);
      break;
    }
    if (calibration_.rig.camera_count == 0) {
      throw InputError(
          name("cam0/sensor.yaml"), 0, "", "does not exist",
          "Give a log with a calibration: EuRoC sensor.yaml, or pass Kalibr's camchain and IMU YAML");
    }
  }
  // Track files need no folder for the second camera: they name the camera of each sighting.
  const bool images = !options_.without_images && track_file_.empty();
  const bool no_second = images && !hasFolder("cam1");
  if (calibration_.rig.camera_count > 1 && (options_.mono || no_second)) {
    if (!options_.mono) warnings_.add(name("") + ": no cam1, continuing with one camera");
    calibration_.rig.camera_count = 1;
  }
}

bool AslFolder::listsImages() const {
  return std::ranges::any_of(std::array{"cam0", "cam1"}, [this](const std::string& camera) {
    return hasFile(camera + "/data.csv") || hasFolder(camera + "/data");
  });
}

void AslFolder::readCameras() {
  for (std::uint32_t camera = 0; camera < calibration_.rig.camera_count; ++camera) readCamera(camera);
  if (calibration_.rig.camera_count > 1 && files_[1].empty()) {
    warnings_.add(name("") + ": cam1 has no images, continuing with one camera");
    calibration_.rig.camera_count = 1;
  }
  if (images_.empty()) {
    throw InputError(name(""), 0, "", "none of the listed images exists",
                     "Images are expected in cam0/data and cam1/data, tracks in tracks0/data.csv");
  }
}

/// Finds the file of a row, whose name may be missing or lack its extension.
bool AslFolder::locate(std::uint32_t camera, ImageRow& row) const {
  const std::string folder = fmt::format("cam{}", camera);
  const std::string stem = row.file.empty() ? std::to_string(row.stamp.ns) : row.file;
  const bool whole = stem.rfind('.') != std::string::npos && stem.rfind('.') > 0;
  for (const std::string extension : {"", ".png", ".jpg", ".jpeg"}) {
    if (row.file.empty() && extension.empty()) continue;
    for (const std::string place : {"data/", ""}) {
      const std::string relative = place + stem + extension;
      if (hasFile(folder + "/" + relative)) {
        row.file = relative;
        return true;
      }
    }
    if (whole && extension.empty()) break;
  }
  return false;
}

/// The number at the end of a file name: 12 for frame_000012.jpg.
std::optional<std::int64_t> numberOf(const std::string& file) {
  const std::string stem = file.substr(0, file.rfind('.'));
  std::size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  std::int64_t number = 0;
  if (!parseInteger(stem.substr(begin), number)) return std::nullopt;
  return number;
}

std::vector<ImageRow> AslFolder::listImages(std::uint32_t camera) {
  const std::string folder = fmt::format("cam{}", camera);
  const std::string csv = folder + "/data.csv";
  if (hasFile(csv)) return readImageListText(name(csv), text(csv), counters_, warnings_);
  std::vector<ImageRow> stamped;
  std::vector<ImageRow> numbered;
  for (const std::string& file : log_.tree->list(log_.at(folder + "/data"))) {
    Stamp stamp;
    if (parseInteger(file.substr(0, file.rfind('.')), stamp.ns) && stamp.ns > kLargestNumber) {
      stamped.push_back({stamp, file});
    } else if (const std::optional<std::int64_t> number = numberOf(file)) {
      numbered.push_back({{*number}, file});
    }
  }
  std::vector<ImageRow>& rows = stamped.empty() ? numbered : stamped;
  // A directory listing has no order, so sorting it needs no warning.
  std::ranges::sort(rows, {}, &ImageRow::stamp);
  orderByStamp(rows, name(folder + "/data"), counters_, warnings_);
  if (stamped.empty()) {
    stampNumbered(camera, rows);
  } else {
    warnings_.add(name(csv) + ": does not exist; stamps are taken from the image names");
  }
  return rows;
}

/// Numbered images, as frame grabbers write them, have no stamps: they are stamped at the calibration's rate,
/// starting at the first IMU sample.
void AslFolder::stampNumbered(std::uint32_t camera, std::vector<ImageRow>& rows) {
  if (rows.empty()) return;
  if (options_.uncalibrated) {
    for (ImageRow& row : rows) row.stamp = Stamp{} + Duration::fromSeconds(static_cast<double>(row.stamp.ns));
    return;
  }
  const double rate = calibration_.camera_rate_hz[camera];
  const std::string csv = name(fmt::format("cam{}/data.csv", camera));
  if (rate <= 0) {
    throw InputError(
        csv, 0, "", fmt::format("does not exist, and names like `{}` are not stamps", rows.front().file),
        "Write data.csv with lines `stamp [ns], file name`, or the cameras' rate_hz in sensor.yaml");
  }
  warnings_.add(
      fmt::format("{}: does not exist, and names like `{}` are not stamps; images are stamped at {:g} Hz "
                  "from the first IMU sample on. Write data.csv if this is wrong",
                  csv, rows.front().file, rate));
  const std::int64_t first = rows.front().stamp.ns;
  for (ImageRow& row : rows) {
    row.stamp =
        samples_.front().stamp + Duration::fromSeconds(static_cast<double>(row.stamp.ns - first) / rate);
  }
}

void AslFolder::readCamera(std::uint32_t camera) {
  const std::string folder = fmt::format("cam{}", camera);
  std::vector<ImageRow> rows = listImages(camera);
  std::uint64_t missing = 0;
  for (ImageRow& row : rows) {
    if (!locate(camera, row)) {
      ++missing;
      warnings_.addCounted(++counters_.missing_images,
                           fmt::format("{}: image `{}` with stamp {} is missing, skipped",
                                       name(folder + "/data"), row.file, row.stamp.ns));
      continue;
    }
    images_.push_back({row.stamp, camera, static_cast<std::uint32_t>(files_[camera].size())});
    files_[camera].push_back(row.file);
  }
  if (missing > 0 && files_[camera].empty())
    warnings_.add(name(folder) + ": none of the listed images exists");
}

RecordedLog::Fetched AslFolder::fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) {
  const std::string path = fmt::format("cam{}/{}", entry.camera, files_[entry.camera][entry.index]);
  Fetched fetched;
  fetched.name = name(path);
  fetched.missing = !log_.tree->read(log_.at(path), bytes_);
  if (!fetched.missing) fetched.result = decoder_.decode(bytes_, expected, out, fetched.found);
  return fetched;
}

/// Nanoseconds between the first and the last image that the truth covers.
std::int64_t coverage(const Trajectory& truth, Stamp first, Stamp last) {
  if (truth.empty()) return 0;
  const std::int64_t overlap = (std::min(truth.back().stamp, last) - std::max(truth.front().stamp, first)).ns;
  return std::max<std::int64_t>(overlap, 0);
}

void AslFolder::chooseTruth() {
  // In order of preference: the first one wins if two cover the same time.
  std::vector<std::string> candidates;
  for (const std::string place : {"state_groundtruth_openvins", "state_groundtruth_estimate0", "mocap0"}) {
    if (hasFile(place + "/data.csv")) candidates.push_back(place + "/data.csv");
  }
  if (candidates.size() == 1) truth_ = candidates.front();
  if (candidates.size() <= 1) return;
  std::int64_t best = -1;
  for (const std::string& file : candidates) {
    LogCounters counters;
    LogWarnings warnings;
    try {
      const Trajectory truth = readTrajectoryText(name(file), text(file), counters, warnings);
      const std::int64_t covered = images_.empty()
                                       ? coverage(truth, samples_.front().stamp, samples_.back().stamp)
                                       : coverage(truth, images_.front().stamp, images_.back().stamp);
      if (covered <= best) continue;
      best = covered;
      truth_ = file;
    } catch (const InputError& error) {
      warnings_.add(std::string(error.what()) + " (truth omitted)");
    }
  }
}

Trajectory AslFolder::groundTruth(LogWarnings& warnings) const {
  if (truth_.empty()) return {};
  LogCounters counters;
  Trajectory truth = readTrajectoryText(groundTruthName(), text(truth_), counters, warnings);
  const SE3 T_filebody_body = calibration_.T_body_filebody.inverse();
  // The velocity of another point of the body would need the true angular rate, which the file does not have.
  const bool moved = T_filebody_body.translation.norm() > 0;
  for (TrajectoryPoint& point : truth) {
    point.T_world_body = point.T_world_body * T_filebody_body;
    point.has_motion = point.has_motion && !moved;
  }
  return truth;
}

}  // namespace

AslFiles findAslFiles(const std::string& path) {
  const bool on_disk = std::filesystem::is_directory(path);
  if (!on_disk && !isArchive(path)) return {};
  AslFiles files{on_disk ? openFolder(path) : openArchive(path), {}};
  if (on_disk) {
    files.folder = files.tree->isFolder("mav0") ? "mav0" : "";
    return files;
  }
  std::vector<std::string> found;
  findIn(*files.tree, {}, kAround, found);
  if (found.empty()) {
    throw InputError(path, 0, "", "holds no folder with imu0 and cam0",
                     "Give an archive of a EuRoC/ASL folder");
  }
  if (found.size() > 1) {
    throw InputError(path, 0, "", fmt::format("holds {} logs: {}, ...", found.size(), found.front()),
                     "Unpack it and give one of them");
  }
  files.folder = found.front();
  return files;
}

bool isAslFolder(const std::string& path) {
  if (!std::filesystem::is_directory(path)) return false;
  const AslFiles files = findAslFiles(path);
  return files.tree->isFolder(files.at("imu0")) || files.tree->isFolder(files.at("cam0"));
}

std::unique_ptr<LogSource> openAslFolder(const std::string& path, const LogOptions& options) {
  return std::make_unique<AslFolder>(findAslFiles(path), options);
}

}  // namespace swiftlet
