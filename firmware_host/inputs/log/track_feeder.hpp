#pragma once
// Converts feature tracks from a file to the front-end's output: selects keyframes if the file does not mark
// them, and computes the median motion since the previous frame.
//
// Keyframe rule (the front-end's, on raw pixels): the first frame; then, after at least 0.14 s, when less
// than 0.7 of the last keyframe's tracks are left or their median motion exceeds 20 px (rotation is not
// compensated here, so the threshold is higher); at the latest after 1 s.

#include <map>

#include "drivers/recorded/track_file.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

class TrackFeeder {
 public:
  /// Null: there is no file, and no frame is ever due.
  explicit TrackFeeder(TrackReader* reader);

  /// The next frame if its stamp is earlier than `stamp`; valid until take().
  const TrackedFrame* dueBefore(Stamp stamp);
  void take() { ready_ = false; }

 private:
  using Pixels = std::map<TrackId, Eigen::Vector2f>;  ///< in camera 0, or in camera 1 if camera 0 has none

  bool read();
  void chooseKeyframe(const Pixels& now);

  TrackReader* reader_;
  TrackedFrame frame_;
  bool ready_ = false;
  Pixels keyframe_;
  Stamp keyframe_stamp_;
};

}  // namespace swiftlet
