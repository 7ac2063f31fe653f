#include "mapping/depth/semi_global_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace swiftlet {
namespace {

using disparity_lanes::kLanes;

/// Bytes beside a kept row: the census window and whole vectors behind the row's end.
constexpr int kMarginBefore = 64;
constexpr int kMarginBehind = kCensusColumnReach + kLanes;
constexpr int kLinesOfChoice = 6;

int roundUp(int x, int to) { return (x + to - 1) / to * to; }

int signBytes(int width) { return roundUp(width + kLanes * kMaxDisparityVectors + kLanes, 64); }

MatcherSettings checkedSettings(MatcherSettings s) {
  s.disparities = std::clamp(roundUp(s.disparities, kLanes), kLanes, kLanes * kMaxDisparityVectors);
  // Costs along a path stay below 255: signs and the large penalty.
  constexpr int kMostPenalty = 255 - kCensusSigns;
  s.large_penalty = std::clamp(s.large_penalty, 1, kMostPenalty);
  s.small_penalty = std::clamp(s.small_penalty, 1, s.large_penalty);
  s.least_large_penalty = std::clamp(s.least_large_penalty, s.small_penalty, s.large_penalty);
  s.large_penalty_falloff = std::max(s.large_penalty_falloff, 1);
  s.outside_cost = std::clamp(s.outside_cost, 0, kCensusSigns);
  return s;
}

PathPenalties makePenalties(const MatcherSettings& s) {
  PathPenalties p;
  p.small = static_cast<std::uint8_t>(s.small_penalty);
  p.outside = static_cast<std::uint8_t>(s.outside_cost);
  for (int difference = 0; difference < 256; ++difference) {
    const int large = s.large_penalty * s.large_penalty_falloff / (s.large_penalty_falloff + difference);
    p.large[static_cast<std::size_t>(difference)] =
        static_cast<std::uint8_t>(std::max(large, s.least_large_penalty));
  }
  return p;
}

}  // namespace

SemiGlobalMatcher::SemiGlobalMatcher(int width, int height, const MatcherSettings& settings)
    : width_(std::max(width, 0)),
      height_(std::max(height, 0)),
      settings_(checkedSettings(settings)),
      penalties_(makePenalties(settings_)),
      sigmas_(makeSigmas()),
      row_bytes_(roundUp(kMarginBefore + width_ + kMarginBehind, 64)),
      left_rows_(static_cast<std::size_t>(row_bytes_) * kKeptRows),
      right_rows_(left_rows_.size()),
      left_signs_(static_cast<std::size_t>(signBytes(width_)) * kCensusPlanes),
      right_signs_(left_signs_.size()),
      row_blocks_((static_cast<std::size_t>(width_) * static_cast<std::size_t>(settings_.disparities) +
                   sizeof(Block) - 1) /
                  sizeof(Block)),
      costs_(kStripRows * row_blocks_),
      sums_(costs_.size()),
      from_above_(row_blocks_ + 2),
      from_below_(row_blocks_ + 2),
      choice_rows_(static_cast<std::size_t>(roundUp(width_ + 1, 64)) * kLinesOfChoice),
      speckles_(width_, height_),
      median_(width_, height_) {
  std::uint8_t* row = choice_rows_.data();
  for (std::uint8_t** line : {&choice_.disparity, &choice_.least, &choice_.below, &choice_.above,
                              &choice_.second, &choice_.right_disparity}) {
    *line = row;
    row += roundUp(width_ + 1, 64);
  }
}

std::uint8_t* SemiGlobalMatcher::leftRow(int y) {
  return left_rows_.data() + static_cast<std::ptrdiff_t>(y % kKeptRows) * row_bytes_ + kMarginBefore;
}

std::uint8_t* SemiGlobalMatcher::rightRow(int y) {
  return right_rows_.data() + static_cast<std::ptrdiff_t>(y % kKeptRows) * row_bytes_ + kMarginBefore;
}

