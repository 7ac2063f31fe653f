#pragma once
// The IMU that belongs to a video: GoPro's, out of the file's own metadata, or a phone logger's JSON lines.
//
// GoPro counts its samples and gives no stamps: a line along the counts at the begins of the payloads,
// which have times, dates each sample. Phone loggers (Spectacular AI's, AaltoVision's jsonl-recorder) write a
// JSON object a line: {"time": s, "sensor": {"type": "gyroscope" or "accelerometer", "values": [x, y, z]}},
// and for each image {"time": s, "frames": [{"cameraInd": 0}, ...]}. In both, gyro and accelerometer have
// stamps of their own: the accelerometer is interpolated to the gyro's. Errors: InputError.

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/limits.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/lab/import/video_file.hpp"

namespace swiftlet {

/// Stamps: `zero` is the file's time zero. `name` names the file in messages.
std::vector<ImuSample> goproImu(const std::string& name, const std::vector<MetadataPacket>& packets,
                                Stamp zero);

struct PhoneLog {
  std::vector<ImuSample> samples;
  std::array<std::vector<Stamp>, kMaxCameras> images;  ///< of each video's pictures, in their order
};
PhoneLog readPhoneLog(const std::string& name, std::string_view text);

}  // namespace swiftlet
