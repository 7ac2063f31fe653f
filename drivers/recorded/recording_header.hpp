#pragma once
// The first record of every recording: the configuration of the recorded run. Doubles are restored bit for
// bit.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/device/byte_fields.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

enum class RecordOrder : std::uint8_t {
  /// Several threads fed the estimator: a reader merges the streams by arrival (at equal times IMU, camera 0,
  /// camera 1); each stream keeps its own order.
  kByArrival = 0,
  /// One thread fed it and wrote the records in this order: the order in the file is used.
  kAsWritten = 1,
};

struct RecordingHeader {
  Rig rig;
  ImuNoise noise;
  std::string calibration_form;  ///< Calibration::form of the log or device
  std::string settings;          ///< the settings in force, as YAML text
  std::string program_version;
  RecordOrder order = RecordOrder::kByArrival;
  /// Camera and extrinsics of the sensor whose depth images the map used (its image is empty); none: no
  /// sensor.
  std::optional<DepthImageView> depth_sensor;
};

/// A camera and its extrinsics, in kCameraBytes.
inline constexpr std::size_t kCameraBytes = 3 * 4 + 8 * 8 + 7 * 8;
void encodeCamera(LittleFieldWriter& to, const CameraModel& camera, const SE3& T_body_cam);
/// False if the data are not a valid camera.
bool decodeCamera(LittleFieldReader& from, CameraModel& camera, SE3& T_body_cam);

/// The payload of the first record.
std::vector<std::uint8_t> encodeRecordingHeader(const RecordingHeader& header);

/// Null if the header is valid, otherwise the name of the invalid field (a literal).
const char* decodeRecordingHeader(std::span<const std::uint8_t> payload, RecordingHeader& header);

}  // namespace swiftlet
