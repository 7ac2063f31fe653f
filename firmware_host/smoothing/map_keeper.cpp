#include "firmware_host/smoothing/map_keeper.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <span>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "drivers/recorded/recording_header.hpp"
#include "estimator/odometry/odometry_inputs.hpp"

namespace swiftlet {
namespace {

using namespace keyframe_file;  // NOLINT(google-build-using-namespace)

void put(LittleFieldWriter& to, const Eigen::Vector3d& vector) {
  for (int i = 0; i < 3; ++i) to.f64(vector[i]);
}

void put(LittleFieldWriter& to, const SE3& pose) {
  for (int i = 0; i < 4; ++i) to.f64(pose.rotation.coeffs()[i]);
  put(to, pose.translation);
}

void put(LittleFieldWriter& to, TrackId id, const std::array<bool, kMaxCameras>& seen,
         const std::array<Eigen::Vector2f, kMaxCameras>& pixel) {
  to.u64(id);
  for (const bool by : seen) to.u8(by ? 1 : 0);
  to.u16(0);
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    // Pixels of unseen features are written as 0, so that equal runs give equal bytes.
    for (int i = 0; i < 2; ++i) to.f32(seen[c] ? pixel[c][i] : 0.0F);
  }
}

}  // namespace

MapKeeper::MapKeeper(const std::string& folder, const Rig& rig, const ImuNoise& noise,
                     const OdometrySettings& settings, LostFiles& lost)
    : path_(folder + "/" + kKeyframeFile),
      calibration_estimated_(settings.estimate_time_offset || settings.estimate_extrinsics ||
                             settings.estimate_gyro),
      rolls_(rig.rolls()),
      lost_(lost),
      monitor_(noise),
      buffer_(kBufferBytes),
      record_(kRecordBytes + kMostPayload),
      file_(std::fopen(path_.c_str(), "wbe")) {
  if (!file_) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Give a writable folder with --out, or --set smoother.horizon=30");
  }
  std::setvbuf(file_.get(), buffer_.data(), _IOFBF, buffer_.size());
  writeHead(rigInUse(rig, settings), inflatedNoise(noise, settings));
}

void MapKeeper::writeHead(const Rig& rig, const ImuNoise& noise) {
  RecordingHeader calibration;
  calibration.rig = rig;
  calibration.noise = noise;
  const std::vector<std::uint8_t> encoded = encodeRecordingHeader(calibration);
  const std::size_t length = encoded.size() + kCrcBytes;
  LittleFieldWriter to(record_);
  to.copy(kMagic);
  to.u32(kVersion);
  to.u32(static_cast<std::uint32_t>(length));
  to.copy(encoded);
  head_crc_ = crc32c(0, to.written());
  to.u32(head_crc_);
  head_bytes_ = static_cast<long>(to.written().size());
  check(std::fwrite(record_.data(), 1, to.written().size(), file_.get()) == to.written().size() &&
        std::fflush(file_.get()) == 0);
}

void MapKeeper::check(bool written) {
  if (written) return;
  lost_.add(path_ + ": cannot be written: " + std::strerror(errno) + "; the file ends here");
  file_.reset();
}

void MapKeeper::writeRecord(Kind kind, std::size_t payload) {
  LittleFieldWriter to(record_);
  to.u32(0);
  to.u16(static_cast<std::uint16_t>(kind));
  to.u16(0);
  to.u32(static_cast<std::uint32_t>(payload));
  const std::size_t size = kRecordBytes + payload;
  const std::uint32_t crc = crc32c(head_crc_, {record_.data() + kCrcBytes, size - kCrcBytes});
  LittleFieldWriter(record_).u32(crc);
  const bool flush = kind != Kind::kImu && kind != Kind::kCalibration;
  check(std::fwrite(record_.data(), 1, size, file_.get()) == size &&
        (!flush || std::fflush(file_.get()) == 0));
}

void MapKeeper::restart() {
  monitor_.restart();
  if (!file_) return;
  // fseek also writes out the buffer.
  check(std::fseek(file_.get(), head_bytes_, SEEK_SET) == 0 &&
        ::ftruncate(::fileno(file_.get()), head_bytes_) == 0);
}

void MapKeeper::addImu(const ImuSample& sample) {
  if (!monitor_.check(sample).status.ok() || !file_) return;
  LittleFieldWriter to{std::span(record_).subspan(kRecordBytes)};
  to.i64(sample.stamp.ns);
  put(to, sample.gyro);
  put(to, sample.accel);
  writeRecord(Kind::kImu, to.written().size());
}

void MapKeeper::addKeyframe(const TrackedFrame& frame, const NavState& state, const NoiseInUse& noise) {
  if (!file_) return;
  LittleFieldWriter to{std::span(record_).subspan(kRecordBytes)};
  to.i64(frame.stamp.ns);
  to.u32(state.epoch);
  to.u32(static_cast<std::uint32_t>(frame.features.size()));
  put(to, state.T_world_body);
  put(to, state.v_world_body);
  put(to, state.bias_gyro);
  put(to, state.bias_accel);
  for (const double figure : {noise.pixel_sigma, noise.imu.gyro, noise.imu.accel}) to.f64(figure);
  for (const TrackedFeature& feature : frame.features) put(to, feature.id, feature.seen, feature.pixel);
  writeRecord(Kind::kKeyframe, to.written().size());
}

void MapKeeper::addCalibration(const CalibrationEstimate& calibration) {
  if (!file_ || !calibration_estimated_) return;
  LittleFieldWriter to{std::span(record_).subspan(kRecordBytes)};
  to.i64(calibration.camera_to_imu_shift.ns);
  for (const SE3& T : calibration.T_body_cam) put(to, T);
  for (const double entry : calibration.gyro.matrix.reshaped<Eigen::RowMajor>()) to.f64(entry);
  if (rolls_) to.i64(calibration.readout.ns);
  writeRecord(Kind::kCalibration, to.written().size());
}

void MapKeeper::addRevisit(const LoopRevisit& revisit) {
  if (!file_) return;
  const std::size_t matches = std::min(revisit.matches.size(), kMostMatches);
  LittleFieldWriter to{std::span(record_).subspan(kRecordBytes)};
  to.i64(revisit.old_stamp.ns);
  to.i64(revisit.new_stamp.ns);
  put(to, revisit.T_old_new);
  for (int i = 0; i < revisit.information.size(); ++i) to.f64(revisit.information.data()[i]);
  to.u32(static_cast<std::uint32_t>(matches));
  for (std::size_t i = 0; i < matches; ++i) {
    for (const RevisitFeature* feature : {&revisit.matches[i].old_feature, &revisit.matches[i].new_feature}) {
      to.u32(feature->has_track ? 1 : 0);
      put(to, feature->track, feature->seen, feature->pixel);
    }
  }
  writeRecord(Kind::kRevisit, to.written().size());
}

void MapKeeper::finish() {
  if (!file_) return;
  writeRecord(Kind::kEnd, 0);
  if (!file_) return;
  check(::fsync(::fileno(file_.get())) == 0);
  file_.reset();
}

}  // namespace swiftlet
