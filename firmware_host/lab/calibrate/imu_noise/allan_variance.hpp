#pragma once
// Overlapping Allan variance of six signals, in one pass.
//
// sigma^2(tau) = E[(theta_k - 2 theta_{k-m} + theta_{k-2m})^2] / (2 tau^2), with theta the integral of the
// readings and tau = m periods. Octaves of m: up to 16 using every sample, above that every (m / 16)-th,
// which keeps nearly all of the information of full overlap. Units: those of the readings, squared. Memory:
// 1.6 kB per octave, whatever the length. Cost: 0.1 us per sample. Source: Riley, "Handbook of Frequency
// Stability Analysis", NIST SP 1065, 2008, section 5.2.4.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace swiftlet {

/// Gyro x y z, accelerometer x y z.
using ImuSix = Eigen::Matrix<double, 6, 1>;

struct AllanPoint {
  double tau = 0;                    ///< s
  ImuSix variance = ImuSix::Zero();  ///< readings squared
  /// Number of pairs of clusters without common samples: independent values for white noise.
  double pairs = 0;
};

class AllanVariance {
 public:
  /// `period`: s between readings.
  explicit AllanVariance(double period) : period_(period) {}

  void add(const ImuSix& reading);
  /// The next reading does not follow the previous one: no cluster spans both.
  void interrupt();
  /// Ordered by tau; octaves with at least one pair.
  [[nodiscard]] std::vector<AllanPoint> points() const;

 private:
  static constexpr std::size_t kSteps = 16;  // steps per cluster

  struct Octave {
    std::vector<ImuSix> ring = std::vector<ImuSix>(2 * kSteps + 1);
    std::uint64_t kept = 0;  // integrals since the last interruption
    struct Sum {
      ImuSix squares = ImuSix::Zero();
      double terms = 0;
      double pairs = 0;
    };
    std::vector<Sum> sums;  // one per cluster length; octave 0 also has the shorter ones
  };
  void keep(std::size_t octave);
  static void addTerm(const Octave& octave, std::size_t steps, Octave::Sum& sum);

  double period_;
  bool any_ = false;
  ImuSix reference_ = ImuSix::Zero();  // subtracted from every reading: small numbers add exactly
  ImuSix integral_ = ImuSix::Zero();   // in periods
  std::uint64_t count_ = 0;            // readings since the last interruption
  std::vector<Octave> octaves_;
};

}  // namespace swiftlet
