#pragma once
// Writes keyframes and IMU samples of a run to `keyframes.swk` in the run folder (docs/formats.md), for full
// smoothing after the run. So a flight's memory does not grow with its length, and `swiftlet smooth` can run
// later.
//
// Each keyframe is handed to the operating system as it comes, so a killed program loses at most the newest.
// Memory: a fixed buffer of kBufferBytes. Disk: some 10 kB per keyframe at 300 features and 200 Hz. Errors:
// InputError if the file cannot be created. A failed write ends the file and is reported to `lost`; the file
// keeps what was written before.

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "firmware_host/files/lost_files.hpp"
#include "firmware_host/smoothing/keyframe_format.hpp"

namespace swiftlet {

inline constexpr const char* kKeyframeFile = "keyframes.swk";

class MapKeeper {
 public:
  /// Creates the file in `folder`, replacing an older one. `lost` outlives this object.
  MapKeeper(const std::string& folder, const Rig& rig, const ImuNoise& noise,
            const OdometrySettings& settings, LostFiles& lost);

  /// Every sample, in order. Samples that the odometry refuses are omitted here too.
  void addImu(const ImuSample& sample);
  /// The stamps went backwards permanently: discards the kept keyframes; the map then covers only what
  /// follows.
  void restart();
  void addKeyframe(const TrackedFrame& frame, const NavState& state, const NoiseInUse& noise);
  /// Call before the keyframe that it was estimated with. Does nothing unless the settings request an
  /// estimate.
  void addCalibration(const CalibrationEstimate& calibration);
  /// After the run: a loop between two of the keyframes.
  void addRevisit(const LoopRevisit& revisit);
  /// Marks the end and writes the file to the disk. Whatever comes later is ignored.
  void finish();

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{256} * 1024;

  void writeHead(const Rig& rig, const ImuNoise& noise);
  void writeRecord(keyframe_file::Kind kind, std::size_t payload);
  void check(bool written);

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  bool calibration_estimated_;
  bool rolls_;  ///< the shutter; calibrations are written with their readout
  LostFiles& lost_;
  SampleMonitor monitor_;
  std::vector<char> buffer_;
  std::vector<std::uint8_t> record_;
  std::unique_ptr<std::FILE, Close> file_;  ///< null: failed or finished
  std::uint32_t head_crc_ = 0;
  long head_bytes_ = 0;  // type of fseek's offset
};

}  // namespace swiftlet
