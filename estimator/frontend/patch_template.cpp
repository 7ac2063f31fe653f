#include "estimator/frontend/patch_template.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kLanes = 16;
// Weights in 1/16: the integer gradients are then 16 w (doubled difference), at most 4080, and all
// sums over the window stay below 2^31.
constexpr float kWeightScale = 16.0F;
// The mean gradient is subtracted as multiplyFraction(w 2^10, mean 2^5): 2^15 in all.
constexpr std::int16_t kMeanWeightShift = 1024;
constexpr float kMeanScale = 32.0F;
// The slope on the template's grey values as a fraction of 2^15, below one.
constexpr float kSlopeScale = 32768.0F;
constexpr float kMaxSlope = 0.999F;
// Below this smaller eigenvalue [grey^2 / px^2] (per unit weight) sensor noise decides the position.
constexpr float kMinEigenvalue = 1.0F;
// A template whose variance is below this [grey^2] has no gain to estimate.
constexpr float kMinVariance = 1.0F;
// How far outside the image the patch centre may wander while it is being aligned [px].
constexpr float kOutside = 4.0F;
// Steps inside one cell; they cost a few operations each.
constexpr int kStepsPerCell = 6;
// A position this far beyond its cell is still extrapolated rather than given a new cell.
constexpr float kCellSlack = 0.05F;

using Window = std::array<float, kPatchSize * kLanes>;

// A disc: pixels in the corners of the square are the first to leave the surface that carries the
// feature. On rendered flights the full square gives young tracks 5 % less error and old ones (80
// frames) a third more outliers. Weight falls linearly over the outermost pixel.
Window makeWindow() {
  Window window{};
  for (int y = 0; y < kPatchSize; ++y) {
    for (int x = 0; x < kPatchSize; ++x) {
      const auto dx = static_cast<float>(x - kPatchRadius);
      const auto dy = static_cast<float>(y - kPatchRadius);
      const float radius = std::sqrt(dx * dx + dy * dy);
      const float edge = static_cast<float>(kPatchRadius) + 1.0F;
      window[static_cast<std::size_t>(y * kLanes + x)] = std::clamp(edge - radius, 0.0F, 1.0F);
    }
  }
  return window;
}

const Window kWindow = makeWindow();

// The same weights as integers.
struct alignas(32) IntegerWindow {
  std::array<std::int16_t, kPatchSize * kLanes> weight{};
  float total = 0;  // in units of kWeightScale
};

IntegerWindow makeIntegerWindow() {
  const Window window = makeWindow();
  IntegerWindow integers;
  for (std::size_t i = 0; i < window.size(); ++i) {
    integers.weight[i] = static_cast<std::int16_t>(std::lround(window[i] * kWeightScale));
    integers.total += static_cast<float>(integers.weight[i]);
  }
  return integers;
}

const IntegerWindow kIntegerWindow = makeIntegerWindow();

float sumOf(const float* lanes) {
  float sum = 0;
  for (int i = 0; i < kLanes; ++i) sum += lanes[i];
  return sum;
}

}  // namespace

const float* patchWindow() { return kWindow.data(); }

