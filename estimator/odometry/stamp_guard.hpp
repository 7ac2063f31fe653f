#pragma once
// The gate for stamps in front of everything that goes by time: one sample or image stamped far ahead would
// silence its stream until time catches up with it.
//
// IMU (StampGuard): a stamp far ahead of the newest is held out until the next sample confirms that the
// stream goes on there. Stamps that do not rise pass as kBehind, for the stages to refuse; when so many of
// them in a row that they last kAgreeSeconds rise among themselves, the stream has gone back for good, and a
// new time line begins. Samples of two time lines never go together: stages restart between them. Images
// (ImageGuard): the IMU is the reference. An image far from its camera's newest, or any image after the
// IMU's stream has jumped, passes only if its stamp is near the IMU's newest.
//
// Regular streams pass untouched, gaps up to kFarAhead included; a longer silence of the IMU costs one
// sample. No clock, no memory beyond the object; a pure function of the stamps that it was given. Cost: some
// ns.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class StampVerdict : std::uint8_t {
  kPass,
  kJumped,     ///< passes: the stream goes on far ahead
  kRestarted,  ///< passes: the stream goes on at earlier stamps, on a new time line
  kBehind,     ///< not later than the newest: passes for the stages to refuse and count
  kHeld,       ///< does not pass
};

/// A step ahead that is no regular one: longer than the slowest camera's period (1 s) with its jitter. A
/// stamp that is wrong by less silences its stream for no longer than this.
inline constexpr Duration kFarAhead{1'500'000'000};
/// Whether `to` is later than `from` by more than kFarAhead; for any two stamps.
[[nodiscard]] bool isFarAhead(Stamp from, Stamp to);

/// What a camera's guard needs to know of the IMU's stream.
struct ImuTime {
  bool any = false;            ///< a sample has passed
  Stamp newest;                ///< of those that passed
  std::uint32_t timeline = 0;  ///< raised each time that the stream goes back
  std::uint32_t jumps = 0;     ///< confirmed steps far ahead
};

/// So many refusals in a row, rising among themselves, begin a new time line.
class BackwardRun {
 public:
  /// True when the run is long enough with `stamp`, which is not later than the stream's newest.
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
  /// Longer than any burst of samples out of order, short against what a flight without an IMU survives.
  static constexpr double kAgreeSeconds = 0.15;
  static constexpr int kLeastAgreeing = 10;  ///< where the rate is unknown or low

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
  bool fits_ = false;  ///< has been near the IMU's newest since its stream last jumped
  ImuTime seen_;       ///< the IMU's time line and jumps when last looked at
  BackwardRun back_;
};

}  // namespace swiftlet
