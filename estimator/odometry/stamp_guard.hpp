#pragma once
// Filter for wrong stamps at the input. A single sample or image stamped far ahead would otherwise silence
// its stream until time catches up with it.
//
// IMU (StampGuard): a stamp far ahead of the newest is held back until the next sample confirms that the
// stream continues there. Stamps that do not ascend pass as kBehind, and the stages refuse them. If
// consecutive ones ascend among themselves for kAgreeSeconds, the stream has gone back permanently, and a new
// time line begins. Samples of two time lines are never combined: stages restart between them. Images
// (ImageGuard): the IMU is the reference. An image far from its camera's newest, or any image after a jump of
// the IMU's stream, passes only if its stamp is near the IMU's newest.
//
// Regular streams pass unchanged, including gaps up to kFarAhead; a longer silence of the IMU costs one
// sample. No clock, no memory beyond the object; depends only on the stamps given. Cost: some ns.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class StampVerdict : std::uint8_t {
  kPass,
  kJumped,     ///< passes: the stream continues far ahead
  kRestarted,  ///< passes: the stream continues at earlier stamps, on a new time line
  kBehind,     ///< not later than the newest: passes, and the stages refuse and count it
  kHeld,       ///< does not pass
};

/// Smallest step of a stamp that counts as far ahead: longer than the period of the slowest camera (1 s) with
/// its jitter. A stamp with a smaller error silences its stream for at most this long.
inline constexpr Duration kFarAhead{1'500'000'000};
/// Whether `to` is later than `from` by more than kFarAhead; for any two stamps.
[[nodiscard]] bool isFarAhead(Stamp from, Stamp to);

/// State of the IMU's stream, for the guards of cameras.
struct ImuTime {
  bool any = false;            ///< a sample has passed
  Stamp newest;                ///< newest stamp that passed
  std::uint32_t timeline = 0;  ///< incremented each time the stream goes back
  std::uint32_t jumps = 0;     ///< confirmed steps far ahead
};

/// Detects runs of refused stamps that ascend among themselves, which begin a new time line.
class BackwardRun {
 public:
  /// True if the run is long enough with `stamp`, which is not later than the stream's newest.
  bool note(Stamp stamp, int needed);
  void clear() { length_ = 0; }

 private:
  int length_ = 0;
  Stamp last_;
};

class StampGuard {
 public:
  explicit StampGuard(double rate_hz);

  StampVerdict check(Stamp stamp);

  [[nodiscard]] const ImuTime& time() const { return time_; }
  [[nodiscard]] std::uint32_t timeline() const { return time_.timeline; }

 private:
  /// Longer than any burst of reordered samples, and short compared with the time that a flight survives
  /// without an IMU.
  static constexpr double kAgreeSeconds = 0.15;
  static constexpr int kLeastAgreeing = 10;  ///< if the rate is unknown or low

  int needed_;
  ImuTime time_;
  bool holds_ = false;
  Stamp held_;
  BackwardRun back_;
};

class ImageGuard {
 public:
  /// kHeld: on another time line than the IMU.
  StampVerdict check(Stamp stamp, const ImuTime& imu);

 private:
  static constexpr int kAgreeing = 4;  ///< 0.2 s at 20 Hz

  bool any_ = false;
  Stamp newest_;
  bool fits_ = false;  ///< was near the IMU's newest since its stream last jumped
  ImuTime seen_;       ///< the IMU's time line and jumps when last looked at
  BackwardRun back_;
};

}  // namespace swiftlet
