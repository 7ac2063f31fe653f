#pragma once
// Propagation at IMU rate from the smoother's newest state.
//
// Keeps the newest NavState, moves it over every sample after its stamp, and outputs the state at each
// sample's stamp with its 15x15 covariance (phi, p, v, bg, ba; bias walks included). A fixed ring keeps the
// last samples, so that a new state of the smoother, which is some frames old, is propagated to the present
// at once. Samples, holes and saturated readings are treated as in Preintegration::integrate(samples, from,
// to). A gap (more than 10 periods without a sample) is not integrated: attitude and velocity are held, and
// their covariance grows (integration_rule.hpp). Frames: those of NavState (world with z up, body). Units:
// SI. Errors: kNotReady before the first state (the sample is kept, because the first state is late).
// kInvalidInput for a sample not later than the last one or not finite (dropped), and for a state that is not
// finite. kCapacityReached for a state so old that the ring no longer holds the samples after it (the hole is
// bridged). Memory: 1024 samples, 60 kB; no allocation. Cost: about 2 us per sample, covariance and output
// included.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/integration_rule.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

class Propagator {
 public:
  explicit Propagator(const ImuNoise& noise) : noise_(noise) {}

  /// Takes a smoothed state and the intrinsics estimated together with its biases, and re-applies the samples
  /// after its stamp. A state later than the last sample is kept; the next sample starts from it.
  Status setState(const NavState& state, const GyroIntrinsics& intrinsics = {});

  /// Takes one sample. Writes the state at its stamp to `state`, which may be null.
  Status step(const ImuSample& sample, NavState* state = nullptr);

  /// The predicted state at `at`, for an image; nothing is stored. After the last sample its reading is held;
  /// before it the prediction starts from the last state set. kInvalidInput if `at` is before that state.
  Status predict(Stamp at, NavState& state) const;

  [[nodiscard]] bool hasState() const { return has_state_; }
  /// The newest state, at the later of the last sample's stamp and that of `setState`.
  [[nodiscard]] NavState state() const { return current_.toNavState(); }
  /// Seconds bridged without samples since the stamp of the last state set.
  [[nodiscard]] double gapSeconds() const { return current_.gap_seconds; }

  /// Noise for the following samples, and for those re-applied after the next setState().
  void setNoise(const ImuNoise& noise) { noise_ = noise; }

  /// Forgets the state; samples are kept for the next one.
  void forgetState() { has_state_ = false; }

  /// Forgets state and samples.
  void reset();

 private:
  // The state with its rotation error in world axes (theta = R phi), which makes the transition sparse.
  struct Current {
    NavState nav;
    GyroIntrinsics intrinsics;
    double gap_seconds = 0;

    void set(const NavState& state, const GyroIntrinsics& gyro);
    [[nodiscard]] NavState toNavState() const;
    void advance(const ImuSample* before, const ImuSample* after, Stamp to, const ImuNoise& noise);
    void advanceMeasured(const ImuSegment& segment, const ImuNoise& noise);
    void advanceGap(double dt, const ImuNoise& noise);
  };
  // 5 s at 200 Hz, 1 s at 1 kHz: longer than the delay of any smoother. A longer delay is reported.
  static constexpr std::size_t kRing = 1024;

  [[nodiscard]] std::uint64_t oldestKept() const { return count_ - std::min<std::uint64_t>(count_, kRing); }
  /// Index of the first kept sample after `stamp`; count_ if there is none.
  [[nodiscard]] std::uint64_t firstAfter(Stamp stamp) const;
  /// Advances over the samples after the state, then holds the last one.
  void advance(Current& state, Stamp to) const;
  [[nodiscard]] const ImuSample& sampleAt(std::uint64_t index) const { return ring_[index % kRing]; }

  ImuNoise noise_;
  std::array<ImuSample, kRing> ring_{};
  std::uint64_t count_ = 0;  // number of samples taken; the ring holds the last kRing
  bool has_state_ = false;
  Current given_;    // as set by setState()
  Current current_;  // advanced by the samples since
};

}  // namespace swiftlet
