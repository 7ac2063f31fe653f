#include "mapping/place/brief_pattern.hpp"

#include <cmath>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kPatternSeed = 256;
constexpr double kSpread = 31.0 / 5.0;  // px: standard deviation, a fifth of the patch (BRIEF's best)

BriefPattern drawPattern() {
  Random random(kPatternSeed);
  const auto place = [&](std::int8_t& x, std::int8_t& y) {
    for (;;) {
      const double px = std::round(kSpread * random.normal());
      const double py = std::round(kSpread * random.normal());
      if (px * px + py * py > kPatchRadius * kPatchRadius) continue;
      x = static_cast<std::int8_t>(px);
      y = static_cast<std::int8_t>(py);
      return;
    }
  };
  BriefPattern pattern;
  for (BriefPair& pair : pattern) {
    do {
      place(pair.x0, pair.y0);
      place(pair.x1, pair.y1);
    } while (pair.x0 == pair.x1 && pair.y0 == pair.y1);
  }
  return pattern;
}

}  // namespace

const BriefPattern& briefPattern() {
  static const BriefPattern kPattern = drawPattern();
  return kPattern;
}

}  // namespace swiftlet
