#include "firmware_host/lab/import/import_run.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/calibration/calibration.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/asl_text.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/lab/import/motion_of_video.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// For a video without its own clock: leaves room for the calibration's time shift.
constexpr Stamp kFirstImage{Duration::fromSeconds(1).ns};

/// Input of a log, read before anything is written.
struct Recording {
  std::vector<std::string> videos;                     ///< one per camera
  std::array<std::vector<Stamp>, kMaxCameras> stamps;  ///< of the images; empty: the file's own times
  std::vector<ImuSample> samples;
};

Recording phoneRecording(const fs::path& folder) {
  const auto files = openFolder(folder.string());
  Recording recording;
  PhoneLog log = readPhoneLog(files->name("data.jsonl"), files->text("data.jsonl"));
  recording.samples = std::move(log.samples);
  for (std::size_t camera = 0; camera < kMaxCameras; ++camera) {
    const std::string stem = camera == 0 ? "data" : fmt::format("data{}", camera + 1);
    for (const char* extension : {".mp4", ".mov", ".avi", ".mkv"}) {
      const fs::path video = folder / (stem + extension);
      if (!fs::exists(video) || recording.videos.size() != camera) continue;
      if (log.images[camera].empty()) {
        throw InputError(files->name("data.jsonl"), 0, "frames",
                         "has no times of the images of " + video.filename().string(),
                         "Record again with an app that logs `frames` lines, or give the samples as csv: "
                         "`swiftlet import VIDEO IMU.csv`");
      }
      recording.videos.push_back(video.string());
      recording.stamps[camera] = log.images[camera];
    }
  }
  if (recording.videos.empty()) {
    throw InputError(folder.string(), 0, "", "has data.jsonl but no data.mp4", "Copy the video too");
  }
  return recording;
}

Recording videoRecording(const ImportRequest& request, ImportResult& result) {
  Recording recording;
  recording.videos.push_back(request.video);
  const Stamp zero = request.first.value_or(kFirstImage);
  if (!request.imu.empty()) {
    LogCounters counters;
    LogWarnings warnings;
    recording.samples = readImuFile(request.imu, counters, warnings);
    result.warnings = warnings.lines();
    return recording;
  }
  VideoFile video(request.video);
  const std::vector<MetadataPacket> packets = video.metadata();
  if (packets.empty()) {
    throw InputError(request.video, 0, "", "has no metadata track of a GoPro",
                     "Give the IMU's samples: `swiftlet import VIDEO IMU.csv`");
  }
  recording.samples = goproImu(request.video, packets, zero);
  return recording;
}

/// The folder is filled under another name and renamed when complete.
class LogFolder {
 public:
  explicit LogFolder(const std::string& out) : out_(out), part_(out + ".part") {
    if (fs::exists(fs::path(out) / "mav0")) {
      throw InputError(out, 0, "", "already holds a log", "Give another --out, or move the log away");
    }
    std::error_code error;
    if (fs::exists(part_)) {
      throw InputError(part_.string(), 0, "", "already exists, left by an interrupted import",
                       "Remove it, or give another --out");
    }
    fs::create_directories(part_ / "mav0", error);
    if (error) {
      throw InputError(out, 0, "", "cannot be written: " + error.message(),
                       "Give an --out that this user can write to");
    }
  }
  ~LogFolder() {
    std::error_code error;
    if (!finished_) fs::remove_all(part_, error);
  }
  LogFolder(const LogFolder&) = delete;
  LogFolder& operator=(const LogFolder&) = delete;

  [[nodiscard]] fs::path sensor(const std::string& name) const {
    fs::create_directories(part_ / "mav0" / name / "data");
    return part_ / "mav0" / name;
  }
  void finish() {
    fs::create_directories(out_);
    fs::rename(part_ / "mav0", fs::path(out_) / "mav0");
    fs::remove_all(part_);
    finished_ = true;
  }

 private:
  std::string out_;
  fs::path part_;
  bool finished_ = false;
};

/// Returns the stamps of the images written.
std::vector<Stamp> writeCamera(const ImportRequest& request, const Recording& recording, std::size_t camera,
                               const fs::path& folder, ImportResult& result) {
  // The csv's clock is known at the first image; a GoPro's samples count from the file's time zero.
  const Stamp zero = request.first.value_or(kFirstImage);
  VideoFile video(recording.videos[camera]);
  const std::vector<Stamp>& given = recording.stamps[camera];
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(video.width()) *
                                 static_cast<std::size_t>(video.height()));
  std::string rows = "#timestamp [ns],filename\n";
  std::vector<Stamp> stamps;
  VideoFrame frame;
  Duration begin;
  bool more = false;  // more images than stamps
  Progress progress(fmt::format("images of camera {}", camera), video.pictures());
  for (std::size_t i = 0; video.nextFrame(frame); ++i) {
    if (frame.image.width != video.width() || frame.image.height != video.height()) {
      throw InputError(recording.videos[camera], 0, "", fmt::format("image {} has another size", i),
                       "Split the video where its size changes");
    }
    more = !given.empty() && i >= given.size();
    if (more) break;
    if (i == 0) begin = frame.time;
    const Stamp stamp = !given.empty()        ? given[i]
                        : request.imu.empty() ? zero + frame.time
                                              : zero + (frame.time - begin);
    const std::string name = std::to_string(stamp.ns) + ".png";
    packedCopy(frame.image, grey.data());
    writePng8((folder / "data" / name).string(), grey.data(), video.width(), video.height());
    rows += fmt::format("{},{}\n", stamp.ns, name);
    stamps.push_back(stamp);
    progress.update(stamps.size());
  }
  progress.finish();
  result.images += stamps.size();
  if (stamps.empty()) {
    throw InputError(recording.videos[camera], 0, "", "holds no image that can be decoded", "");
  }
  if (more || (!given.empty() && stamps.size() != given.size())) {
    result.warnings.push_back(
        fmt::format("{}: {} images, but its log has stamps for {}; they are matched from the start",
                    recording.videos[camera], more ? "more" : std::to_string(stamps.size()), given.size()));
  }
  result.damaged += video.damaged();
  writeWholeFile((folder / "data.csv").string(), rows);
  return stamps;
}

