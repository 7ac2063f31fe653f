#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"

namespace swiftlet {

void AllanVariance::add(const ImuSix& reading) {
  if (!any_) reference_ = reading;
  any_ = true;
  if (count_ == 0) {
    integral_.setZero();
    keep(0);  // the start of the integral
  }
  integral_ += reading - reference_;
  ++count_;
  for (std::size_t octave = 0; count_ % (std::uint64_t{1} << octave) == 0; ++octave) {
    keep(octave);
    if (count_ == std::uint64_t{1} << octave) break;
  }
}

void AllanVariance::interrupt() {
  count_ = 0;
  for (Octave& octave : octaves_) octave.kept = 0;
}

void AllanVariance::keep(std::size_t index) {
  if (index == octaves_.size()) {
    octaves_.emplace_back();
    octaves_.back().sums.resize(index == 0 ? 5 : 1);
  }
  Octave& octave = octaves_[index];
  // The integral starts at zero; every octave keeps this value.
  if (octave.kept == 0 && index > 0) octave.ring[octave.kept++].setZero();
  octave.ring[octave.kept++ % octave.ring.size()] = integral_;
  for (std::size_t i = 0; i < octave.sums.size(); ++i) addTerm(octave, kSteps >> i, octave.sums[i]);
}

void AllanVariance::addTerm(const Octave& octave, std::size_t steps, Octave::Sum& sum) {
  if (octave.kept < 2 * steps + 1) return;
  const auto before = [&](std::size_t back) -> const ImuSix& {
    return octave.ring[(octave.kept - 1 - back) % octave.ring.size()];
  };
  sum.squares += (before(0) - 2 * before(steps) + before(2 * steps)).cwiseAbs2();
  sum.terms += 1;
  // The first term covers two clusters; each further one adds a stride.
  sum.pairs += octave.kept == 2 * steps + 1 ? 1 : 1 / static_cast<double>(2 * steps);
}

std::vector<AllanPoint> AllanVariance::points() const {
  std::vector<AllanPoint> points;
  for (std::size_t index = 0; index < octaves_.size(); ++index) {
    const auto& sums = octaves_[index].sums;
    for (std::size_t i = sums.size(); i-- > 0;) {
      if (sums[i].terms == 0) continue;
      const double cluster = static_cast<double>((kSteps >> i) << index);
      points.push_back(
          {cluster * period_, sums[i].squares / (sums[i].terms * 2 * cluster * cluster), sums[i].pairs});
    }
  }
  return points;
}

}  // namespace swiftlet
