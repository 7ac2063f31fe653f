#pragma once
// The IMU data of a video: from GoPro's metadata in the file, or from a phone logger's JSON lines.
//
// GoPro counts its samples and gives no stamps: each sample is dated by a line through the counts at the
// starts of the payloads, which have times. Phone loggers (Spectacular AI's, AaltoVision's jsonl-recorder)
// write one JSON object per line: {"time": s, "sensor": {"type": "gyroscope" or "accelerometer", "values":
// [x, y, z]}}, and for each image {"time": s, "frames": [{"cameraInd": 0}, ...]}. In both, gyro and
// accelerometer have separate stamps: the accelerometer is interpolated to the gyro's. Errors: InputError.

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/limits.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/lab/import/video_file.hpp"

namespace swiftlet {

/// `zero`: stamp of the file's time zero. `name`: the file's name in messages.
std::vector<ImuSample> goproImu(const std::string& name, const std::vector<MetadataPacket>& packets,
                                Stamp zero);

struct PhoneLog {
  std::vector<ImuSample> samples;
  std::array<std::vector<Stamp>, kMaxCameras> images;  ///< of each video's images, in order
};
PhoneLog readPhoneLog(const std::string& name, std::string_view text);

}  // namespace swiftlet
