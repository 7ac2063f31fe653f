// Chooses the comparisons of brief_pattern.cpp on images; run by hand, prints the table:
//   place_pattern IMAGE...
// Candidates are pairs drawn from a normal distribution. One is good that says 0 and 1 equally often over
// many corners, says the same again when the corner is seen a pixel and a few degrees off, and says something
// else than those chosen before (the greedy choice of Rublee et al., ICCV 2011, with the second point added).

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numeric>

#include "estimator/core/random.hpp"
#include "tests/mapping/place_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr std::uint64_t kSeed = 1;
constexpr std::size_t kCandidates = 12000;
constexpr double kSpread = 31.0 / 5.0;      // px: a fifth of the patch
constexpr double kCornerTurn = 8.0 / 57.3;  // rad: how far a corner's direction is off when seen again
constexpr double kBalance = 0.5;            // weight of an unequal number of 0 and 1 against instability

struct Sample {
  SteeredBrief::Patch patch;
  float direction = 0;
};
using Bits = std::vector<std::uint64_t>;

std::vector<BriefPair> drawCandidates() {
  Random random(kSeed);
  const auto place = [&](std::int8_t& x, std::int8_t& y) {
    double px = 0, py = 0;
    do {
      px = std::round(kSpread * random.normal());
      py = std::round(kSpread * random.normal());
    } while (px * px + py * py > kPatchRadius * kPatchRadius);
    x = static_cast<std::int8_t>(px);
    y = static_cast<std::int8_t>(py);
  };
  std::vector<BriefPair> pairs(kCandidates);
  for (BriefPair& pair : pairs) {
    do {
      place(pair.x0, pair.y0);
      place(pair.x1, pair.y1);
    } while (std::abs(pair.x0 - pair.x1) + std::abs(pair.y0 - pair.y1) < 2);
  }
  return pairs;
}

bool bitOf(const BriefPair& pair, const Sample& s) {
  const float c = std::cos(s.direction), n = std::sin(s.direction);
  const auto at = [&](int x, int y) {
    const long px = std::lround(c * static_cast<float>(x) - n * static_cast<float>(y)) + kPatchRadius;
    const long py = std::lround(n * static_cast<float>(x) + c * static_cast<float>(y)) + kPatchRadius;
    return s.patch[static_cast<std::size_t>(py) * SteeredBrief::kPatchStride + static_cast<std::size_t>(px)];
  };
  return at(pair.x0, pair.y0) < at(pair.x1, pair.y1);
}

Bits bitsOf(const BriefPair& pair, const std::vector<Sample>& samples) {
  Bits bits((samples.size() + 63) / 64, 0);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (bitOf(pair, samples[i])) bits[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return bits;
}

std::size_t differing(const Bits& a, const Bits& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += static_cast<std::size_t>(std::popcount(a[i] ^ b[i]));
  return count;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<Sample> first, again;
  Random random(kSeed, 1);
  for (int i = 1; i < argc; ++i) {
    const cv::Mat grey = readGrey(argv[i]);
    if (grey.empty()) continue;
    PlaceExtractor extractor(grey.cols, grey.rows);
    auto keyframe = std::make_unique<PlaceKeyframe>();
    const Described corners = describeOurs(extractor, plainCamera(grey.cols, grey.rows), grey, *keyframe);
    PlacePyramid pyramid(grey.cols, grey.rows, kMaxOctaves);
    (void)pyramid.build(viewOf(grey));
    for (std::size_t k = 0; k < corners.pixel.size(); ++k) {
      const int octave = corners.octave[k];
      const Eigen::Vector2f at = pyramid.toLevel(octave, corners.pixel[k].cast<float>());
      const ImageView level = pyramid.level(octave);
      const std::uint8_t* centre = level.row(cvRound(at.y())) + cvRound(at.x());
      Sample s;
      SteeredBrief::smooth(centre, level.stride, s.patch);
      s.direction = SteeredBrief::direction(s.patch);
      first.push_back(s);
      const int dx = static_cast<int>(random.below(3)) - 1, dy = static_cast<int>(random.below(3)) - 1;
      SteeredBrief::smooth(centre + dy * level.stride + dx, level.stride, s.patch);
      s.direction = SteeredBrief::direction(s.patch) + static_cast<float>(kCornerTurn * random.normal());
      again.push_back(s);
    }
  }
  const auto n = static_cast<double>(first.size());
  std::fprintf(stderr, "%zu corners\n", first.size());
  const std::vector<BriefPair> pairs = drawCandidates();
  std::vector<Bits> bits;
  std::vector<double> cost;
  for (const BriefPair& pair : pairs) {
    bits.push_back(bitsOf(pair, first));
    const Bits second = bitsOf(pair, again);
    const double ones = static_cast<double>(differing(bits.back(), Bits(second.size(), 0))) / n;
    cost.push_back(static_cast<double>(differing(bits.back(), second)) / n + kBalance * std::abs(ones - 0.5));
  }
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return cost[a] < cost[b]; });
  std::vector<std::size_t> chosen;
  double limit = 0.1;
  for (; chosen.size() < 256; limit += 0.02) {
    chosen.clear();
    for (const std::size_t c : order) {
      const bool fresh = std::all_of(chosen.begin(), chosen.end(), [&](std::size_t other) {
        return std::abs(1 - 2 * static_cast<double>(differing(bits[c], bits[other])) / n) < limit;
      });
      if (fresh) chosen.push_back(c);
      if (chosen.size() == 256) break;
    }
  }
  double mean_cost = 0;
  for (const std::size_t c : chosen) mean_cost += cost[c] / 256;
  std::fprintf(stderr, "correlation below %.2f, mean cost %.3f, of all %.3f\n", limit - 0.02, mean_cost,
               std::accumulate(cost.begin(), cost.end(), 0.0) / static_cast<double>(cost.size()));
  for (const std::size_t c : chosen) {
    std::printf("{%d, %d, %d, %d},\n", pairs[c].x0, pairs[c].y0, pairs[c].x1, pairs[c].y1);
  }
  return 0;
}
