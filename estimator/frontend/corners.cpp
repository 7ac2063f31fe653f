#include "estimator/frontend/corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kMaskStep = 4;   // px, resolution of the minimum distance
constexpr int kBoxRadius = 3;  // px: 7x7 box
constexpr int kBox = 2 * kBoxRadius + 1;
constexpr int kImageBorder = 12;  // px; patches of new features must lie inside the image
constexpr int kMinCell = 16;      // px
// Sobel's 3x3 kernel gives 8 times the gradient.
constexpr float kScoreScale = 1.0F / (64.0F * kBox * kBox);
// More cells than features, because some have no texture.
constexpr float kCellsPerFeature = 1.25F;

constexpr int kLanes = 16;

// Rolling sums over the last kBox rows of gradient products, one cell wide. Rows are written in complete
// vectors and read up to kBox beyond them.
constexpr int kMaxRow = (CornerDetector::kMaxCell + 2 + 2 * kBoxRadius + kLanes - 1) / kLanes * kLanes;
using ProductRow = std::array<float, kMaxRow>;
struct Rolling {
  alignas(32) std::array<ProductRow, kBox> xx, xy, yy;
  alignas(32) std::array<float, kMaxRow + kLanes> sum_xx, sum_xy, sum_yy;
  alignas(32) std::array<std::array<float, kMaxRow + kLanes>, 3> score;
};

// Adds a row of the image to the sums and subtracts the row that it replaces. Products of gradients are
// integers below 2^20 and their sums below 2^23: exact in floats, so errors do not accumulate.
template <typename Isa>
void addRow(const std::uint8_t* row, int stride, int width, std::size_t slot, Rolling& r) {
  const auto take = [](float* sum, float* product, const auto& a, const auto& b) {
    const auto now = Isa::multiply(a, b);
    const auto change = Isa::subtract(now, Isa::loadFloats(product));
    Isa::storeFloats(sum, Isa::add(Isa::loadFloats(sum), change));
    Isa::storeFloats(product, now);
  };
  for (int x = 0; x < width; x += kLanes) {
    const std::uint8_t* here = row + x;
    const std::uint8_t* up = here - stride;
    const std::uint8_t* down = here + stride;
    const auto falling = Isa::subtract(Isa::widen(down + 1), Isa::widen(up - 1));
    const auto rising = Isa::subtract(Isa::widen(up + 1), Isa::widen(down - 1));
    const auto across = Isa::subtract(Isa::widen(here + 1), Isa::widen(here - 1));
    const auto along = Isa::subtract(Isa::widen(down), Isa::widen(up));
    const auto gx = Isa::add(Isa::add(falling, rising), Isa::add(across, across));
    const auto gy = Isa::add(Isa::subtract(falling, rising), Isa::add(along, along));
    const auto fx = Isa::toFloats(gx);
    const auto fy = Isa::toFloats(gy);
    take(r.sum_xx.data() + x, r.xx[slot].data() + x, fx, fx);
    take(r.sum_xy.data() + x, r.xy[slot].data() + x, fx, fy);
    take(r.sum_yy.data() + x, r.yy[slot].data() + x, fy, fy);
  }
}

// Computes a row of scores in complete vectors; returns whether any is above `limit`.
template <typename Isa>
bool scoreRow(const Rolling& r, int width, float limit, float* score) {
  bool above = false;
  for (int x = 0; x < width; x += kLanes) {
    const auto box = [x](const auto& sums) {
      auto total = Isa::loadFloats(sums.data() + x);
      for (int k = 1; k < kBox; ++k) total = Isa::add(total, Isa::loadFloats(sums.data() + x + k));
      return total;
    };
    const auto a = box(r.sum_xx);
    const auto b = box(r.sum_xy);
    const auto c = box(r.sum_yy);
    const auto half = Isa::broadcastFloat(0.5F);
    const auto mean = Isa::multiply(half, Isa::add(a, c));
    const auto difference = Isa::multiply(half, Isa::subtract(a, c));
    const auto root = Isa::squareRoot(Isa::multiplyAdd(Isa::multiply(difference, difference), b, b));
    const auto s = Isa::multiply(Isa::subtract(mean, root), Isa::broadcastFloat(kScoreScale));
    Isa::storeFloats(score + x, s);
    above = Isa::anyAbove(s, limit) || above;
  }
  return above;
}

}  // namespace

CornerDetector::CornerDetector(int width, int height)
    : width_(width),
      height_(height),
      mask_stride_(width / kMaskStep + 1),
      mask_(static_cast<std::size_t>(mask_stride_) * static_cast<std::size_t>(height / kMaskStep + 1), 0) {}

void CornerDetector::block(const Eigen::Vector2f& pixel, float distance) {
  const auto low = [](float v) { return std::max(0, static_cast<int>(v) / kMaskStep); };
  const int x1 = std::min(low(pixel.x() + distance), width_ / kMaskStep);
  const int y1 = std::min(low(pixel.y() + distance), height_ / kMaskStep);
  for (int y = low(pixel.y() - distance); y <= y1; ++y) {
    for (int x = low(pixel.x() - distance); x <= x1; ++x) {
      const float dx = (static_cast<float>(x) + 0.5F) * kMaskStep - pixel.x();
      const float dy = (static_cast<float>(y) + 0.5F) * kMaskStep - pixel.y();
      if (dx * dx + dy * dy < distance * distance) mask_[static_cast<std::size_t>(y * mask_stride_ + x)] = 1;
    }
  }
}

bool CornerDetector::blocked(int x, int y) const {
  return mask_[static_cast<std::size_t>((y / kMaskStep) * mask_stride_ + x / kMaskStep)] != 0;
}

