// Matching of descriptors against a plain twin, and its rules one by one.
#include "mapping/place/descriptor_matching.hpp"

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "tests/mapping/loop_scene.hpp"

using namespace swiftlet;              // NOLINT(google-build-using-namespace)
using namespace swiftlet::loop_scene;  // NOLINT(google-build-using-namespace)

namespace {

int bitByBit(const Descriptor& a, const Descriptor& b) {
  int bits = 0;
  for (std::size_t i = 0; i < 256; ++i) {
    bits += static_cast<int>(((a.words[i / 64] ^ b.words[i / 64]) >> (i % 64)) & 1U);
  }
  return bits;
}

// The definition, written plainly.
std::vector<DescriptorMatch> twin(const PlaceFeatures& a, const PlaceFeatures& b,
                                  const DescriptorMatchSettings& settings,
                                  const std::vector<std::uint32_t>& node_a = {},
                                  const std::vector<std::uint32_t>& node_b = {}) {
  std::vector<DescriptorMatch> matches;
  const auto allowed = [&](std::size_t i, std::size_t j) { return node_a.empty() || node_a[i] == node_b[j]; };
  for (std::size_t i = 0; i < a.size(); ++i) {
    int best = 1000;
    std::size_t at = 0;
    for (std::size_t j = 0; j < b.size(); ++j) {
      if (!allowed(i, j)) continue;
      const int d = bitByBit(a[i].descriptor, b[j].descriptor);
      if (d < best) best = d, at = j;
    }
    if (best > settings.max_distance) continue;
    bool good = true;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const int d = bitByBit(a[i].descriptor, b[j].descriptor);
      const bool near = (b[j].pixel - b[at].pixel).norm() < settings.same_spot;
      if (allowed(i, j) && !near && static_cast<float>(best) >= settings.ratio * static_cast<float>(d))
        good = false;
    }
    for (std::size_t k = 0; k < a.size(); ++k) {
      if (!allowed(k, at)) continue;
      const int d = bitByBit(a[k].descriptor, b[at].descriptor);
      if (settings.mutual && (d < best || (d == best && k < i))) good = false;
    }
    if (good) {
      matches.push_back(
          {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(at), static_cast<std::uint16_t>(best)});
    }
  }
  return matches;
}

std::vector<DescriptorMatch> listOf(const DescriptorMatches& matches) {
  return {matches.begin(), matches.end()};
}

}  // namespace

TEST_CASE("matching does what its definition says") {
  const auto matcher = std::make_unique<DescriptorMatcher>();
  Random random(11);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SceneSettings settings;
    settings.flipped_bits = 40;
    settings.twins = 0.4;
    const Scene scene = makeScene(settings, seed);
    DescriptorMatchSettings matching;
    matching.max_distance = 70;
    matching.mutual = seed % 2 == 0;
    // Low ratios and wide spots make every rule bite.
    matching.ratio = seed < 4 ? 0.9F : 0.3F;
    matching.same_spot = 12.0F;
    const PlaceFeatures& a = scene.old_keyframe.features;
    const PlaceFeatures& b = scene.new_keyframe.features;
    DescriptorMatches matches;
    REQUIRE(matcher->match(a, b, matching, matches).ok());
    CHECK(matches.size() > 20);
    CHECK(listOf(matches) == twin(a, b, matching));

    std::vector<std::uint32_t> node_a(a.size());
    std::vector<std::uint32_t> node_b(b.size());
    for (std::uint32_t& n : node_a) n = random.below(5);
    for (std::uint32_t& n : node_b) n = random.below(5);
    // Common points are first in both: most of them share their node.
    for (std::size_t i = 0; i < 60; ++i) node_b[i] = node_a[i];
    REQUIRE(matcher->match(a, b, matching, matches, node_a, node_b).ok());
    CHECK(matches.size() > 10);
    CHECK(listOf(matches) == twin(a, b, matching, node_a, node_b));
  }
}

TEST_CASE("equal descriptors go to the smaller index, a doubled corner is no rival") {
  Random random(4);
  PlaceFeatures a;
  PlaceFeatures b;
  PlaceFeature f;
  f.descriptor = randomDescriptor(random);
  f.pixel = {100, 100};
  (void)a.tryPushBack(f);
  (void)b.tryPushBack(f);
  f.pixel = {102, 100};
  (void)b.tryPushBack(f);
  const auto matcher = std::make_unique<DescriptorMatcher>();
  DescriptorMatches matches;
  REQUIRE(matcher->match(a, b, {}, matches).ok());
  REQUIRE(matches.size() == 1);
  CHECK(matches[0] == DescriptorMatch{0, 0, 0});
  b[1].pixel = {200, 100};
  REQUIRE(matcher->match(a, b, {}, matches).ok());
  CHECK(matches.empty());
}

TEST_CASE("matching refuses nodes for a part, and takes empty keyframes") {
  const Scene scene = makeScene({}, 1);
  const auto matcher = std::make_unique<DescriptorMatcher>();
  DescriptorMatches matches;
  const std::vector<std::uint32_t> few(3);
  CHECK(
      matcher->match(scene.old_keyframe.features, scene.new_keyframe.features, {}, matches, few, few).code ==
      StatusCode::kInvalidInput);
  CHECK(matches.empty());
  CHECK(matcher->match({}, scene.new_keyframe.features, {}, matches).ok());
  CHECK(matches.empty());
  CHECK(matcher->match(scene.old_keyframe.features, {}, {}, matches).ok());
  CHECK(matches.empty());
}
