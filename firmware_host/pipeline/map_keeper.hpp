#pragma once
// Keeps keyframes and IMU of a run for full smoothing after it, in a file: a flight's memory does not grow
// with its length. The file has no name (it is unlinked as it is opened), so nothing is left behind.
//
// Memory: a fixed buffer of kBufferBytes. Disk: some 10 kB a keyframe at 300 features and 200 Hz.
// Errors: InputError when the file cannot be made; a write that fails ends the keeping, counted as a fault,
// and the map covers what was kept before.

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/smoother/full_smoother.hpp"
#include "firmware_host/pipeline/fault_counts.hpp"

namespace swiftlet {

struct MapPose {
  Stamp stamp;
  SE3 T_world_body;
};

class MapKeeper {
 public:
  /// The file is made in `folder`.
  MapKeeper(const std::string& folder, const Rig& rig, const ImuNoise& noise,
            const OdometrySettings& settings);

  /// Every sample, in order; those that the odometry refuses are left out here too.
  void addImu(const ImuSample& sample);
  void addKeyframe(const TrackedFrame& frame, const NavState& state);

  /// After the run, before solve(): a loop between two of the keyframes.
  void addRevisit(const LoopRevisit& revisit) { revisits_.push_back(revisit); }
  Status solve(FullSmootherReport& report, std::vector<MapPose>& poses);
  [[nodiscard]] const FaultCounts& faults() const { return faults_; }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{256} * 1024;

  template <typename T>
  void put(const T& value);
  template <typename T>
  bool get(T& value);
  bool readKeyframe(TrackedFrame& frame, NavState& state);

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  Rig rig_;
  ImuNoise noise_;
  double pixel_sigma_;
  SampleMonitor monitor_;
  std::vector<char> buffer_;
  std::unique_ptr<std::FILE, Close> file_;
  bool failed_ = false;
  std::vector<LoopRevisit> revisits_;
  FaultCounts faults_;
};

}  // namespace swiftlet
