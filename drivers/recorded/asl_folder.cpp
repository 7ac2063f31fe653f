#include "drivers/recorded/asl_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <span>

#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "drivers/recorded/recorded_log.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// A listed image larger than this is no camera image.
constexpr std::size_t kMaxImageBytes = 256U << 20U;

fs::path dataFolder(const fs::path& path) { return fs::is_directory(path / "mav0") ? path / "mav0" : path; }

/// Reads a whole file into `bytes`, reusing its memory; false when it cannot be read.
bool readBytes(const fs::path& path, std::vector<std::uint8_t>& bytes) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  struct stat status {};
  bool good = ::fstat(file, &status) == 0 && S_ISREG(status.st_mode) &&
              static_cast<std::size_t>(status.st_size) <= kMaxImageBytes;
  bytes.resize(good ? static_cast<std::size_t>(status.st_size) : 0);
  std::size_t done = 0;
  while (good && done < bytes.size()) {
    const ssize_t got = ::read(file, bytes.data() + done, bytes.size() - done);
    good = got > 0;
    if (good) done += static_cast<std::size_t>(got);
  }
  ::close(file);
  bytes.resize(done);
  return good;
}

class AslFolder final : public RecordedLog {
 public:
  AslFolder(const std::string& path, const LogOptions& options);
  [[nodiscard]] Trajectory groundTruth() const override;
  [[nodiscard]] std::string groundTruthName() const override { return truth_file_; }
  [[nodiscard]] std::string trackFile() const override { return track_file_; }

 protected:
  Fetched fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) override;

 private:
  void readCalibrationFiles(const fs::path& given);
  void readCameras();
  void readCamera(std::uint32_t camera);
  std::vector<ImageRow> listImages(const fs::path& folder);
  [[nodiscard]] bool listsImages() const;
  [[nodiscard]] bool locate(std::uint32_t camera, ImageRow& row) const;
  void chooseTruth();

  fs::path folder_;
  std::array<std::vector<std::string>, kMaxCameras> files_;  ///< relative to camN
  std::vector<std::uint8_t> bytes_;
  ImageDecoder decoder_;
  std::string truth_file_;
  std::string track_file_;
};

AslFolder::AslFolder(const std::string& path, const LogOptions& options)
    : RecordedLog(options), folder_(dataFolder(path)) {
  const fs::path tracks = folder_ / "tracks0" / "data.csv";
  if (!options_.without_images && !listsImages() && fs::exists(tracks)) track_file_ = tracks.string();
  readCalibrationFiles(path);
  const fs::path imu = folder_ / "imu0" / "data.csv";
  if (!fs::exists(imu)) {
    throw InputError(imu.string(), 0, "", "does not exist", "A log needs IMU samples: imu0/data.csv");
  }
  samples_ = readImuFile(imu.string(), counters_, warnings_);
  if (!options_.without_images && track_file_.empty()) readCameras();
  prepare(imu.string());
  if (files_[0].size() != files_[1].size() && !files_[0].empty() && !files_[1].empty()) {
    warnings_.add(fmt::format("{}: cam0 has {} images, cam1 has {}; frames without a partner stay single",
                              folder_.string(), files_[0].size(), files_[1].size()));
  }
  chooseTruth();
}

void AslFolder::readCalibrationFiles(const fs::path& given) {
  const CalibrationOptions& how = options_.calibration_options;
  if (!options_.calibration.empty()) {
    calibration_ = readCalibration(options_.calibration, options_.imu_calibration, how);
  } else if (fs::exists(folder_ / "cam0" / "sensor.yaml")) {
    calibration_ = readCalibration(folder_.string(), {}, how);
  } else {
    // Kalibr's files beside the data: TUM-VI keeps them in dso/.
    for (const fs::path& place : {given, folder_, given / "dso", folder_ / "dso"}) {
      if (!hasCalibration(place.string())) continue;
      calibration_ = readCalibration(place.string(), options_.imu_calibration, how);
      break;
    }
    if (calibration_.rig.camera_count == 0) {
      throw InputError(
          (folder_ / "cam0" / "sensor.yaml").string(), 0, "", "does not exist",
          "A log needs a calibration: EuRoC sensor.yaml, or Kalibr's camchain and IMU YAML given "
          "explicitly");
    }
  }
  // Tracks need no folder for the second camera: they say themselves what it saw.
  const bool images = !options_.without_images && track_file_.empty();
  const bool no_second = images && !fs::is_directory(folder_ / "cam1");
  if (calibration_.rig.camera_count > 1 && (options_.mono || no_second)) {
    if (!options_.mono) warnings_.add(folder_.string() + ": no cam1, going on with one camera");
    calibration_.rig.camera_count = 1;
  }
}

bool AslFolder::listsImages() const {
  for (const char* camera : {"cam0", "cam1"}) {
    if (fs::exists(folder_ / camera / "data.csv") || fs::exists(folder_ / camera / "data")) return true;
  }
  return false;
}

void AslFolder::readCameras() {
  for (std::uint32_t camera = 0; camera < calibration_.rig.camera_count; ++camera) readCamera(camera);
  if (calibration_.rig.camera_count > 1 && files_[1].empty()) {
    warnings_.add(folder_.string() + ": cam1 has no images, going on with one camera");
    calibration_.rig.camera_count = 1;
  }
  if (images_.empty()) {
    throw InputError(folder_.string(), 0, "", "none of the listed images exists",
                     "Images are looked for in cam0/data and cam1/data, tracks in tracks0/data.csv");
  }
}

