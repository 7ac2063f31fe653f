#pragma once
// Which edge of the trigger made which frame of one camera.
//
// The driver numbers frames, EdgeTrain numbers pulses: the two differ by a constant as long as neither slips.
// Over a first stretch of frames, D = frame stamp - edge is averaged for an assumed constant; as another
// constant changes D by whole periods, the one whose mean D is nearest to the expected lag is right. From
// then on frames are associated by count, and each is verified by its stamp: within half a period
// (less where stamps scatter less) of edge + lag, or it gets no edge. Three in a row that fail end the
// association, and it is sought again.
//
// A wrong edge is worse than none. There is none (kInvalidInput; use the driver's stamp) while locking; for
// frames whose stamp contradicts the count; for an edge later than the frame's arrival; when the mean lag is
// farther than 0.3 periods from the expected one, and so too near to the next edge to tell. Sound for frame
// stamps that scatter by up to 0.4 periods around their lag. The lag follows a changing exposure.
//
// Read edges before frames. Cost: O(1). Memory: 1 KiB. Nothing allocated; any stamps, nothing overflows.

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
  std::uint32_t sequence = 0;  ///< +1 a frame, gaps where frames were dropped; wraps at 2^32, restarts
  Stamp arrival;
};

struct TriggerMatch {
  std::int64_t pulse = 0;  ///< EdgeTrain's number, in `epoch`: equal for the cameras of one exposure
  std::uint32_t epoch = 0;
  Stamp edge;
  bool measured = false;  ///< false: the edge was missed, its stamp is computed from its neighbours
};

class TriggerMatcher {
 public:
  /// `train` outlives the matcher; both cameras of a pair take the same. `expected_lag`: from the edge to the
  /// frame's stamp, right to 0.3 periods: for stamps at the start of exposure the trigger's latency, at the
  /// end of the frame exposure and readout more. Where it is not known, frames cannot be matched.
  TriggerMatcher(const EdgeTrain& train, Duration expected_lag) : train_(&train), expected_(expected_lag) {}

  Status match(const FrameMark& frame, TriggerMatch& out);

  /// From an edge to the frame's stamp, as measured while locked; empty: not known, or not any more.
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
  std::int64_t pulse_ = 0;      ///< its pulse; while locking: up to a constant
  double lag_ = 0;              ///< [ns]
  double spread_ = 0;           ///< [ns] largest |D - lag| of a frame that was matched
  bool lag_known_ = false;      ///< from an association before
  int disputes_ = 0;
  int edgeless_ = 0;  ///< frames in a row without an edge near
  // While locking.
  int count_ = 0;
  double sum_ = 0, least_ = 0, most_ = 0;  ///< of D [ns]
  double soonest_ = 0;                     ///< [ns] least from an edge to the arrival of its frame
  DelayHistogram residuals_;
  std::uint64_t matched_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t unmatched_ = 0;
};

}  // namespace swiftlet
