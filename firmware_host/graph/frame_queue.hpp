#pragma once
// Queue of images for `track`: borrowed from their slots, paired, oldest frame first.
//
// Policy: when kWaitingFrames wait, the oldest frame is dropped with its images and counted. A frame waits
// for the samples up to its stamp, but not longer than GraphOptions::sample_patience after its arrival.
// Images of an ended time line (estimator/odometry/stamp_guard.hpp) are refused. Threads: that of `track`;
// awaitedSampleCame() is called by the IMU's.

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
  /// Takes what has arrived. Calls `refused(Refusal)` for each image that pairing refuses.
  template <typename Refused>
  void takeArrivals(Refused&& refused) {
    // Read before the images: every sample seen now arrived before any image taken below.
    const Stamp newest_sample = newestSample();
    while (std::optional<Refusal> refusal = takeArrivals(newest_sample)) refused(*refusal);
  }
  /// The next frame; null: there is none.
  [[nodiscard]] const StereoFrame* front() const {
    return told_ ? &*told_ : waiting_.empty() ? nullptr : &waiting_.front();
  }
  /// Times of the front frame's image that arrived last.
  [[nodiscard]] HostTimes hostTimes() const;
  /// Whether samples up to the front frame's stamp, on the IMU's clock, are still expected. A sample less
  /// than one period before the stamp is the frame's last one.
  [[nodiscard]] bool awaitsSamples();
  /// Host time at which the front frame could have been processed [s]: its arrival, or the end of the last
  /// wait for samples. Less effort would not have shortened that wait.
  [[nodiscard]] double readySince() const;
  /// Number of frames waiting behind the one being processed, except those that arrived while it waited for
  /// its samples.
  [[nodiscard]] int backlog() const;
  /// Removes the front frame and returns its images and older ones.
  void pop();
  /// Like pop(), for a frame that was not processed; counted.
  void drop();
  /// The input has ended: frames waiting for a partner are queued alone. False: none waited.
  bool flush();

  /// Called by the IMU's thread after its sample. True: `track` may continue.
  [[nodiscard]] bool awaitedSampleCame() const;

  struct Counters {
    std::uint64_t dropped = 0;          ///< frames dropped because earlier ones were still being processed
    std::uint64_t without_samples = 0;  ///< frames processed although their samples had not arrived
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] const PairingCounters& pairing() const { return pairing_.counters(); }

  /// Recorded schedule: sets the next frame; arrivals are ignored for it.
  void tell(const StereoFrame& frame) { told_ = frame; }

 private:
  /// Images in order: those of waiting frames and of the frame being processed, and the one not yet given to
  /// pairing.
  struct Held {
    std::array<ImagePool::Loan, kTrackQuota> image;
    std::size_t count = 0;
    bool has_head = false;  ///< the last image was not yet given to pairing

    [[nodiscard]] const CameraFrame& head() const { return image[count - 1]->frame; }
  };

  [[nodiscard]] Stamp newestSample() const;
  std::optional<Refusal> takeArrivals(Stamp newest_sample);
  bool takeHead(std::size_t camera);
  Status pair(const CameraFrame& image);
  void push(const StereoFrame& frame);
  /// Number of waiting frames, including the one being processed.
  [[nodiscard]] int size() const { return static_cast<int>(waiting_.size() + images[0].size()); }
  void release(const StereoFrame& frame);

  const SensorNode& sensors_;
  std::size_t cameras_;
  Duration sample_patience_;
  Duration last_sample_;  ///< from a frame's stamp to the earliest possible stamp of its last sample
  Pairing pairing_;
  std::uint32_t timeline_ = 0;  ///< of the newest image given to pairing
  std::array<Held, kMaxCameras> held_;
  StereoFrame paired_;
  FixedVector<StereoFrame, kWaitingFrames> waiting_;
  std::optional<StereoFrame> told_;
  /// Stamp that the newest sample must reach before `track` may continue; the largest possible stamp while
  /// `track` does not wait.
  std::atomic<std::int64_t> awaited_imu_{std::numeric_limits<std::int64_t>::max()};
  double wait_ended_ = 0;  ///< host time of the end of the last wait for samples [s]
  int excused_ = 0;        ///< frames still queued of those that had arrived by then
  Counters counters_;
};

}  // namespace swiftlet
