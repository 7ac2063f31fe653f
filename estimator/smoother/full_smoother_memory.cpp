// Predicts the memory of full smoothing before it is allocated.

#include <algorithm>
#include <limits>

#include "estimator/smoother/full_smoother.hpp"
#include "estimator/smoother/full_smoother_system.hpp"

namespace swiftlet {
namespace {

/// Node of a std::map or std::set: three pointers, a colour, and the allocator's overhead.
constexpr std::size_t kNodeBytes = 64;
/// A value and its row in the factor.
constexpr std::size_t kEntryBytes = 12;
/// Code and initial work space of the factorization libraries.
constexpr std::size_t kLibraryBytes = std::size_t{8} << 20U;
/// Factor for the work space of the factorization and unused storage.
constexpr double kFactorMargin = 1.5;

/// The pairs of keyframes that are tied: one bit per pair.
class Pairs {
 public:
  explicit Pairs(std::size_t keyframes) : size_(keyframes), bits_(keyframes * keyframes, false) {
    for (std::size_t k = 1; k < keyframes; ++k) tie(k, k - 1);
  }
  void tie(std::size_t a, std::size_t b) {
    if (a != b) bits_[std::max(a, b) * size_ + std::min(a, b)] = true;
  }
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(std::count(bits_.begin(), bits_.end(), true));
  }
  /// Number of pairs in the factor: those of each row are found by walking up the elimination tree from every
  /// tie of the row (J. Liu, "The role of elimination trees in sparse factorization", SIAM J. Matrix Anal.
  /// Appl. 1990).
  [[nodiscard]] std::size_t countInFactor() const {
    constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
    std::vector<std::size_t> parent(size_, kNone);
    std::vector<std::size_t> seen(size_, kNone);
    std::size_t count = 0;
    for (std::size_t row = 0; row < size_; ++row) {
      seen[row] = row;
      for (std::size_t column = 0; column < row; ++column) {
        if (!bits_[row * size_ + column]) continue;
        for (std::size_t j = column; seen[j] != row; j = parent[j]) {
          if (parent[j] == kNone) parent[j] = row;
          seen[j] = row;
          ++count;
        }
      }
    }
    return count;
  }

 private:
  std::size_t size_;
  std::vector<bool> bits_;
};

}  // namespace

std::size_t FullSmoother::memoryNeeded() const {
  const std::size_t n = keyframes_.size();
  Pairs pairs(n);
  std::size_t bytes = kLibraryBytes + n * n / 8 + pending_imu_.capacity() * sizeof(ImuSample);
  for (const Keyframe& keyframe : keyframes_) {
    bytes += sizeof(Keyframe) + sizeof(RigPose) + sizeof(BodyState) +
             keyframe.samples.capacity() * sizeof(ImuSample);
  }
  for (const auto& [key, track] : tracks_) {
    bytes += sizeof(TrackKey) + sizeof(Track) + kNodeBytes + track.sightings.capacity() * sizeof(Sighting);
    for (std::size_t i = 0; i < track.sightings.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) pairs.tie(track.sightings[i].slot, track.sightings[j].slot);
    }
  }
  for (const Revisit& revisit : revisits_) {
    bytes += sizeof(Revisit);
    pairs.tie(revisit.old_keyframe, revisit.new_keyframe);
  }
  for (const Match& match : matches_) {
    bytes += sizeof(Match) + 2 * (kNodeBytes + sizeof(TrackKey));
    for (const Sighting& sighting : tracks_.at(match.track).sightings) {
      pairs.tie(match.sighting.slot, sighting.slot);
    }
  }
  const std::size_t of_factor = pairs.countInFactor();
  constexpr std::size_t kNear = kStateDim * kStateDim + kStateDim * (kStateDim + 1) / 2;
  constexpr std::size_t kFar = kStateDim * kPoseDim;
  const std::size_t entries = n * kNear + (of_factor - std::min(of_factor, n)) * kFar;
  bytes += n * System::kKeyframeBytes + pairs.count() * System::kPairBytes;
  return bytes + static_cast<std::size_t>(kFactorMargin * static_cast<double>(entries * kEntryBytes));
}

}  // namespace swiftlet
