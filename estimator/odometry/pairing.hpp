#pragma once
// Joins the frames of two cameras of the same instant into one StereoFrame.
//
// Frames are added one by one in the order of arrival; each call outputs at most one pair or single frame.
// Rules, each counted:
//  - Two frames of different cameras pair if their stamps differ by at most the tolerance, or by a quarter of
//    the camera's frame interval if that is less, so that pairs are unambiguous. The pair has the stamp of
//    camera 0.
//  - A frame without partner is output alone: when a later frame shows that the partner is missing, or when
//    `patience` has passed on the stamps of other messages (`expire`).
//  - A camera that misses kLostAfter consecutive frames counts as lost. Frames of the other camera are then
//    output at once; one that waits already is output with the next message's stamp. The first frame of the
//    lost camera restores the waiting.
//  - A frame not later than the last output is refused: repeated, reversed, or too late. If it is earlier by
//    more than kFarAhead (stamp_guard.hpp), the frames stamped far ahead are forgotten instead.
// With `cameras` = 1, camera 0 passes through and frames of the other camera are ignored.
//
// Images are borrowed. Between two calls at most one image is held (`holdsImage`); it must stay valid until a
// call outputs or drops it, and images in `paired` until their reader has finished. A source with
// kPairingSlots image slots that are returned by handle is sufficient.
//
// No allocation, no clock; O(1) per call. Deterministic in the order of the calls.

#include <array>
#include <cstdint>

#include "estimator/core/status.hpp"
#include "estimator/messages/frames.hpp"

namespace swiftlet {

/// One waiting image, and two in the frame that a reader works on.
inline constexpr std::size_t kPairingSlots = 3;

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

  /// kOk: `paired` was filled. kNotReady: the frame waits for its partner or is ignored. kInvalidInput: the
  /// frame was refused and counted.
  Status push(const CameraFrame& frame, StereoFrame& paired);

  /// Outputs a waiting frame whose partner is overdue at `now`, the newest stamp of any message. Otherwise
  /// kNotReady.
  Status expire(Stamp now, StereoFrame& paired);

  /// Call if the IMU's stamps went back permanently (stamp_guard.hpp): forgets earlier stamps and a waiting
  /// frame.
  void restart();

  /// At the end of the input: outputs the frame that still waits, if any.
  Status flush(StereoFrame& paired);

  [[nodiscard]] bool holdsImage() const { return waiting_; }
  /// Stamp of the waiting frame; valid while holdsImage().
  [[nodiscard]] Stamp waitingStamp() const { return pending_.stamp; }
  [[nodiscard]] bool isLost(std::size_t camera) const { return missing_running_[camera] >= kLostAfter; }
  [[nodiscard]] const PairingCounters& counters() const { return counters_; }

 private:
  /// A working camera on a busy bus may miss two frames; three consecutive ones are a fault.
  static constexpr int kLostAfter = 3;

  [[nodiscard]] Status refuse(std::size_t camera, const char* why);
  [[nodiscard]] Duration toleranceFor(const CameraFrame& frame) const;
  Status giveSingle(const CameraFrame& frame, StereoFrame& paired);
  Status givePair(const CameraFrame& a, const CameraFrame& b, StereoFrame& paired);
  void forgetAheadOf(const CameraFrame& frame);
  Status waitOrGive(const CameraFrame& frame, StereoFrame& paired);

  PairingSettings settings_;
  PairingCounters counters_;
  CameraFrame pending_;
  bool waiting_ = false;
  std::uint64_t next_index_ = 0;
  bool any_given_ = false;
  Stamp last_given_;  ///< newest stamp of any image output
  std::array<bool, kMaxCameras> any_seen_{};
  std::array<Stamp, kMaxCameras> last_seen_{};
  std::array<int, kMaxCameras> missing_running_{};
};

}  // namespace swiftlet
