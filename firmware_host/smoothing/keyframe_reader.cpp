#include "firmware_host/smoothing/keyframe_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/input/stamp_range.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "drivers/recorded/recording_header.hpp"

namespace swiftlet {
namespace {

using namespace keyframe_file;  // NOLINT(google-build-using-namespace)

constexpr const char* kRemedy = "Give the folder of a run with smoother.horizon: full";
constexpr double kLargestSigma = 1000;   // px; the setting allows 10, and a flight raises it up to 15 times
constexpr double kLargestFactor = 1000;  // flights reach 30
constexpr double kLargestGyroMatrix = 1;
/// Calibrations with a shift above 1 s are refused.
constexpr Duration kMostShift = Duration::fromSeconds(10);

bool sane(Duration shift) { return shift <= kMostShift && shift >= -kMostShift; }

bool sane(Stamp stamp) { return isStampInRange(stamp.ns); }

Eigen::Vector3d getVector(LittleFieldReader& from) {
  Eigen::Vector3d vector;
  for (int i = 0; i < 3; ++i) vector[i] = from.f64();
  return vector;
}

bool getPose(LittleFieldReader& from, SE3& pose) {
  // Bypasses SE3's constructor, which would normalize and change bits.
  for (int i = 0; i < 4; ++i) pose.rotation.coeffs()[i] = from.f64();
  pose.translation = getVector(from);
  constexpr double kUnit = 1e-6;
  return pose.translation.allFinite() && std::abs(pose.rotation.norm() - 1) < kUnit;
}

bool getFeature(LittleFieldReader& from, TrackId& id, std::array<bool, kMaxCameras>& seen,
                std::array<Eigen::Vector2f, kMaxCameras>& pixel) {
  id = from.u64();
  bool sane = true;
  for (bool& by : seen) {
    const std::uint8_t value = from.u8();
    sane = sane && value <= 1;
    by = value == 1;
  }
  (void)from.u16();
  for (Eigen::Vector2f& at : pixel) {
    for (int i = 0; i < 2; ++i) at[i] = from.f32();
    sane = sane && at.allFinite();
  }
  return sane;
}

}  // namespace

KeyframeReader::KeyframeReader(std::string name, std::istream& in)
    : name_(std::move(name)), in_(in), bytes_(std::max(kMostHead, kRecordBytes + kMostPayload)) {
  const auto refuse = [this](const char* what, const char* remedy) {
    throw InputError(name_, 0, "", what, remedy);
  };
  if (read(bytes_.data(), kPrefixBytes) < kPrefixBytes ||
      !std::equal(kMagic.begin(), kMagic.end(), bytes_.begin())) {
    refuse("is not a file of keyframes: it does not start with their magic bytes", kRemedy);
  }
  LittleFieldReader prefix({bytes_.data() + kMagic.size(), kPrefixBytes - kMagic.size()});
  const std::uint32_t version = prefix.u32();
  if (version != kVersion) {
    throw InputError(name_, 0, "version", fmt::format("is {}, this program reads {}", version, kVersion),
                     "Use the program that made the run; its summary.json names it");
  }
  const std::size_t length = prefix.u32();
  constexpr const char* kDamaged = "the head is damaged or truncated";
  constexpr const char* kLost = "Nothing can be smoothed without it; if this is a copy, copy the file again";
  if (length < kCrcBytes || length > kMostHead - kPrefixBytes ||
      read(bytes_.data() + kPrefixBytes, length) < length) {
    refuse(kDamaged, kLost);
  }
  const std::size_t covered = kPrefixBytes + length - kCrcBytes;
  head_crc_ = crc32c(0, {bytes_.data(), covered});
  if (LittleFieldReader({bytes_.data() + covered, kCrcBytes}).u32() != head_crc_) refuse(kDamaged, kLost);
  RecordingHeader calibration;
  const char* wrong =
      decodeRecordingHeader({bytes_.data() + kPrefixBytes, covered - kPrefixBytes}, calibration);
  if (wrong == nullptr && calibration.rig.camera_count == 0) wrong = "number of cameras";
  if (wrong == nullptr && !sane(calibration.rig.camera_to_imu_shift)) wrong = "clock shift";
  const ImuNoise& noise = calibration.noise;
  if (wrong == nullptr && !(noise.gyro_density > 0 && noise.accel_density > 0 && noise.gyro_walk > 0 &&
                            noise.accel_walk > 0 && noise.rate_hz > 0)) {
    wrong = "IMU noise";
  }
  if (wrong != nullptr) throw InputError(name_, 0, wrong, "out of range", kLost);
  rig_ = calibration.rig;
  noise_ = calibration.noise;
  at_ = kPrefixBytes + length;
}

std::size_t KeyframeReader::read(std::uint8_t* to, std::size_t bytes) {
  in_.read(reinterpret_cast<char*>(to), static_cast<std::streamsize>(bytes));
  return static_cast<std::size_t>(in_.gcount());
}

KeyframeReader::Next KeyframeReader::endAt(const char* what) {
  cut_ = fmt::format("{} at byte {}", what, at_);
  ended_ = true;
  return Next::kEnd;
}

KeyframeReader::Next KeyframeReader::next() {
  if (ended_) return Next::kEnd;
  const std::size_t got = read(bytes_.data(), kRecordBytes);
  if (got < kRecordBytes) return endAt(got == 0 ? "not closed properly, truncated" : "truncated");
  LittleFieldReader from({bytes_.data(), kRecordBytes});
  const std::uint32_t stated = from.u32();
  const std::uint16_t kind = from.u16();
  const std::uint16_t zero = from.u16();
  payload_ = from.u32();
  if (zero != 0 || payload_ > kMostPayload) return endAt("damaged");
  if (read(bytes_.data() + kRecordBytes, payload_) < payload_) return endAt("truncated");
  const std::size_t covered = kRecordBytes - kCrcBytes + payload_;
  if (crc32c(head_crc_, {bytes_.data() + kCrcBytes, covered}) != stated) return endAt("damaged");
  Next next = Next::kEnd;
  bool good = false;
  switch (static_cast<Kind>(kind)) {
    case Kind::kImu:
      good = decodeSample();
      next = Next::kSample;
      break;
    case Kind::kKeyframe:
      good = decodeKeyframe();
      next = Next::kKeyframe;
      break;
    case Kind::kRevisit:
      good = decodeRevisit();
      next = Next::kRevisit;
      break;
    case Kind::kCalibration:
      good = decodeCalibration();
      next = Next::kCalibration;
      break;
    case Kind::kEnd:
      good = payload_ == 0;
      break;
  }
  if (!good) return endAt("damaged");
  at_ += kRecordBytes + payload_;
  ended_ = next == Next::kEnd;
  return next;
}

bool KeyframeReader::decodeSample() {
  if (payload_ != kImuBytes) return false;
  LittleFieldReader from({bytes_.data() + kRecordBytes, payload_});
  const Stamp before = sample_.stamp;
  sample_.stamp.ns = from.i64();
  sample_.gyro = getVector(from);
  sample_.accel = getVector(from);
  const bool rises = !any_sample_ || sample_.stamp > before;
  any_sample_ = true;
  return sane(sample_.stamp) && rises && sample_.gyro.allFinite() && sample_.accel.allFinite();
}

bool KeyframeReader::decodeKeyframe() {
  LittleFieldReader from({bytes_.data() + kRecordBytes, payload_});
  const Stamp before = frame_.stamp;
  frame_.stamp.ns = from.i64();
  state_.stamp = frame_.stamp;
  state_.epoch = from.u32();
  const std::size_t features = from.u32();
  if (features > kMaxFeatures || payload_ != kStateBytes + features * kFeatureBytes) return false;
  bool good = sane(frame_.stamp) && (!any_keyframe_ || frame_.stamp > before);
  any_keyframe_ = true;
  good = getPose(from, state_.T_world_body) && good;
  state_.v_world_body = getVector(from);
  state_.bias_gyro = getVector(from);
  state_.bias_accel = getVector(from);
  good = good && state_.v_world_body.allFinite() && state_.bias_gyro.allFinite() &&
         state_.bias_accel.allFinite();
  in_use_.pixel_sigma = from.f64();
  good = in_use_.pixel_sigma > 0 && in_use_.pixel_sigma < kLargestSigma && good;
  for (double* factor : {&in_use_.imu.gyro, &in_use_.imu.accel}) {
    *factor = from.f64();
    good = *factor > 0 && *factor < kLargestFactor && good;
  }
  frame_.keyframe = true;
  frame_.features.resize(features);
  for (TrackedFeature& feature : frame_.features) {
    good = getFeature(from, feature.id, feature.seen, feature.pixel) && good;
  }
  return good;
}

bool KeyframeReader::decodeRevisit() {
  LittleFieldReader from({bytes_.data() + kRecordBytes, payload_});
  revisit_.old_stamp.ns = from.i64();
  revisit_.new_stamp.ns = from.i64();
  bool good = sane(revisit_.old_stamp) && sane(revisit_.new_stamp);
  good = getPose(from, revisit_.T_old_new) && good;
  for (int i = 0; i < revisit_.information.size(); ++i) revisit_.information.data()[i] = from.f64();
  const std::size_t matches = from.u32();
  if (matches > kMostMatches || payload_ != kRevisitHeadBytes + matches * kMatchBytes) return false;
  revisit_.matches.resize(matches);
  for (RevisitMatch& match : revisit_.matches) {
    for (RevisitFeature* feature : {&match.old_feature, &match.new_feature}) {
      const std::uint32_t has_track = from.u32();
      feature->has_track = has_track == 1;
      good = has_track <= 1 && getFeature(from, feature->track, feature->seen, feature->pixel) && good;
    }
  }
  return good && from.ok() && revisit_.information.allFinite();
}

bool KeyframeReader::decodeCalibration() {
  const bool with_readout = rig_.rolls();
  if (payload_ != kCalibrationBytes + (with_readout ? kReadoutBytes : 0)) return false;
  LittleFieldReader from({bytes_.data() + kRecordBytes, payload_});
  calibration_.camera_to_imu_shift.ns = from.i64();
  bool good = sane(calibration_.camera_to_imu_shift);
  for (SE3& T : calibration_.T_body_cam) good = getPose(from, T) && good;
  for (double& entry : calibration_.gyro.matrix.reshaped<Eigen::RowMajor>()) entry = from.f64();
  calibration_.readout.ns = with_readout ? from.i64() : 0;
  good = sane(calibration_.readout) && good;
  return good && calibration_.gyro.matrix.allFinite() && calibration_.gyro.matrix.norm() < kLargestGyroMatrix;
}

}  // namespace swiftlet
