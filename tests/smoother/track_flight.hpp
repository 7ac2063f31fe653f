#pragma once
// A simulated flight as the back-end sees it: feature tracks, IMU samples and the truth, no images.

#include <cstddef>
#include <map>
#include <vector>

#include "drivers/simulated/simulated_flight.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet::test {

class TrackFlight {
 public:
  /// Faults of the settings are applied: in a blackout frames come without features, from a missing
  /// camera nothing comes (no frame at all when every camera is missing).
  explicit TrackFlight(const SimulationSettings& settings);

  [[nodiscard]] const SimulatedFlight& flight() const { return flight_; }
  [[nodiscard]] const Rig& rig() const { return flight_.givenRig(); }
  [[nodiscard]] const ImuNoise& noise() const { return flight_.settings().imu.noise; }
  [[nodiscard]] const std::vector<TrackedFrame>& frames() const { return frames_; }
  /// Seconds of the trajectory at which frame k was taken.
  [[nodiscard]] double seconds(std::size_t k) const { return seconds_[k]; }

  /// The true state at frame k, biases included.
  [[nodiscard]] BodyState truth(std::size_t k) const;

  /// Where the landmark of a track is [m].
  [[nodiscard]] const Eigen::Vector3d& landmark(TrackId id) const { return landmarks_.at(id); }

  /// Calls `imu(sample)` and `frame(k)` in the order in which they would arrive: samples up to and
  /// including a frame's stamp and `lead` first.
  template <typename OnImu, typename OnFrame>
  void play(const OnImu& imu, const OnFrame& frame, Duration lead = {}) const {
    std::size_t next = 0;
    const std::vector<ImuSample>& samples = flight_.imu().samples;
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      while (next < samples.size() && samples[next].stamp <= frames_[k].stamp + lead) imu(samples[next++]);
      frame(k);
    }
  }

 private:
  SimulatedFlight flight_;
  std::vector<TrackedFrame> frames_;
  std::vector<double> seconds_;
  std::map<TrackId, Eigen::Vector3d> landmarks_;
};

/// A flight in the furnished room with EuRoC's rig and IMU.
SimulationSettings roomFlight(double duration, std::uint64_t seed);

}  // namespace swiftlet::test