template <typename Isa>
Corner CornerDetector::bestOfCell(const ImageView& image, int x0, int y0, int x1, int y1,
                                  float min_score) const {
  // One more score on each side than the cell, for the 3x3 maximum.
  const int score_width = x1 - x0 + 2;
  const int product_width = score_width + 2 * kBoxRadius;
  Rolling r;
  const auto used = static_cast<std::size_t>((product_width + kLanes - 1) / kLanes * kLanes + kLanes);
  for (std::size_t k = 0; k < kBox; ++k) {
    for (auto* row : {&r.xx[k], &r.xy[k], &r.yy[k]}) {
      std::fill_n(row->begin(), std::min<std::size_t>(used, kMaxRow), 0.0F);
    }
  }
  for (auto* row : {&r.sum_xx, &r.sum_xy, &r.sum_yy}) std::fill_n(row->begin(), used, 0.0F);
  Corner best;
  best.score = min_score;
  const int first = y0 - 1 - kBoxRadius;
  const int last = y1 + kBoxRadius;
  bool here_above = false;  // whether the row of scores before the newest has one above the limit
  for (int y = first; y <= last; ++y) {
    const int count = y - first;
    addRow<Isa>(image.row(y) + (x0 - 1 - kBoxRadius), image.stride, product_width,
                static_cast<std::size_t>(count % kBox), r);
    if (count < kBox - 1) continue;
    const int done = count - (kBox - 1);  // score rows so far: row y0 - 1 + done
    const bool newest_above =
        scoreRow<Isa>(r, score_width, best.score, r.score[static_cast<std::size_t>(done % 3)].data());
    const bool worth_a_look = here_above;
    here_above = newest_above;
    if (done < 2 || !worth_a_look) continue;
    const float* above = r.score[static_cast<std::size_t>((done - 2) % 3)].data();
    const float* here = r.score[static_cast<std::size_t>((done - 1) % 3)].data();
    const float* below = r.score[static_cast<std::size_t>(done % 3)].data();
    const int row = y0 + done - 2;
    for (int i = 1; i < score_width - 1; ++i) {
      const float s = here[i];
      if (!(s > best.score)) continue;
      const bool maximum = s >= here[i - 1] && s >= here[i + 1] && s >= above[i - 1] && s >= above[i] &&
                           s >= above[i + 1] && s >= below[i - 1] && s >= below[i] && s >= below[i + 1];
      const int x = x0 + i - 1;
      if (!maximum || blocked(x, row)) continue;
      best = {{static_cast<float>(x), static_cast<float>(row)}, s};
    }
  }
  if (!(best.score > min_score)) best.score = 0;
  return best;
}

template <typename Isa>
void CornerDetector::detect(const ImageView& image, const Pixels& occupied, int features_at_most, int wanted,
                            const CornerSettings& settings, FixedVector<Corner, kMaxFeatures>& corners) {
  corners.clear();
  if (wanted <= 0 || features_at_most <= 0) return;
  const auto area = static_cast<float>(width_ * height_);
  const int side = std::clamp(
      static_cast<int>(std::sqrt(area / (kCellsPerFeature * static_cast<float>(features_at_most)))), kMinCell,
      kMaxCell);
  const int columns = (width_ + side - 1) / side;
  const int rows = (height_ + side - 1) / side;
  std::fill(mask_.begin(), mask_.end(), std::uint8_t{0});
  std::array<bool, kMaxCells> taken{};
  for (const Eigen::Vector2f& pixel : occupied) {
    block(pixel, settings.min_distance);
    const int cell = static_cast<int>(pixel.y()) / side * columns + static_cast<int>(pixel.x()) / side;
    if (cell >= 0 && cell < kMaxCells) taken[static_cast<std::size_t>(cell)] = true;
  }
  candidates_.clear();
  float top = 0;
  for (int cell = 0; cell < std::min(columns * rows, kMaxCells); ++cell) {
    if (taken[static_cast<std::size_t>(cell)]) continue;
    const int x0 = std::max(cell % columns * side, kImageBorder);
    const int y0 = std::max(cell / columns * side, kImageBorder);
    const int x1 = std::min(cell % columns * side + side, width_ - kImageBorder);
    const int y1 = std::min(cell / columns * side + side, height_ - kImageBorder);
    if (x1 - x0 < 2 || y1 - y0 < 2) continue;
    const Corner best =
        bestOfCell<Isa>(image, x0, y0, x1, y1, std::max(settings.min_score, settings.relative * top));
    if (best.score <= 0) continue;
    top = std::max(top, best.score);
    if (!candidates_.tryPushBack(best)) break;
  }
  // Total order (score, then position), so the result does not depend on the implementation of sort.
  std::sort(candidates_.begin(), candidates_.end(), [](const Corner& a, const Corner& b) {
    if (a.score != b.score) return a.score > b.score;
    return a.pixel.y() != b.pixel.y() ? a.pixel.y() < b.pixel.y() : a.pixel.x() < b.pixel.x();
  });
  for (const Corner& corner : candidates_) {
    if (static_cast<int>(corners.size()) >= wanted || corner.score < settings.relative * top) break;
    if (blocked(static_cast<int>(corner.pixel.x()), static_cast<int>(corner.pixel.y()))) continue;
    if (!corners.tryPushBack(corner)) break;
    block(corner.pixel, settings.min_distance);
  }
}

template void CornerDetector::detect<simd::Native>(const ImageView&, const Pixels&, int, int,
                                                   const CornerSettings&, FixedVector<Corner, kMaxFeatures>&);
#ifdef SWIFTLET_SIMD_NATIVE
template void CornerDetector::detect<simd::Scalar>(const ImageView&, const Pixels&, int, int,
                                                   const CornerSettings&, FixedVector<Corner, kMaxFeatures>&);
#endif

}  // namespace swiftlet
