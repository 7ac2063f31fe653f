#pragma once
// Turns changes between frames into events and holds events until an output takes them.
//
// An output has room for 32 events. Further ones are counted, and the last entry is then kCapacityReached
// with their number. No other memory; O(1) per frame.

#include <array>

#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/health_monitor.hpp"

namespace swiftlet {

class EventBuffer {
 public:
  void raise(Stamp stamp, EventKind kind, double value);
  /// Moves the events to `output`.
  void flush(OdometryOutput& output);
  /// All events of a kind become one event with the stamp of the first and the sum of their values.
  void merge(EventKind kind);

 private:
  FixedVector<Event, 32> events_;
  int lost_ = 0;
};

class EventWatch {
 public:
  /// Starts a new epoch. The states of cameras, rest and darkness are kept.
  void reset();

  struct Frame {
    Stamp stamp;
    std::array<bool, kMaxCameras> camera_present{};
    std::size_t cameras = 1;  ///< of the rig
    bool at_rest = false;
    Health health = Health::kInitializing;
    Doubt doubt = Doubt::kSettling;
    double seconds_without_image = 0;
    double good_age = HealthMonitor::kGoodAge;  ///< HealthMonitor::goodAge()
  };
  void step(const Frame& frame, EventBuffer& events);
  /// The part of `step` for blackouts, for a frame that begins an epoch because of one.
  void watchBlackout(Stamp stamp, double seconds_without_image, EventBuffer& events);

 private:
  void watchDoubt(const Frame& frame, EventBuffer& events);
  void watchCameras(const Frame& frame, EventBuffer& events);

  /// A busy bus may lose one image; three consecutive ones are a fault (as in Pairing).
  static constexpr int kLostAfter = 3;
  bool any_ = false;
  Stamp first_;  ///< first frame of the epoch
  bool initialized_ = false;
  bool at_rest_ = false;
  bool dark_ = false;
  Stamp dark_since_;
  double good_age_ = HealthMonitor::kGoodAge;  ///< of the last frame
  Health health_ = Health::kInitializing;
  Doubt doubt_ = Doubt::kNone;  ///< last doubt reported
  Stamp doubt_told_;
  std::array<int, kMaxCameras> missing_{};
};

}  // namespace swiftlet
