#pragma once
// Joins the frames of two cameras of the same instant into one StereoFrame.
//
// Frames are added one by one in the order of arrival and output in the order of their stamps. Each call
// outputs at most one pair or single frame; call `expire` until it returns kNotReady. Rules, each counted:
//  - Two frames of different cameras pair if their stamps differ by at most the tolerance, or by a quarter of
//    the camera's frame interval if that is less, so that pairs are unambiguous. The pair has the stamp of
//    camera 0.
//  - A frame without partner is output alone when a later frame of the other camera shows that the partner is
//    missing, when `patience` has passed on the stamps of later messages, or when kPairingFrames wait behind
//    it. A later frame of the same camera shows nothing, because the other camera's may take longer than a
//    frame interval.
//  - A camera that misses kLostAfter consecutive frames counts as lost. Frames of the other camera are then
//    output at once. The first frame of the lost camera restores the waiting.
//  - A frame not later than the last output is refused: repeated, reversed, or too late. If it is earlier by
//    more than kFarAhead (stamp_guard.hpp), the frames stamped far ahead are forgotten instead.
// With `cameras` = 1, camera 0 passes through and frames of the other camera are ignored.
//
// Images are borrowed. Between two calls at most kPairingFrames images of a camera are held (`holdsImage`);
// they must stay valid until a call outputs or drops them, and images in `paired` until their reader has
// finished.
//
// No allocation, no clock; O(1) per call. Deterministic in the order of the calls.

#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/frames.hpp"

namespace swiftlet {

/// Largest number of waiting frames. The other camera's frame may arrive less than this many intervals later:
/// 20 ms at 200 Hz.
inline constexpr std::size_t kPairingFrames = 4;

struct PairingSettings {
  std::size_t cameras = 2;
  Duration tolerance = {2'500'000};  ///< largest difference of stamps within a pair
  /// Longest wait for a partner, measured on stamps. Exposure, readout and transfer delay an image by 10 to
  /// 40 ms relative to the IMU samples whose stamps measure this wait.
  Duration patience = {50'000'000};
};

struct PairingCounters {
  std::uint64_t pairs = 0;
  std::array<std::uint64_t, kMaxCameras> unpaired{};  ///< frames of this camera output alone
  std::array<std::uint64_t, kMaxCameras> refused{};   ///< repeated, reversed, late or empty frames
};

class Pairing {
 public:
  explicit Pairing(const PairingSettings& settings) : settings_(settings) {}

  /// kOk: `paired` was filled, with this frame or an earlier one. kNotReady: frames wait for their partners
  /// or the frame is ignored. kInvalidInput: the frame was refused and counted.
  Status push(const CameraFrame& frame, StereoFrame& paired);

  /// Outputs the oldest frame that waits if it is complete or its partner is missing or overdue at `now`, the
  /// newest stamp of any message. Otherwise kNotReady.
  Status expire(Stamp now, StereoFrame& paired);

  /// Call if the IMU's stamps went back permanently (stamp_guard.hpp): forgets earlier stamps and waiting
  /// frames.
  void restart();

  /// At the end of the input: outputs the oldest frame that still waits, if any.
  Status flush(StereoFrame& paired);

  [[nodiscard]] bool holdsImage() const { return !waiting_.empty(); }
  /// Stamp of the oldest waiting frame; valid while holdsImage().
  [[nodiscard]] Stamp waitingStamp() const { return waiting_.front().frame.stamp; }
  [[nodiscard]] bool isLost(std::size_t camera) const { return missing_running_[camera] >= kLostAfter; }
  [[nodiscard]] const PairingCounters& counters() const { return counters_; }

 private:
  /// A working camera on a busy bus may miss two frames; three consecutive ones are a fault.
  static constexpr int kLostAfter = 3;

  struct Waiting {
    StereoFrame frame;
    Stamp newest;  ///< of its images
  };

  [[nodiscard]] Status refuse(std::size_t camera, const char* why);
  [[nodiscard]] Duration toleranceFor(const CameraFrame& frame) const;
  void join(const CameraFrame& frame, Duration tolerance);
  [[nodiscard]] bool ready(const Waiting& waiting) const;
  Status give(StereoFrame& paired);
  Status giveReady(StereoFrame& paired);
  void forgetAheadOf(const CameraFrame& frame);

  PairingSettings settings_;
  PairingCounters counters_;
  FixedVector<Waiting, kPairingFrames + 1> waiting_;  ///< by stamp; full only within a call
  Stamp now_;                                         ///< of the last message
  std::uint64_t next_index_ = 0;
  bool any_given_ = false;
  Stamp last_given_;  ///< newest stamp of any image output
  std::array<bool, kMaxCameras> any_seen_{};
  std::array<Stamp, kMaxCameras> last_seen_{};
  std::array<int, kMaxCameras> missing_running_{};
};

}  // namespace swiftlet
