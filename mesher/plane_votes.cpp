#include "mesher/plane_votes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

constexpr double kPi = std::numbers::pi;
// A landmark some metres away is accurate to centimetres, so two bins hold a plane's vertices. Like the noise
// of stereo, bins grow with the square of the distance: four times as wide at kReach, and without a limit.
constexpr float kBinSize = 0.05F;  // m, nearby
constexpr std::size_t kDistanceBins = 512;
constexpr float kHalfBins = 0.5F * static_cast<float>(kDistanceBins);
constexpr float kReach = kHalfBins * kBinSize;  // 12.8 m
constexpr std::size_t kAzimuthBins = 120;       // 3 degrees: 8 cm at 3 m along a wall from its middle
constexpr std::size_t kHeightRows = 2;          // faces that look up, faces that look down
// A triangle with edges of 30 cm and corners off by 3 cm is tilted by 8 degrees (1 sigma).
constexpr float kMaxTiltSine = 0.342F;    // sin(20 deg): largest tilt of a face that votes
constexpr float kMaxTiltCosine = 0.940F;  // its cosine
constexpr int kAzimuthSpread = 3;         // bins on either side that a face votes for: 9 degrees
constexpr float kLargestVote = 0.25F;     // m^2
constexpr std::array<float, 3> kThird{1.0F / 3, 1.0F / 3, 1.0F / 3};

std::size_t azimuthBin(const Eigen::Vector3f& normal) {
  const double turns = std::atan2(normal.y(), normal.x()) / (2 * kPi);  // -0.5 to 0.5
  const auto bin = static_cast<int>(std::lround((turns + 1.0) * static_cast<double>(kAzimuthBins)));
  return static_cast<std::size_t>(bin) % kAzimuthBins;
}

// From 0 to kDistanceBins; bin i has its middle at i + 0.5.
float placeOf(float distance) { return kHalfBins + distance / (1 + std::abs(distance) / kReach) / kBinSize; }
float distanceAt(float place) {
  const float shortened = (place - kHalfBins) * kBinSize;
  return shortened / (1 - std::abs(shortened) / kReach);
}

}  // namespace

PlaneVotes::PlaneVotes()
    : bins_((kHeightRows + kAzimuthBins) * kDistanceBins, 0.0F),
      highest_(kHeightRows + kAzimuthBins, 0.0F),
      stale_(kHeightRows + kAzimuthBins, 0) {
  azimuths_.reserve(kAzimuthBins);
  for (std::size_t a = 0; a < kAzimuthBins; ++a) {
    const double angle = 2 * kPi * static_cast<double>(a) / static_cast<double>(kAzimuthBins);
    azimuths_.emplace_back(static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0.0F);
  }
}

void PlaneVotes::clear() {
  std::fill(bins_.begin(), bins_.end(), 0.0F);
  std::fill(stale_.begin(), stale_.end(), std::uint8_t{1});
}

// Divides the weight between the two bins with the nearest middles.
void PlaneVotes::spread(std::size_t row, float distance, float weight) {
  const float at = placeOf(distance) - 0.5F;
  if (!(at >= 0) || at >= static_cast<float>(kDistanceBins - 1)) return;
  const auto bin = static_cast<std::size_t>(at);
  const float share = at - static_cast<float>(bin);
  float* bins = &bins_[row * kDistanceBins];
  bins[bin] += (1 - share) * weight;
  bins[bin + 1] += share * weight;
  stale_[row] = 1;
}

void PlaneVotes::vote(const MeshFace& face, const FaceFacts& facts, const MeshFacts& mesh, float sign) {
  if (facts.area <= 0) return;
  const float weight = sign * std::min(facts.area, kLargestVote);
  const float up = facts.normal.z();
  if (std::abs(up) >= kMaxTiltCosine) {
    for (std::size_t k = 0; k < 3; ++k) {
      spread(up > 0 ? 0 : 1, (up > 0 ? 1.0F : -1.0F) * mesh.vertices[face.vertex[k]].p.z(),
             kThird[k] * weight);
    }
  } else if (std::abs(up) <= kMaxTiltSine) {
    const std::size_t middle = azimuthBin(facts.normal);
    for (int step = -kAzimuthSpread; step <= kAzimuthSpread; ++step) {
      const std::size_t azimuth =
          (middle + kAzimuthBins + static_cast<std::size_t>(step + kAzimuthSpread) - kAzimuthSpread) %
          kAzimuthBins;
      for (std::size_t k = 0; k < 3; ++k) {
        spread(kHeightRows + azimuth, azimuths_[azimuth].dot(mesh.vertices[face.vertex[k]].p),
               kThird[k] * weight);
      }
    }
  }
}

std::optional<PlaneGuess> PlaneVotes::strongest(float least) {
  for (std::size_t row = 0; row < highest_.size(); ++row) {
    if (stale_[row] == 0) continue;
    const float* bins = &bins_[row * kDistanceBins];
    float highest = 0;
    for (std::size_t k = 0; k < kDistanceBins; ++k) highest = bins[k] > highest ? bins[k] : highest;
    highest_[row] = highest;
    stale_[row] = 0;
  }
  const auto best = std::max_element(highest_.begin(), highest_.end());
  if (*best < least) return std::nullopt;
  const auto row = static_cast<std::size_t>(best - highest_.begin());
  const float* bins = &bins_[row * kDistanceBins];
  const auto bin = static_cast<std::size_t>(std::find(bins, bins + kDistanceBins, *best) - bins);
  PlaneGuess guess;
  guess.distance = distanceAt(static_cast<float>(bin) + 0.5F);
  if (row < kHeightRows) {
    guess.normal = row == 0 ? Eigen::Vector3f(0, 0, 1) : Eigen::Vector3f(0, 0, -1);
  } else {
    guess.direction = PlaneDirection::kVertical;
    guess.normal = azimuths_[row - kHeightRows];
  }
  return guess;
}

std::size_t PlaneVotes::rowOf(const PlaneGuess& guess) const {
  if (guess.direction == PlaneDirection::kHorizontal) return guess.normal.z() > 0 ? 0 : 1;
  return kHeightRows + azimuthBin(guess.normal);
}

void PlaneVotes::suppress(const PlaneGuess& guess) {
  const bool level = guess.direction == PlaneDirection::kHorizontal;
  const std::size_t row = rowOf(guess);
  const auto bin = static_cast<int>(placeOf(guess.distance));
  const int rows = level ? 0 : 1;
  for (int dr = -rows; dr <= rows; ++dr) {
    const std::size_t at =
        level ? row
              : kHeightRows +
                    (row - kHeightRows + kAzimuthBins + static_cast<std::size_t>(dr + 1) - 1) % kAzimuthBins;
    for (int d = bin - 1; d <= bin + 1; ++d) {
      if (d < 0 || d >= static_cast<int>(kDistanceBins)) continue;
      bins_[at * kDistanceBins + static_cast<std::size_t>(d)] = 0;
      stale_[at] = 1;
    }
  }
}

}  // namespace swiftlet