template <typename Isa>
bool PatchTemplate::build(const std::uint8_t* centre, int stride) {
  centre_ = centre;
  stride_ = stride;
  alignas(32) std::int16_t weighted_t[kRows * kLanes];
  auto x = Isa::zero(), y = Isa::zero(), t = Isa::zero(), tt = Isa::zero();
  auto xx = Isa::zero(), xy = Isa::zero(), yy = Isa::zero(), xt = Isa::zero(), yt = Isa::zero();
  const auto one = Isa::broadcast(1);
  const auto grey = Isa::broadcast(128);
  // Scharr's smoothing (3 10 3)/16 across each derivative: the finest detail, which bilinear
  // interpolation falsifies, weighs less.
  const auto three = Isa::broadcast(3);
  const auto ten = Isa::broadcast(10);
  const auto sixteenth = Isa::broadcast(2048);
  const std::uint8_t* const first =
      centre - static_cast<std::ptrdiff_t>(kPatchRadius) * stride - kPatchRadius;
  const std::uint8_t* row = first;
  for (int r = 0; r < kRows; ++r, row += stride) {
    const auto w = Isa::load(kIntegerWindow.weight.data() + r * kLanes);
    const auto v = Isa::subtract(Isa::widen(row), grey);
    const std::uint8_t* const up = row - stride;
    const std::uint8_t* const down = row + stride;
    const auto smooth = [&](const auto& outer, const auto& middle) {
      return Isa::multiplyFraction(Isa::add(Isa::multiply(outer, three), Isa::multiply(middle, ten)),
                                   sixteenth);
    };
    const auto falling = Isa::subtract(Isa::widen(down + 1), Isa::widen(up - 1));
    const auto rising = Isa::subtract(Isa::widen(up + 1), Isa::widen(down - 1));
    const auto gx =
        smooth(Isa::add(falling, rising), Isa::subtract(Isa::widen(row + 1), Isa::widen(row - 1)));
    const auto gy = smooth(Isa::subtract(falling, rising), Isa::subtract(Isa::widen(down), Isa::widen(up)));
    const auto wx = Isa::multiply(w, gx);
    const auto wy = Isa::multiply(w, gy);
    const auto wt = Isa::multiply(w, v);
    x = Isa::multiplyAdd(x, wx, one);
    y = Isa::multiplyAdd(y, wy, one);
    t = Isa::multiplyAdd(t, wt, one);
    tt = Isa::multiplyAdd(tt, wt, v);
    xx = Isa::multiplyAdd(xx, wx, gx);
    xy = Isa::multiplyAdd(xy, wx, gy);
    yy = Isa::multiplyAdd(yy, wy, gy);
    xt = Isa::multiplyAdd(xt, wx, v);
    yt = Isa::multiplyAdd(yt, wy, v);
    Isa::store(gradient_x_ + r * kLanes, wx);
    Isa::store(gradient_y_ + r * kLanes, wy);
    Isa::store(weighted_t + r * kLanes, wt);
  }
  // Covariances with T and 1 removed: the Schur complement of gain and offset.
  const float weight = kIntegerWindow.total;
  const auto mean = [&](const auto& sum) { return static_cast<float>(Isa::total(sum)) / weight; };
  const float mean_t = mean(t);
  const float mean_x = mean(x);
  const float mean_y = mean(y);
  const float variance = mean(tt) - mean_t * mean_t;
  if (variance < kMinVariance) return false;
  const float cov_xt = mean(xt) - mean_x * mean_t;
  const float cov_yt = mean(yt) - mean_y * mean_t;
  const float slope_x = std::clamp(cov_xt / variance, -kMaxSlope, kMaxSlope);
  const float slope_y = std::clamp(cov_yt / variance, -kMaxSlope, kMaxSlope);
  // The factor 1/4 takes the doubled differences to gradients.
  const float a = 0.25F * (mean(xx) - mean_x * mean_x - slope_x * cov_xt);
  const float b = 0.25F * (mean(xy) - mean_x * mean_y - slope_x * cov_yt);
  const float c = 0.25F * (mean(yy) - mean_y * mean_y - slope_y * cov_yt);
  min_eigenvalue_ = 0.5F * (a + c) - std::sqrt(0.25F * (a - c) * (a - c) + b * b);
  if (!(min_eigenvalue_ > kMinEigenvalue)) return false;

  const auto fixed = [](float value) {
    return Isa::broadcast(static_cast<std::int16_t>(std::lround(value)));
  };
  const auto offset_x = fixed(kMeanScale * (mean_x - slope_x * mean_t));
  const auto offset_y = fixed(kMeanScale * (mean_y - slope_y * mean_t));
  const auto fraction_x = fixed(kSlopeScale * slope_x);
  const auto fraction_y = fixed(kSlopeScale * slope_y);
  const auto shift = Isa::broadcast(kMeanWeightShift);
  auto own_x = Isa::zero();
  auto own_y = Isa::zero();
  row = first;
  for (int r = 0; r < kRows; ++r, row += stride) {
    const auto w = Isa::multiply(Isa::load(kIntegerWindow.weight.data() + r * kLanes), shift);
    const auto wt = Isa::load(weighted_t + r * kLanes);
    const auto v = Isa::widen(row);
    auto gx = Isa::load(gradient_x_ + r * kLanes);
    auto gy = Isa::load(gradient_y_ + r * kLanes);
    gx = Isa::subtract(gx, Isa::multiplyFraction(w, offset_x));
    gy = Isa::subtract(gy, Isa::multiplyFraction(w, offset_y));
    gx = Isa::subtract(gx, Isa::multiplyFraction(wt, fraction_x));
    gy = Isa::subtract(gy, Isa::multiplyFraction(wt, fraction_y));
    Isa::store(gradient_x_ + r * kLanes, gx);
    Isa::store(gradient_y_ + r * kLanes, gy);
    own_x = Isa::multiplyAdd(own_x, gx, v);
    own_y = Isa::multiplyAdd(own_y, gy, v);
  }
  template_projection_ = {static_cast<float>(Isa::total(own_x)), static_cast<float>(Isa::total(own_y))};
  // H of the true gradients is (weight / 16) [a b; b c]; the integer images are 2 * 16 w G.
  const float scale = 1.0F / (2.0F * weight * (a * c - b * b));
  inverse_hessian_ << c * scale, -b * scale, -b * scale, a * scale;
  return true;
}

