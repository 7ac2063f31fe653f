#pragma once
// Reads keyframes.swk back (map_keeper.hpp writes it, docs/formats.md has the layout).
//
// Host side, of one thread. Memory: one record. A file that was cut off, or is damaged behind its head, ends
// at its last sound record and cut() says where. InputError for what is no such file, one of another version
// and a damaged head.

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
  /// Reads the head. `name` is for messages; `in` outlives this.
  KeyframeReader(std::string name, std::istream& in);

  [[nodiscard]] const Rig& rig() const { return rig_; }           ///< the cameras in use
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }  ///< as in flight, before what it showed

  enum class Next { kSample, kKeyframe, kRevisit, kCalibration, kEnd };
  /// What the next record is; it is then in the accessor of that name until the next call.
  Next next();
  [[nodiscard]] const ImuSample& sample() const { return sample_; }
  [[nodiscard]] const TrackedFrame& frame() const { return frame_; }
  [[nodiscard]] const NavState& state() const { return state_; }          ///< of frame()
  [[nodiscard]] const NoiseInUse& noiseInUse() const { return in_use_; }  ///< likewise
  [[nodiscard]] const LoopRevisit& revisit() const { return revisit_; }
  /// The estimate that was in use from the next keyframe on.
  [[nodiscard]] const CalibrationEstimate& calibration() const { return calibration_; }

  /// After kEnd: in words, where the file was cut off or is damaged; empty: it ends in order.
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
  std::uint64_t at_ = 0;  ///< byte of the file behind the last sound record
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
