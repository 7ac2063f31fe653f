#pragma once
// Finds the trigger edge of each frame of one camera.
//
// The driver numbers frames, EdgeTrain numbers pulses. The two numbers differ by a constant as long as
// neither slips. Over the first frames D = frame stamp - edge is averaged for an assumed constant. Another
// constant changes D by whole periods, so the right one is that whose mean D is nearest to the expected lag.
// From then on frames are matched by count and verified by their stamp, which must be within half a period
// (less if stamps scatter less) of edge + lag. After three failures in a row the association is given up and
// searched again.
//
// No edge is better than a wrong edge. A frame gets none while locking (kNotReady), when no edge is near
// (kNotReady), when its stamp contradicts the count or it arrives more than 2 ms before its edge
// (kInvalidInput), and when the mean lag is more than 0.3 periods from the expected one, since the next edge
// is then too near (kDegenerate). Use the driver's stamp for such frames. Valid for frame stamps that scatter
// by up to 0.4 periods around their lag. The lag follows a changing exposure.
//
// Read edges before frames. Cost: O(1). Memory: 1 KiB, no allocation. Accepts any stamps without overflow.

#include <cstdint>
#include <optional>

#include "drivers/timesync/delay_histogram.hpp"
#include "drivers/timesync/edge_train.hpp"
#include "drivers/timesync/timesync_status.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

/// A frame as its driver gives it.
struct FrameMark {
  Stamp stamp;
  std::uint32_t sequence = 0;  ///< +1 per frame, gaps for dropped frames; wraps at 2^32, can restart
  Stamp arrival;
};

struct TriggerMatch {
  std::int64_t pulse = 0;  ///< EdgeTrain's number in `epoch`; equal for cameras with the same exposure
  std::uint32_t epoch = 0;
  Stamp edge;
  bool measured = false;  ///< false: the edge was missed, its stamp is computed from its neighbours
};

class TriggerMatcher {
 public:
  /// `train` must outlive the matcher; both cameras of a pair use the same one. `expected_lag`: time from the
  /// edge to the frame's stamp, within 0.3 periods of the truth. It is the trigger's latency for stamps at
  /// the start of exposure, plus exposure and readout for stamps at the end of the frame. If it is not known,
  /// frames cannot be matched.
  TriggerMatcher(const EdgeTrain& train, Duration expected_lag) : train_(&train), expected_(expected_lag) {}

  Status match(const FrameMark& frame, TriggerMatch& out);

  /// Time from an edge to the frame's stamp, as measured while locked; empty if unknown.
  [[nodiscard]] std::optional<Duration> lag() const;
  [[nodiscard]] LockState lock() const { return lock_; }
  [[nodiscard]] TimesyncStatus status() const;

 private:
  Status collect(const FrameMark& frame, TriggerMatch& out);
  bool decide();
  void begin(const FrameMark& frame);
  void giveUp();
  [[nodiscard]] double verified(double period) const;

  const EdgeTrain* train_;
  Duration expected_;
  LockState lock_ = LockState::kUnlocked;
  std::uint32_t epoch_ = 0;
  std::uint32_t sequence_ = 0;  ///< of the newest frame
  std::int64_t pulse_ = 0;      ///< its pulse; while locking up to an unknown constant
  double lag_ = 0;              ///< [ns]
  double spread_ = 0;           ///< [ns] largest |D - lag| of a matched frame
  bool lag_known_ = false;      ///< from the current or an earlier association
  int disputes_ = 0;
  int edgeless_ = 0;  ///< frames in a row with no edge near
  // While locking.
  int count_ = 0;
  double sum_ = 0, least_ = 0, most_ = 0;  ///< of D [ns]
  double soonest_ = 0;                     ///< [ns] smallest time from an edge to the arrival of its frame
  DelayHistogram residuals_;
  std::uint64_t matched_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t unmatched_ = 0;
};

}  // namespace swiftlet