template bool PatchTemplate::build<simd::Native>(const std::uint8_t*, int);
#if defined(__AVX2__) || defined(__ARM_NEON)
template bool PatchTemplate::build<simd::Scalar>(const std::uint8_t*, int);
#endif

template <typename Isa>
bool PatchTemplate::align(const ImageView& image, const AlignmentLimits& limits,
                          Eigen::Vector2f& position) const {
  const Eigen::Vector2f guess = position;
  const float max_squared = limits.max_displacement * limits.max_displacement;
  const auto width = static_cast<float>(image.width - 1);
  const auto height = static_cast<float>(image.height - 1);
  for (int cell = 0; cell < limits.cells; ++cell) {
    if (!(position.x() > -kOutside && position.y() > -kOutside && position.x() < width + kOutside &&
          position.y() < height + kOutside)) {
      return false;
    }
    const float base_x = std::floor(position.x());
    const float base_y = std::floor(position.y());
    const std::uint8_t* row =
        image.row(static_cast<int>(base_y) - kPatchRadius) + (static_cast<int>(base_x) - kPatchRadius);
    // s[i][j]: correlation with the image shifted by column i, row j.
    auto x00 = Isa::zero(), x10 = Isa::zero(), x01 = Isa::zero(), x11 = Isa::zero();
    auto y00 = Isa::zero(), y10 = Isa::zero(), y01 = Isa::zero(), y11 = Isa::zero();
    auto here = Isa::widen(row);
    auto right = Isa::widen(row + 1);
    for (int y = 0; y < kRows; ++y) {
      row += image.stride;
      const auto gx = Isa::load(gradient_x_ + y * kLanes);
      const auto gy = Isa::load(gradient_y_ + y * kLanes);
      x00 = Isa::multiplyAdd(x00, gx, here);
      y00 = Isa::multiplyAdd(y00, gy, here);
      x10 = Isa::multiplyAdd(x10, gx, right);
      y10 = Isa::multiplyAdd(y10, gy, right);
      here = Isa::widen(row);
      right = Isa::widen(row + 1);
      x01 = Isa::multiplyAdd(x01, gx, here);
      y01 = Isa::multiplyAdd(y01, gy, here);
      x11 = Isa::multiplyAdd(x11, gx, right);
      y11 = Isa::multiplyAdd(y11, gy, right);
    }
    const auto vectorOf = [](const auto& x, const auto& y) {
      return Eigen::Vector2f(static_cast<float>(Isa::total(x)), static_cast<float>(Isa::total(y)));
    };
    // Steps at the four corners; the step at (u, v) is their bilinear mix.
    const Eigen::Vector2f d00 = inverse_hessian_ * (template_projection_ - vectorOf(x00, y00));
    const Eigen::Vector2f d10 = inverse_hessian_ * (template_projection_ - vectorOf(x10, y10));
    const Eigen::Vector2f d01 = inverse_hessian_ * (template_projection_ - vectorOf(x01, y01));
    const Eigen::Vector2f d11 = inverse_hessian_ * (template_projection_ - vectorOf(x11, y11));
    const Eigen::Vector2f base(base_x, base_y);
    Eigen::Vector2f f = position - base;
    for (int step = 0; step < kStepsPerCell; ++step) {
      const Eigen::Vector2f top = d00 + f.x() * (d10 - d00);
      const Eigen::Vector2f bottom = d01 + f.x() * (d11 - d01);
      const Eigen::Vector2f d = top + f.y() * (bottom - top);
      f += d;
      const bool inside =
          f.x() > -kCellSlack && f.y() > -kCellSlack && f.x() < 1 + kCellSlack && f.y() < 1 + kCellSlack;
      if (inside && d.squaredNorm() < limits.stop * limits.stop) {
        position = base + f;
        return (position - guess).squaredNorm() < max_squared;
      }
      if (!inside) break;
    }
    position = base + f;
    if (!((position - guess).squaredNorm() < max_squared)) return false;
  }
  return false;
}