// With margins that repeat the border's pixels.
void SemiGlobalMatcher::keepRow(const ImageView& left, const ImageView& right, int y) {
  std::uint8_t* const l = leftRow(y);
  std::uint8_t* const r = rightRow(y);
  const std::uint8_t* const from = right.row(y);
  std::memcpy(l, left.row(y), static_cast<std::size_t>(width_));
  std::reverse_copy(from, from + width_, r);
  for (std::uint8_t* const row : {l, r}) {
    std::memset(row - kCensusColumnReach, row[0], kCensusColumnReach);
    std::memset(row + width_, row[width_ - 1], kMarginBehind);
  }
}

template <typename Lanes>
void SemiGlobalMatcher::census(int y) {
  CensusRows left{}, right{};
  for (int i = 0; i < kCensusRows; ++i) {
    const int row = std::clamp(y + i - kCensusRowReach, 0, height_ - 1);
    left[static_cast<std::size_t>(i)] = leftRow(row);
    right[static_cast<std::size_t>(i)] = rightRow(row);
  }
  CensusPlanes left_planes{}, right_planes{};
  for (int p = 0; p < kCensusPlanes; ++p) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(p) * signBytes(width_);
    left_planes[static_cast<std::size_t>(p)] = left_signs_.data() + at;
    right_planes[static_cast<std::size_t>(p)] = right_signs_.data() + at;
  }
  censusRow<Lanes>(left, width_, false, left_planes);
  censusRow<Lanes>(right, width_, true, right_planes);
}

MatchingRow SemiGlobalMatcher::matchingRow(int y, int y_before) {
  MatchingRow row;
  row.width = width_;
  row.grey = leftRow(y);
  row.grey_before = leftRow(std::clamp(y_before, 0, height_ - 1));
  for (std::size_t p = 0; p < kCensusPlanes; ++p) {
    const std::size_t at = p * static_cast<std::size_t>(signBytes(width_));
    row.left_signs[p] = left_signs_.data() + at;
    row.right_signs[p] = right_signs_.data() + at;
  }
  return row;
}

// Standard deviation of a disparity, from the least sum's lead over the next best that is no neighbour, and
// from how steeply sums rise beside it. Fitted to errors below 3 px on the pairs with true disparity and on
// rendered flights; docs/experiments/depth.md has the shares within one, two and three sigma.
std::array<std::uint8_t, 64 * 64> SemiGlobalMatcher::makeSigmas() {
  constexpr double kFloor = 0.22;  // px, where all is clear
  constexpr double kDoubt = 0.85;  // px, added where another disparity is as good
  constexpr double kLead = 38;     // of sums, over which that falls by e
  constexpr double kFlatness = 4;  // px times rise of sums
  std::array<std::uint8_t, 64 * 64> sigmas{};
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    const double lead = 4 * static_cast<double>(i / 64) + 1.5;
    const double rise = 4 * static_cast<double>(i % 64) + 1.5;
    const double sigma = std::hypot(kFloor + kDoubt * std::exp(-lead / kLead), kFlatness / rise);
    sigmas[i] = static_cast<std::uint8_t>(std::min(std::lround(sigma * kDisparitySteps), 255L));
  }
  return sigmas;
}

// Sub-pixel by two lines of opposite slope through the three sums about the least (equiangular fit: the sums
// of census costs rise linearly about their least; Shimizu, Okutomi, ICCV 2001). The offset is towards the
// neighbour with the smaller sum.
void SemiGlobalMatcher::refineRow(int disparities, std::uint16_t* __restrict disparity) const {
  const std::uint8_t* __restrict const whole = choice_.disparity;
  const std::uint8_t* __restrict const least = choice_.least;
  const std::uint8_t* __restrict const below = choice_.below;
  const std::uint8_t* __restrict const above = choice_.above;
  for (int x = 0; x < width_; ++x) {
    const int steeper = std::max<int>(below[x], above[x]) - least[x];
    const bool inside = whole[x] > 0 && whole[x] + 1 < disparities && steeper > 0;
    const float offset = static_cast<float>(below[x] - above[x]) * (0.5F * kDisparitySteps) /
                         static_cast<float>(std::max(steeper, 1));
    const int steps = static_cast<int>(offset + (kDisparitySteps + 0.5F)) - kDisparitySteps;
    disparity[x] = static_cast<std::uint16_t>(whole[x] * kDisparitySteps + (inside ? steps : 0));
  }
}