void checkSizes(const ImportRequest& request, const Rig& rig, const std::vector<std::string>& videos) {
  for (std::size_t c = 0; c < std::min(videos.size(), rig.camera_count); ++c) {
    const CameraModel& camera = rig.camera[c];
    const VideoFile video(videos[c]);
    if (camera.width() == video.width() && camera.height() == video.height()) continue;
    throw InputError(request.calibration, 0, "resolution",
                     fmt::format("camera {} has {}x{}, but {} has {}x{}", c, camera.width(), camera.height(),
                                 videos[c], video.width(), video.height()),
                     "Give the calibration for this video size");
  }
}

void checkOverlap(const ImportRequest& request, const std::vector<ImuSample>& samples,
                  const std::vector<Stamp>& images) {
  if (samples.back().stamp >= images.front() && samples.front().stamp <= images.back()) return;
  throw InputError(
      request.imu.empty() ? request.video : request.imu, 0, "timestamp",
      fmt::format(
          "the samples ({:.3f} to {:.3f} s) and the images ({:.3f} to {:.3f} s) do not overlap in time",
          Duration{samples.front().stamp.ns}.seconds(), Duration{samples.back().stamp.ns}.seconds(),
          Duration{images.front().ns}.seconds(), Duration{images.back().ns}.seconds()),
      "Set --first-image to the time of the first image on the samples' clock");
}

void writeCalibration(const Calibration& calibration, const LogFolder& folder, std::size_t cameras,
                      double rate) {
  const std::string origin = "from the calibration given to swiftlet import";
  const Rig& rig = calibration.rig;
  for (std::size_t c = 0; c < cameras; ++c) {
    const std::string times = fmt::format("timeshift_cam_imu: {:.9f}\n", rig.camera_to_imu_shift.seconds()) +
                              shutterYaml(rig.readout);
    writeWholeFile((folder.sensor(fmt::format("cam{}", c)) / "sensor.yaml").string(),
                   cameraYaml(rig.camera[c], rig.T_body_cam[c], rate, origin, times));
  }
  writeWholeFile((folder.sensor("imu0") / "sensor.yaml").string(),
                 imuYaml(calibration.noise, origin,
                         SE3(Eigen::Quaterniond(calibration.R_body_imu), Eigen::Vector3d::Zero()),
                         imuMatricesYaml(calibration)));
}

}  // namespace

ImportResult importVideo(const ImportRequest& request) {
  ImportResult result;
  std::optional<Calibration> calibration;
  if (!request.calibration.empty()) {
    calibration = readCalibration(request.calibration, request.imu_calibration);
  }
  const bool phone = fs::is_directory(request.video);
  const Recording recording = phone ? phoneRecording(request.video) : videoRecording(request, result);
  const VideoFile first(recording.videos.front());
  if (calibration) checkSizes(request, calibration->rig, recording.videos);
  LogFolder folder(request.out);
  result.cameras = recording.videos.size();
  std::vector<Stamp> images;
  for (std::size_t camera = 0; camera < result.cameras; ++camera) {
    const fs::path place = folder.sensor(fmt::format("cam{}", camera));
    const std::vector<Stamp> stamps = writeCamera(request, recording, camera, place, result);
    checkOverlap(request, recording.samples, stamps);
    if (camera == 0) images = stamps;
  }
  std::string rows = imuCsvHeader();
  for (const ImuSample& sample : recording.samples) rows += imuCsvRow(sample);
  writeWholeFile((folder.sensor("imu0") / "data.csv").string(), rows);
  result.samples = recording.samples.size();
  result.imu_hz = medianRate(recording.samples);
  result.seconds = (images.back() - images.front()).seconds();
  if (calibration) {
    const double rate =
        result.seconds > 0 ? static_cast<double>(images.size() - 1) / result.seconds : first.rate();
    calibration->noise.rate_hz = result.imu_hz;
    writeCalibration(*calibration, folder, std::min(result.cameras, calibration->rig.camera_count), rate);
  }
  folder.finish();
  return result;
}

}  // namespace swiftlet
