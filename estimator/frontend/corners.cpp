#include "estimator/frontend/corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kMaskStep = 4;   // px: resolution of the minimum distance
constexpr int kBoxRadius = 3;  // px: 7x7 box
constexpr int kBox = 2 * kBoxRadius + 1;
constexpr int kImageBorder = 12;  // px: patches of new features lie inside the image
constexpr int kMinCell = 16;      // px
// Sobel's 3x3 kernel gives 8 x the gradient.
constexpr float kScoreScale = 1.0F / (64.0F * kBox * kBox);
// More cells than features: some are without texture.
constexpr float kCellsPerFeature = 1.25F;

// Rolling sums over the last kBox rows of gradient products, one cell wide.
constexpr int kMaxRow = 96 + 2 + 2 * kBoxRadius + 16;
struct Rolling {
  std::array<std::array<float, kMaxRow>, kBox> xx, xy, yy;
  std::array<float, kMaxRow> sum_xx{}, sum_xy{}, sum_yy{};
  std::array<std::array<float, kMaxRow>, 3> score;
};

void addRow(const std::uint8_t* row, int stride, int width, bool remove_old, std::size_t slot, Rolling& r) {
  const std::uint8_t* up = row - stride;
  const std::uint8_t* down = row + stride;
  float* xx = r.xx[slot].data();
  float* xy = r.xy[slot].data();
  float* yy = r.yy[slot].data();
  const float keep = remove_old ? 1.0F : 0.0F;
  for (int x = 0; x < width; ++x) {
    const int gx = up[x + 1] - up[x - 1] + 2 * (row[x + 1] - row[x - 1]) + down[x + 1] - down[x - 1];
    const int gy = down[x - 1] - up[x - 1] + 2 * (down[x] - up[x]) + down[x + 1] - up[x + 1];
    const auto fx = static_cast<float>(gx);
    const auto fy = static_cast<float>(gy);
    // Products and their sums are integers below 2^24 x 3: exact enough for the rolling difference.
    r.sum_xx[static_cast<std::size_t>(x)] += fx * fx - keep * xx[x];
    r.sum_xy[static_cast<std::size_t>(x)] += fx * fy - keep * xy[x];
    r.sum_yy[static_cast<std::size_t>(x)] += fy * fy - keep * yy[x];
    xx[x] = fx * fx;
    xy[x] = fx * fy;
    yy[x] = fy * fy;
  }
}

void scoreRow(const Rolling& r, int width, float* score) {
  for (int x = 0; x < width; ++x) {
    float a = 0;
    float b = 0;
    float c = 0;
    for (int k = 0; k < kBox; ++k) {
      a += r.sum_xx[static_cast<std::size_t>(x + k)];
      b += r.sum_xy[static_cast<std::size_t>(x + k)];
      c += r.sum_yy[static_cast<std::size_t>(x + k)];
    }
    const float half = 0.5F * (a - c);
    score[x] = (0.5F * (a + c) - std::sqrt(half * half + b * b)) * kScoreScale;
  }
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

Corner CornerDetector::bestOfCell(const ImageView& image, int x0, int y0, int x1, int y1, float min_score) {
  Rolling r{};
  // One more score on each side than the cell, for the 3x3 maximum.
  const int score_width = x1 - x0 + 2;
  const int product_width = score_width + 2 * kBoxRadius;
  Corner best;
  best.score = min_score;
  const int first = y0 - 1 - kBoxRadius;
  const int last = y1 + kBoxRadius;
  for (int y = first; y <= last; ++y) {
    const int count = y - first;
    addRow(image.row(y) + (x0 - 1 - kBoxRadius), image.stride, product_width, count >= kBox,
           static_cast<std::size_t>(count % kBox), r);
    if (count < kBox - 1) continue;
    const int done = count - (kBox - 1);  // score rows so far: row y0 - 1 + done
    scoreRow(r, score_width, r.score[static_cast<std::size_t>(done % 3)].data());
    if (done < 2) continue;
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
        bestOfCell(image, x0, y0, x1, y1, std::max(settings.min_score, settings.relative * top));
    if (best.score <= 0) continue;
    top = std::max(top, best.score);
    if (!candidates_.tryPushBack(best)) break;
  }
  // Total order (score, then place): the result does not depend on the sort's implementation.
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

}  // namespace swiftlet