void SemiGlobalMatcher::checkRow(std::uint16_t* disparity, std::uint8_t* sigma) const {
  const DisparityChoice& c = choice_;
  const int tolerance = settings_.left_right_tolerance;
  for (int x = 0; x < width_; ++x) {
    const int d = c.disparity[x];
    const int lead = c.second[x] - c.least[x];
    const int rise = std::max(c.below[x], c.above[x]) - c.least[x];
    sigma[x] = sigmas_[static_cast<std::size_t>(lead / 4 * 64 + rise / 4)];
    const bool agree =
        tolerance < 0 || (d <= x && std::abs(c.right_disparity[x - std::min(d, x)] - d) <= tolerance);
    if (lead < settings_.least_lead || !agree) disparity[x] = kNoDisparity;
  }
}

template <typename Lanes, int kVectors>
void SemiGlobalMatcher::matchStrip(int begin, int end, int ahead, DisparityImage& disparity) {
  std::memset(static_cast<void*>(from_below_.data()), 0, from_below_.size() * sizeof(Block));
  for (int y = ahead - 1; y >= begin; --y) {
    census<Lanes>(y);
    matchUpwards<Lanes, kVectors>(matchingRow(y, y + 1), penalties_, from_below_[1].bytes,
                                  y < end ? costs(y) : nullptr, y < end ? sums(y) : nullptr);
  }
  for (int y = begin; y < end; ++y) {
    addDownwards<Lanes, kVectors>(matchingRow(y, y - 1), penalties_, costs(y), from_above_[1].bytes, sums(y));
    chooseDisparities<Lanes, kVectors>(sums(y), width_, choice_);
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_);
    refineRow(kLanes * kVectors, disparity.disparity() + at);
    checkRow(disparity.disparity() + at, disparity.sigma() + at);
  }
}

template <typename Lanes, int kVectors>
void SemiGlobalMatcher::matchRows(const ImageView& left, const ImageView& right, DisparityImage& disparity) {
  std::memset(static_cast<void*>(from_above_.data()), 0, from_above_.size() * sizeof(Block));
  int kept = 0;
  for (int begin = 0; begin < height_; begin += kStripRows) {
    const int end = std::min(begin + kStripRows, height_);
    const int ahead = std::min(end + kRowsAhead, height_);
    for (; kept < std::min(ahead + kCensusRowReach, height_); ++kept) keepRow(left, right, kept);
    matchStrip<Lanes, kVectors>(begin, end, ahead, disparity);
  }
}

template <typename Lanes>
Status SemiGlobalMatcher::match(const ImageView& left, const ImageView& right, int disparities,
                                DisparityImage& disparity) {
  for (const ImageView& image : {left, right}) {
    if (image.empty()) return {StatusCode::kInvalidInput, "depth: an image of the pair is missing"};
    if (image.width != width_ || image.height != height_ || image.stride < width_)
      return {StatusCode::kInvalidInput, "depth: an image does not have the matcher's size"};
  }
  if (disparity.width() != width_ || disparity.height() != height_)
    return {StatusCode::kInvalidInput, "depth: the disparity image does not have the matcher's size"};
  const int wanted = disparities > 0 ? std::min(disparities, settings_.disparities) : settings_.disparities;
  switch (roundUp(wanted, kLanes) / kLanes) {
    case 1:
      matchRows<Lanes, 1>(left, right, disparity);
      break;
    case 2:
      matchRows<Lanes, 2>(left, right, disparity);
      break;
    case 3:
      matchRows<Lanes, 3>(left, right, disparity);
      break;
    default:
      matchRows<Lanes, 4>(left, right, disparity);
      break;
  }
  if (settings_.speckle_pixels > 0) {
    speckles_.remove(disparity, settings_.speckle_pixels,
                     static_cast<int>(settings_.speckle_step * kDisparitySteps));
  }
  if (settings_.median) median_.filter(disparity);
  return okStatus();
}

template Status SemiGlobalMatcher::match<disparity_lanes::Scalar>(const ImageView&, const ImageView&, int,
                                                                  DisparityImage&);
#ifdef SWIFTLET_DISPARITY_LANES_NATIVE
template Status SemiGlobalMatcher::match<disparity_lanes::Native>(const ImageView&, const ImageView&, int,
                                                                  DisparityImage&);
#endif

}  // namespace swiftlet
