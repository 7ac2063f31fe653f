#pragma once
// Keeps keyframes and IMU of a run for full smoothing after it, in `keyframes.swk` of the run folder
// (docs/formats.md): a flight's memory does not grow with its length, and `swiftlet smooth` can do it later.
//
// Each keyframe is handed to the system as it comes, so a program that is killed loses none but the newest.
// Memory: a fixed buffer of kBufferBytes. Disk: some 10 kB a keyframe at 300 features and 200 Hz.
// Errors: InputError when the file cannot be made; a write that fails ends the keeping, told to `lost`, and
// the file holds what was kept before.

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
  /// The file is made in `folder`; an older one there is replaced. `lost` outlives this.
  MapKeeper(const std::string& folder, const Rig& rig, const ImuNoise& noise,
            const OdometrySettings& settings, LostFiles& lost);

  /// Every sample, in order; those that the odometry refuses are left out here too.
  void addImu(const ImuSample& sample);
  /// The stamps went backwards permanently: kept keyframes are discarded, and the map covers what follows.
  void restart();
  void addKeyframe(const TrackedFrame& frame, const NavState& state, const NoiseInUse& noise);
  /// Before the keyframe that it was estimated with; without effect unless the settings ask for an estimate.
  void addCalibration(const CalibrationEstimate& calibration);
  /// After the run: a loop between two of the keyframes.
  void addRevisit(const LoopRevisit& revisit);
  /// Marks the end and brings the file to the disk. Whatever comes later is left out.
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
  LostFiles& lost_;
  SampleMonitor monitor_;
  std::vector<char> buffer_;
  std::vector<std::uint8_t> record_;
  std::unique_ptr<std::FILE, Close> file_;  ///< null: failed or finished
  std::uint32_t head_crc_ = 0;
  long head_bytes_ = 0;  // NOLINT(google-runtime-int): as fseek takes it
};

}  // namespace swiftlet