/// Finds the file of a row; the name may be missing, or without its extension.
bool AslFolder::locate(std::uint32_t camera, ImageRow& row) const {
  const fs::path folder = folder_ / fmt::format("cam{}", camera);
  const std::string stem = row.file.empty() ? std::to_string(row.stamp.ns) : row.file;
  std::error_code error;
  for (const char* extension : {"", ".png", ".jpg", ".jpeg"}) {
    if (row.file.empty() && *extension == '\0') continue;
    for (const char* place : {"data", "."}) {
      const fs::path relative = fs::path(place) / (stem + extension);
      if (fs::is_regular_file(folder / relative, error)) {
        row.file = relative.string();
        return true;
      }
    }
    if (fs::path(stem).has_extension() && *extension == '\0') break;
  }
  return false;
}

std::vector<ImageRow> AslFolder::listImages(const fs::path& folder) {
  const fs::path csv = folder / "data.csv";
  if (fs::exists(csv)) return readImageList(csv.string(), counters_, warnings_);
  std::vector<ImageRow> rows;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder / "data", error)) {
    Stamp stamp;
    if (parseInteger(entry.path().stem().string(), stamp.ns))
      rows.push_back({stamp, entry.path().filename().string()});
  }
  // A directory has no order of its own, so sorting it is not worth a warning.
  std::sort(rows.begin(), rows.end(), [](const ImageRow& a, const ImageRow& b) { return a.stamp < b.stamp; });
  orderByStamp(rows, (folder / "data").string(), counters_, warnings_);
  warnings_.add(csv.string() + ": does not exist; stamps are taken from the image names");
  return rows;
}

void AslFolder::readCamera(std::uint32_t camera) {
  const fs::path folder = folder_ / fmt::format("cam{}", camera);
  std::vector<ImageRow> rows = listImages(folder);
  std::uint64_t missing = 0;
  for (ImageRow& row : rows) {
    if (!locate(camera, row)) {
      ++missing;
      warnings_.addCounted(++counters_.missing_images,
                           fmt::format("{}: image `{}` of stamp {} is missing, skipped",
                                       (folder / "data").string(), row.file, row.stamp.ns));
      continue;
    }
    images_.push_back({row.stamp, camera, static_cast<std::uint32_t>(files_[camera].size())});
    files_[camera].push_back(row.file);
  }
  if (missing > 0 && files_[camera].empty()) {
    warnings_.add(folder.string() + ": not one listed image exists");
  }
}

RecordedLog::Fetched AslFolder::fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) {
  const fs::path path = folder_ / fmt::format("cam{}", entry.camera) / files_[entry.camera][entry.index];
  Fetched fetched;
  fetched.name = path.string();
  fetched.missing = !readBytes(path, bytes_);
  if (!fetched.missing) fetched.result = decoder_.decode(bytes_, expected, out, fetched.found);
  return fetched;
}

/// Nanoseconds of [first, last] image that the truth covers.
std::int64_t coverage(const Trajectory& truth, Stamp first, Stamp last) {
  if (truth.empty()) return 0;
  const std::int64_t overlap = (std::min(truth.back().stamp, last) - std::max(truth.front().stamp, first)).ns;
  return std::max<std::int64_t>(overlap, 0);
}

void AslFolder::chooseTruth() {
  // A truth that is better known comes first and wins a tie.
  std::vector<std::string> candidates;
  for (const char* name : {"state_groundtruth_openvins", "state_groundtruth_estimate0", "mocap0"}) {
    const fs::path file = folder_ / name / "data.csv";
    if (fs::exists(file)) candidates.push_back(file.string());
  }
  if (candidates.size() == 1) truth_file_ = candidates.front();
  if (candidates.size() <= 1) return;
  std::int64_t best = -1;
  for (const std::string& file : candidates) {
    LogCounters counters;
    LogWarnings warnings;
    try {
      const Trajectory truth = readTrajectory(file, counters, warnings);
      const std::int64_t covered = images_.empty()
                                       ? coverage(truth, samples_.front().stamp, samples_.back().stamp)
                                       : coverage(truth, images_.front().stamp, images_.back().stamp);
      if (covered <= best) continue;
      best = covered;
      truth_file_ = file;
    } catch (const InputError& error) {
      warnings_.add(std::string(error.what()) + " (truth left out)");
    }
  }
}

Trajectory AslFolder::groundTruth() const {
  if (truth_file_.empty()) return {};
  LogCounters counters;
  LogWarnings warnings;
  Trajectory truth = readTrajectory(truth_file_, counters, warnings);
  const SE3 T_filebody_body = calibration_.T_body_filebody.inverse();
  // The velocity of another point of the body would need the true rate, which the file does not have.
  const bool moved = T_filebody_body.translation.norm() > 0;
  for (TrajectoryPoint& point : truth) {
    point.T_world_body = point.T_world_body * T_filebody_body;
    point.has_motion = point.has_motion && !moved;
  }
  return truth;
}

}  // namespace

bool isAslFolder(const std::string& path) {
  const fs::path folder = dataFolder(path);
  return fs::is_directory(folder) && (fs::is_directory(folder / "imu0") || fs::is_directory(folder / "cam0"));
}

std::unique_ptr<LogSource> openAslFolder(const std::string& path, const LogOptions& options) {
  return std::make_unique<AslFolder>(path, options);
}

}  // namespace swiftlet
