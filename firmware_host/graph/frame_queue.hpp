#pragma once
// Where images wait for `track`: borrowed from their slots, paired, the oldest frame first.
//
// Policy: of frames that wait (kWaitingFrames) the oldest goes with its images, counted. A frame waits for
// the samples up to its stamp, not longer than GraphOptions::sample_patience after its arrival. Images of a
// time line that has ended (estimator/odometry/stamp_guard.hpp) are refused. Threads: `track`'s, but
// awaitedSampleCame, which the IMU's calls.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/node.hpp"

namespace swiftlet {

class SensorNode;

class FrameQueue {
 public:
  FrameQueue(Node& track, const GraphContext& context, const SensorNode& sensors);

  std::array<ImageIn, kMaxCameras> images;

  /// An image that pairing refused.
  struct Refusal {
    Status status;
    Stamp stamp;
  };
  /// Takes what has arrived; `refused(Refusal)` for each image that pairing does not take.
  template <typename Refused>
  void takeArrivals(Refused&& refused) {
    // Before the images: a sample that is seen now came before every image taken below.
    const Stamp newest_sample = newestSample();
    while (std::optional<Refusal> refusal = takeArrivals(newest_sample)) refused(*refusal);
  }
  /// The frame that is next; null when there is none.
  [[nodiscard]] const StereoFrame* front() const {
    return told_ ? &*told_ : waiting_.empty() ? nullptr : &waiting_.front();
  }
  /// Of the front frame's image that came last.
  [[nodiscard]] HostTimes hostTimes() const;
  /// Whether samples up to the front frame's stamp, on the IMU's clock, are still expected. A sample less
  /// than one period before it is its last.
  [[nodiscard]] bool awaitsSamples();
  /// Host time since when the front frame could have been worked on: its arrival, or the end of the last wait
  /// for samples, which less effort would not have made shorter.
  [[nodiscard]] double readySince() const;
  /// Frames that wait behind the one in work, but for those that came while it waited for its samples.
  [[nodiscard]] int backlog() const;
  /// Gives the front frame's images back, and those before them.
  void pop();
  /// The same for a frame that was not taken; counted.
  void drop();
  /// The input has ended: frames waiting for a partner are queued alone. False: none waited.
  bool flush();

  /// Called by the IMU's thread after its sample: `track` may continue.
  [[nodiscard]] bool awaitedSampleCame() const;

  struct Counters {
    std::uint64_t dropped = 0;          ///< frames that went by while others were in work
    std::uint64_t without_samples = 0;  ///< frames processed although their samples had not arrived
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] const PairingCounters& pairing() const { return pairing_.counters(); }

  /// Recorded schedule: the frame that is next, in place of what arrives.
  void tell(const StereoFrame& frame) { told_ = frame; }

 private:
  /// Images in order: those of frames that wait or are in work, and the one not yet given to pairing.
  struct Held {
    std::array<ImagePool::Loan, kTrackQuota> image;
    std::size_t count = 0;
    bool has_head = false;  ///< the last was not yet given to pairing

    [[nodiscard]] const CameraFrame& head() const { return image[count - 1]->frame; }
  };

  [[nodiscard]] Stamp newestSample() const;
  std::optional<Refusal> takeArrivals(Stamp newest_sample);
  bool takeHead(std::size_t camera);
  Status pair(const CameraFrame& image);
  void push(const StereoFrame& frame);
  /// Frames that wait, that in work included.
  [[nodiscard]] int size() const { return static_cast<int>(waiting_.size() + images[0].size()); }
  void release(const StereoFrame& frame);

  const SensorNode& sensors_;
  std::size_t cameras_;
  Duration sample_patience_;
  Duration last_sample_;  ///< from a frame's stamp to the earliest that its last sample can have
  Pairing pairing_;
  std::uint32_t timeline_ = 0;  ///< of the newest image that went to pairing
  std::array<Held, kMaxCameras> held_;
  StereoFrame paired_;
  FixedVector<StereoFrame, kWaitingFrames> waiting_;
  std::optional<StereoFrame> told_;
  /// `track` may continue once the newest sample has arrived; the latest possible stamp while it does not
  /// wait.
  std::atomic<std::int64_t> awaited_imu_{std::numeric_limits<std::int64_t>::max()};
  double wait_ended_ = 0;  ///< host time of the end of the last wait for samples [s]
  int excused_ = 0;        ///< frames still here of those that had come by then
  Counters counters_;
};

}  // namespace swiftlet
