#include "mapping/depth/disparity_filters.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace swiftlet {

SpeckleFilter::SpeckleFilter(int width, int height)
    : runs_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)), ends_(runs_.size()) {}

std::uint32_t SpeckleFilter::root(std::uint32_t run) {
  while (runs_[run].parent != run) {
    runs_[run].parent = runs_[runs_[run].parent].parent;
    run = runs_[run].parent;
  }
  return run;
}

void SpeckleFilter::join(std::uint32_t a, std::uint32_t b) {
  a = root(a);
  b = root(b);
  if (a == b) return;
  if (b < a) std::swap(a, b);
  runs_[b].parent = a;
  runs_[a].pixels += runs_[b].pixels;
}

void SpeckleFilter::findRuns(const std::uint16_t* row, std::uint32_t begin, int width, int step) {
  int x = 0;
  while (x < width) {
    if (row[x] == kNoDisparity) {
      ++x;
      continue;
    }
    const int first = x++;
    while (x < width && row[x] != kNoDisparity && std::abs(row[x] - row[x - 1]) <= step) ++x;
    const auto run = static_cast<std::uint32_t>(used_);
    runs_[used_] = {begin + static_cast<std::uint32_t>(first), run, static_cast<std::uint32_t>(x - first)};
    ends_[used_] = begin + static_cast<std::uint32_t>(x);
    ++used_;
  }
}

void SpeckleFilter::joinRows(const std::uint16_t* image, std::uint32_t above, std::uint32_t above_end,
                             std::uint32_t below, int width, int step) {
  const auto row = static_cast<std::uint32_t>(width);
  const std::uint32_t below_end = static_cast<std::uint32_t>(used_);
  while (above < above_end && below < below_end) {
    const std::uint32_t first = std::max(runs_[above].begin + row, runs_[below].begin);
    const std::uint32_t end = std::min(ends_[above] + row, ends_[below]);
    for (std::uint32_t p = first; p < end; ++p) {
      if (std::abs(image[p] - image[p - row]) <= step) {
        join(above, below);
        break;
      }
    }
    if (ends_[above] + row < ends_[below]) {
      ++above;
    } else {
      ++below;
    }
  }
}

std::size_t SpeckleFilter::remove(DisparityImage& image, int least_pixels, int step) {
  used_ = 0;
  std::uint32_t above = 0;
  for (int y = 0; y < image.height(); ++y) {
    const auto begin = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(image.width());
    const auto below = static_cast<std::uint32_t>(used_);
    findRuns(image.disparity() + begin, begin, image.width(), step);
    joinRows(image.disparity(), above, below, below, image.width(), step);
    above = below;
  }
  std::size_t removed = 0;
  for (std::uint32_t run = 0; run < used_; ++run) {
    if (runs_[root(run)].pixels >= static_cast<std::uint32_t>(least_pixels)) continue;
    std::fill(image.disparity() + runs_[run].begin, image.disparity() + ends_[run], kNoDisparity);
    removed += ends_[run] - runs_[run].begin;
  }
  return removed;
}

MedianFilter::MedianFilter(int width, int height)
    : rows_(height > 0 ? 2 * static_cast<std::size_t>(width) : 0), known_(static_cast<std::size_t>(width)) {}

namespace {

// Smaller first.
void order(std::uint16_t& a, std::uint16_t& b) {
  const std::uint16_t small = std::min(a, b);
  b = std::max(a, b);
  a = small;
}

std::uint16_t medianOfNine(std::array<std::uint16_t, 9> v) {
  // Columns in order, then the greatest of the least, the median of the medians, the least of the greatest
  // (Smith, "Implementing median filters in XC4000E FPGAs", Xcell 23, 1996).
  for (std::size_t i = 0; i < 9; i += 3) {
    order(v[i], v[i + 1]);
    order(v[i + 1], v[i + 2]);
    order(v[i], v[i + 1]);
  }
  const std::uint16_t low = std::max(std::max(v[0], v[3]), v[6]);
  const std::uint16_t middle = std::max(std::min(v[1], v[4]), std::min(std::max(v[1], v[4]), v[7]));
  const std::uint16_t high = std::min(std::min(v[2], v[5]), v[8]);
  return std::max(std::min(low, middle), std::min(std::max(low, middle), high));
}

}  // namespace

// Plain loops, which the compiler vectorizes, except for the few pixels of holes.
void MedianFilter::filterRow(const std::uint16_t* above, const std::uint16_t* here,
                             const std::uint16_t* below, std::uint16_t* __restrict out, std::uint8_t* sigma,
                             int width) {
  std::uint16_t* __restrict const known = known_.data();
  for (int x = 1; x + 1 < width; ++x) {
    const std::uint16_t centre = here[x];
    const auto or_centre = [centre](std::uint16_t v) { return v == kNoDisparity ? centre : v; };
    out[x] = medianOfNine({or_centre(above[x - 1]), or_centre(above[x]), or_centre(above[x + 1]),
                           or_centre(here[x - 1]), centre, or_centre(here[x + 1]), or_centre(below[x - 1]),
                           or_centre(below[x]), or_centre(below[x + 1])});
  }
  for (int x = 1; x + 1 < width; ++x) {
    const auto one = [](std::uint16_t v) { return static_cast<std::uint16_t>(v != kNoDisparity ? 1 : 0); };
    known[x] =
        static_cast<std::uint16_t>(one(above[x - 1]) + one(above[x]) + one(above[x + 1]) + one(here[x - 1]) +
                                   one(here[x + 1]) + one(below[x - 1]) + one(below[x]) + one(below[x + 1]));
  }
  for (int x = 1; x + 1 < width; ++x) {
    if (here[x] != kNoDisparity) continue;
    out[x] = kNoDisparity;
    if (known[x] < kHoleNeighbours) continue;
    std::array<std::uint16_t, 9> nine{above[x - 1], above[x],     above[x + 1], here[x - 1], here[x],
                                      here[x + 1],  below[x - 1], below[x],     below[x + 1]};
    // Missing disparities come last.
    std::sort(nine.begin(), nine.end());
    if (nine[known[x] - std::size_t{1}] - nine[0] > kDisparitySteps) continue;
    out[x] = nine[(known[x] - std::size_t{1}) / 2];
    sigma[x] = kDisparitySteps;
  }
}

void MedianFilter::filter(DisparityImage& image) {
  const int width = image.width();
  if (width < 3 || image.height() < 3) return;
  const auto size = static_cast<std::size_t>(width);
  std::uint16_t* above = rows_.data();
  std::uint16_t* here = rows_.data() + size;
  std::copy_n(image.disparity(), size, above);
  for (int y = 1; y + 1 < image.height(); ++y) {
    std::uint16_t* const row = image.disparity() + static_cast<std::size_t>(y) * size;
    std::copy_n(row, size, here);
    filterRow(above, here, row + size, row, image.sigma() + static_cast<std::size_t>(y) * size, width);
    std::swap(above, here);
  }
}

}  // namespace swiftlet
