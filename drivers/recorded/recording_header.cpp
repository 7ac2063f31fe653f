#include "drivers/recorded/recording_header.hpp"

#include "drivers/device/byte_fields.hpp"
#include "drivers/image/image_decoder.hpp"

namespace swiftlet {
namespace {

// Everything except texts, with margin.
constexpr std::size_t kFixedPartBytes = 1024;
// Flag in the word of the order: the readout of the cameras follows the clock shift. Programs that do not
// know rolling shutters refuse such a recording.
constexpr std::uint32_t kRolls = 2;
constexpr Duration kMaxReadout = Duration::fromMilliseconds(1000);

void put(LittleFieldWriter& to, const std::string& text) {
  to.u32(static_cast<std::uint32_t>(text.size()));
  to.copy({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void put(LittleFieldWriter& to, const SE3& T) {
  for (int i = 0; i < 4; ++i) to.f64(T.rotation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) to.f64(T.translation[i]);
}

void put(LittleFieldWriter& to, const DepthImageView& sensor) {
  const PinholeIntrinsics& camera = sensor.camera;
  to.i32(camera.width);
  to.i32(camera.height);
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) to.f64(value);
  put(to, sensor.T_body_camera);
}

void put(LittleFieldWriter& to, const ImuNoise& noise) {
  for (const double value : {noise.gyro_density, noise.accel_density, noise.gyro_walk, noise.accel_walk,
                             noise.rate_hz, noise.gravity, noise.gyro_saturation, noise.accel_saturation}) {
    to.f64(value);
  }
}

bool get(LittleFieldReader& from, std::string& text) {
  const std::span<const std::uint8_t> bytes = from.bytes(from.u32());
  text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return from.ok();
}

bool saneSize(int width, int height) {
  return width > 0 && height > 0 && width <= kMaxImageSide && height <= kMaxImageSide;
}

bool get(LittleFieldReader& from, SE3& T) {
  // Not through SE3's constructor, which would normalize and so change bits.
  for (int i = 0; i < 4; ++i) T.rotation.coeffs()[i] = from.f64();
  for (int i = 0; i < 3; ++i) T.translation[i] = from.f64();
  return T.rotation.coeffs().allFinite() && T.translation.allFinite();
}

bool get(LittleFieldReader& from, DepthImageView& sensor) {
  PinholeIntrinsics& camera = sensor.camera;
  camera.width = from.i32();
  camera.height = from.i32();
  Eigen::Vector4d intrinsics;
  for (int i = 0; i < 4; ++i) intrinsics[i] = from.f64();
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  const bool placed = get(from, sensor.T_body_camera);
  return from.ok() && saneSize(camera.width, camera.height) && intrinsics.allFinite() && camera.fx > 0 &&
         camera.fy > 0 && placed;
}

bool get(LittleFieldReader& from, ImuNoise& noise) {
  for (double* value : {&noise.gyro_density, &noise.accel_density, &noise.gyro_walk, &noise.accel_walk,
                        &noise.rate_hz, &noise.gravity, &noise.gyro_saturation, &noise.accel_saturation}) {
    *value = from.f64();
  }
  return from.ok();
}

}  // namespace

void encodeCamera(LittleFieldWriter& to, const CameraModel& camera, const SE3& T_body_cam) {
  to.u32(camera.kind() == CameraKind::kPinholeRadtan ? 0U : 1U);
  to.i32(camera.width());
  to.i32(camera.height());
  for (int i = 0; i < 4; ++i) to.f64(camera.intrinsics()[i]);
  for (int i = 0; i < 4; ++i) to.f64(camera.distortion()[i]);
  put(to, T_body_cam);
}

bool decodeCamera(LittleFieldReader& from, CameraModel& camera, SE3& T_body_cam) {
  const std::uint32_t kind = from.u32();
  const std::int32_t width = from.i32();
  const std::int32_t height = from.i32();
  Eigen::Vector4d intrinsics;
  Eigen::Vector4d distortion;
  for (int i = 0; i < 4; ++i) intrinsics[i] = from.f64();
  for (int i = 0; i < 4; ++i) distortion[i] = from.f64();
  const bool placed = get(from, T_body_cam);
  const bool sane = from.ok() && kind <= 1 && saneSize(width, height) && intrinsics.allFinite() &&
                    intrinsics[0] > 0 && intrinsics[1] > 0 && distortion.allFinite() && placed;
  if (!sane) return false;
  camera = CameraModel(kind == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant, width, height,
                       intrinsics, distortion);
  return true;
}

std::vector<std::uint8_t> encodeRecordingHeader(const RecordingHeader& header) {
  std::vector<std::uint8_t> payload(kFixedPartBytes + header.calibration_form.size() +
                                    header.settings.size() + header.program_version.size());
  LittleFieldWriter to(payload);
  to.u32(static_cast<std::uint32_t>(header.order) | (header.rig.rolls() ? kRolls : 0));
  to.u32(static_cast<std::uint32_t>(header.rig.camera_count));
  for (std::size_t i = 0; i < header.rig.camera_count; ++i) {
    encodeCamera(to, header.rig.camera[i], header.rig.T_body_cam[i]);
  }
  to.i64(header.rig.camera_to_imu_shift.ns);
  if (header.rig.rolls()) to.i64(header.rig.readout.ns);
  put(to, header.noise);
  put(to, header.calibration_form);
  put(to, header.settings);
  put(to, header.program_version);
  // Written only if present: other recordings stay readable by programs that do not know this field.
  if (header.depth_sensor) put(to, *header.depth_sensor);
  payload.resize(to.written().size());
  return payload;
}

const char* decodeRecordingHeader(std::span<const std::uint8_t> payload, RecordingHeader& header) {
  LittleFieldReader from(payload);
  const std::uint32_t order = from.u32();
  if ((order & ~kRolls) > 1) return "order";
  header.order = static_cast<RecordOrder>(order & ~kRolls);
  header.rig = {};
  header.rig.camera_count = from.u32();
  if (header.rig.camera_count > kMaxCameras) return "number of cameras";
  for (std::size_t i = 0; i < header.rig.camera_count; ++i) {
    if (!decodeCamera(from, header.rig.camera[i], header.rig.T_body_cam[i])) return "camera";
  }
  header.rig.camera_to_imu_shift.ns = from.i64();
  if ((order & kRolls) != 0) {
    header.rig.readout.ns = from.i64();
    if (header.rig.readout.ns <= 0 || header.rig.readout > kMaxReadout) return "readout";
  }
  if (!get(from, header.noise)) return "IMU noise";
  if (!get(from, header.calibration_form)) return "calibration form";
  if (!get(from, header.settings)) return "settings";
  if (!get(from, header.program_version)) return "program version";
  header.depth_sensor.reset();
  if (from.left() > 0 && !get(from, header.depth_sensor.emplace())) return "depth sensor";
  return from.left() == 0 ? nullptr : "length";
}

}  // namespace swiftlet
