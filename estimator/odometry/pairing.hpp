#pragma once
// Joins the frames of two cameras that belong to the same instant into one StereoFrame.
//
// Frames come in one by one, in the order in which they arrived; at most one pair (or single) goes
// out for each. Rules, each counted:
//  - Two frames of different cameras pair when their stamps differ by at most the tolerance, or by a
//    quarter of the camera's own frame interval where that is less (a pair must not be ambiguous).
//    The pair's stamp is camera 0's.
//  - A frame whose partner does not come goes out alone: when a later frame shows that the partner
//    is missing, or when `patience` has passed on the stamps of other messages (`expire`).
//  - A camera missing in kLostAfter frames running counts as lost: the other's frames then go out at
//    once, or with the next message's stamp where one was waiting already. Its first frame that comes
//    back restores the waiting.
//  - A frame not later than what went out already is refused: repeated, reversed, or too late. If it is
//    earlier by more than kFarAhead (stamp_guard.hpp), what was stamped far ahead is forgotten instead.
// With `cameras` = 1, camera 0 passes through and the other camera's frames are ignored.
//
// Images are borrowed. Between two calls at most one image is held (`holdsImage`): it must stay valid
// until a call gives it out or refuses to hold it any longer, and images in `paired` until their
// reader has done. A source with kPairingSlots image slots that are given back by handle is enough.
//
// No allocation, no clock; a call costs O(1). Deterministic in the order of the calls.

#include <array>
#include <cstdint>

#include "estimator/core/status.hpp"
#include "estimator/messages/frames.hpp"

namespace swiftlet {

/// One image waiting, two in the frame that a reader works on.
inline constexpr std::size_t kPairingSlots = 3;

struct PairingSettings {
  std::size_t cameras = 2;
  Duration tolerance = {2'500'000};  ///< largest difference of stamps within a pair
  /// Longest wait for a partner, on stamps. Exposure, readout and transfer delay an image by 10 to
  /// 40 ms against the IMU samples whose stamps measure this wait.
  Duration patience = {50'000'000};
};

struct PairingCounters {
  std::uint64_t pairs = 0;
  std::array<std::uint64_t, kMaxCameras> unpaired{};  ///< frames of this camera that went out alone
  std::array<std::uint64_t, kMaxCameras> refused{};   ///< repeated, reversed, late or empty frames
};

class Pairing {
 public:
  explicit Pairing(const PairingSettings& settings) : settings_(settings) {}

  /// kOk: `paired` was filled. kNotReady: the frame waits for its partner, or is not wanted.
  /// kInvalidInput: the frame was refused and counted.
  Status push(const CameraFrame& frame, StereoFrame& paired);

  /// Gives out a waiting frame whose partner is overdue at `now`, the newest stamp seen on any
  /// message. kNotReady otherwise.
  Status expire(Stamp now, StereoFrame& paired);

  /// The IMU's stamps went back for good (stamp_guard.hpp): forgets what was before, also a frame that waits.
  void restart();

  /// At the end of the input: gives out the frame that still waits, if any.
  Status flush(StereoFrame& paired);

  [[nodiscard]] bool holdsImage() const { return waiting_; }
  /// Stamp of the frame that waits; meaningful while holdsImage().
  [[nodiscard]] Stamp waitingStamp() const { return pending_.stamp; }
  [[nodiscard]] bool isLost(std::size_t camera) const { return missing_running_[camera] >= kLostAfter; }
  [[nodiscard]] const PairingCounters& counters() const { return counters_; }

 private:
  /// Two misses happen to a sound camera on a busy bus; three running are a fault.
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
  Stamp last_given_;  ///< newest stamp of any image that went out
  std::array<bool, kMaxCameras> any_seen_{};
  std::array<Stamp, kMaxCameras> last_seen_{};
  std::array<int, kMaxCameras> missing_running_{};
};

}  // namespace swiftlet
