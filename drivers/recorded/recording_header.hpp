#pragma once
// What a recorded run was made with: the first record of every recording. Every double comes back with
// the bits that it had.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

class LittleEndianReader;
class LittleEndianWriter;

enum class RecordOrder : std::uint8_t {
  /// Several threads fed the estimator: a reader merges the streams by arrival (ties: IMU, camera 0,
  /// camera 1), each stream kept in its own order.
  kByArrival = 0,
  /// One thread fed it and wrote the records as they entered: their order in the file is the order.
  kAsWritten = 1,
};

struct RecordingHeader {
  Rig rig;
  ImuNoise noise;
  std::string calibration_form;  ///< Calibration::form of the log or device
  std::string settings;          ///< the settings in force, as YAML text
  std::string program_version;
  RecordOrder order = RecordOrder::kByArrival;
  /// Camera and extrinsics of the sensor whose depth images the map used (without an image); none: no sensor.
  std::optional<DepthImageView> depth_sensor;
};

/// A camera and its place on the body, in kCameraBytes.
inline constexpr std::size_t kCameraBytes = 3 * 4 + 8 * 8 + 7 * 8;
void encodeCamera(LittleEndianWriter& to, const CameraModel& camera, const SE3& T_body_cam);
/// False if it is none.
bool decodeCamera(LittleEndianReader& from, CameraModel& camera, SE3& T_body_cam);

/// The payload of the first record.
std::vector<std::uint8_t> encodeRecordingHeader(const RecordingHeader& header);

/// Null if it was read, otherwise the name of the invalid field, literal text.
const char* decodeRecordingHeader(std::span<const std::uint8_t> payload, RecordingHeader& header);

}  // namespace swiftlet
