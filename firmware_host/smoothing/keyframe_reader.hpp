#pragma once
// Reads keyframes.swk back (map_keeper.hpp writes it, docs/formats.md has the layout).
//
// Host side, one thread. Memory: one record. A file that is cut off or damaged after its head ends at its
// last intact record; cut() says where. InputError for other files, other versions and a damaged head.

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "firmware_host/smoothing/keyframe_format.hpp"

namespace swiftlet {

class KeyframeReader {
 public:
  /// Reads the head. `name` is used in messages; `in` outlives this object.
  KeyframeReader(std::string name, std::istream& in);

  [[nodiscard]] const Rig& rig() const { return rig_; }           ///< the cameras in use
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }  ///< before the flight's estimates

  enum class Next { kSample, kKeyframe, kRevisit, kCalibration, kEnd };
  /// Reads the next record and returns its kind; the accessor of that kind holds it until the next call.
  Next next();
  [[nodiscard]] const ImuSample& sample() const { return sample_; }
  [[nodiscard]] const TrackedFrame& frame() const { return frame_; }
  [[nodiscard]] const NavState& state() const { return state_; }          ///< at frame()
  [[nodiscard]] const NoiseInUse& noiseInUse() const { return in_use_; }  ///< at frame()
  [[nodiscard]] const LoopRevisit& revisit() const { return revisit_; }
  /// The estimate that is in use from the next keyframe on.
  [[nodiscard]] const CalibrationEstimate& calibration() const { return calibration_; }

  /// After kEnd: where the file was cut off or damaged, as text; empty: it is complete.
  [[nodiscard]] const std::string& cut() const { return cut_; }

 private:
  std::size_t read(std::uint8_t* to, std::size_t bytes);
  Next endAt(const char* what);
  bool decodeSample();
  bool decodeKeyframe();
  bool decodeRevisit();
  bool decodeCalibration();

  std::string name_;
  std::istream& in_;
  std::vector<std::uint8_t> bytes_;
  std::size_t payload_ = 0;
  std::uint64_t at_ = 0;  ///< end of the last intact record, in bytes from the file's beginning
  std::uint32_t head_crc_ = 0;
  Rig rig_;
  ImuNoise noise_;
  ImuSample sample_;
  TrackedFrame frame_;
  NavState state_;
  NoiseInUse in_use_;
  LoopRevisit revisit_;
  CalibrationEstimate calibration_;
  std::string cut_;
  bool ended_ = false;
  bool any_sample_ = false;
  bool any_keyframe_ = false;
};

}  // namespace swiftlet