template bool PatchTemplate::align<simd::Native>(const ImageView&, const AlignmentLimits&,
                                                 Eigen::Vector2f&) const;
#if defined(__AVX2__) || defined(__ARM_NEON)
template bool PatchTemplate::align<simd::Scalar>(const ImageView&, const AlignmentLimits&,
                                                 Eigen::Vector2f&) const;
#endif

float PatchTemplate::correlation(const ImageView& image, const Eigen::Vector2f& position) const {
  const float base_x = std::floor(position.x());
  const float base_y = std::floor(position.y());
  const float u = position.x() - base_x;
  const float v = position.y() - base_y;
  const std::uint8_t* row =
      image.row(static_cast<int>(base_y) - kPatchRadius) + (static_cast<int>(base_x) - kPatchRadius);
  const std::uint8_t* own = centre_ - static_cast<std::ptrdiff_t>(kPatchRadius) * stride_ - kPatchRadius;
  alignas(32) float w_[kLanes]{}, i_[kLanes]{}, t_[kLanes]{}, ii[kLanes]{}, tt[kLanes]{}, it[kLanes]{};
  for (int y = 0; y < kRows; ++y, row += image.stride, own += stride_) {
    const float* w = kWindow.data() + y * kLanes;
    const std::uint8_t* below = row + image.stride;
    for (int x = 0; x < kLanes; ++x) {
      const float top = static_cast<float>(row[x]) + u * static_cast<float>(row[x + 1] - row[x]);
      const float bottom = static_cast<float>(below[x]) + u * static_cast<float>(below[x + 1] - below[x]);
      const float i = top + v * (bottom - top) - 128.0F;
      const float t = static_cast<float>(own[x]) - 128.0F;
      w_[x] += w[x];
      i_[x] += w[x] * i;
      t_[x] += w[x] * t;
      ii[x] += w[x] * i * i;
      tt[x] += w[x] * t * t;
      it[x] += w[x] * i * t;
    }
  }
  const float weight = sumOf(w_);
  const float mean_i = sumOf(i_) / weight;
  const float mean_t = sumOf(t_) / weight;
  const float var_i = sumOf(ii) / weight - mean_i * mean_i;
  const float var_t = sumOf(tt) / weight - mean_t * mean_t;
  if (!(var_i > 0) || !(var_t > 0)) return 0;
  return (sumOf(it) / weight - mean_i * mean_t) / std::sqrt(var_i * var_t);
}

}  // namespace swiftlet
