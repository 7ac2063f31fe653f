#include "estimator/frontend/patch_template.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kLanes = kPatchLanes;
// Weights in 1/16: the integer gradients are then 16 w (doubled difference), at most 4080, and all
// sums over the window stay below 2^31.
constexpr float kWeightScale = 16.0F;
// Below this smaller eigenvalue [grey^2 / px^2] (per unit weight) the position is dominated by sensor noise.
constexpr float kMinEigenvalue = 1.0F;
// Below this variance [grey^2] the template does not determine a gain.
constexpr float kMinVariance = 1.0F;
// How far outside the image the patch centre may be during alignment [px].
constexpr float kOutside = 4.0F;
// Steps within one cell; each costs only a few operations.
constexpr int kStepsPerCell = 6;
// A position this far beyond its cell is extrapolated; farther ones need a new cell.
constexpr float kCellSlack = 0.05F;

// The brightness counts as unchanged if the squared difference of the means, relative to its variance, is
// below this (chi-square with one degree of freedom: exceeded by chance in 0.1 %).
constexpr float kMaxUnchanged = 10.8F;
// Parameters of the alignment: position, gain, offset.
constexpr float kParameters = 4.0F;
// Variance of the difference of two images rounded to integers [grey^2].
constexpr float kRounding = 1.0F / 6.0F;

// A shape between square and disc, |x|^3 + |y|^3: pixels in the corners are the first to leave the feature's
// surface, but on a plane surface they are as useful as others. On image pairs a disc has 2 to 3 % more error
// under shifts and a square 2 % more under warps; with an exponent of 4 the map of a rendered flight with
// near walls has a quarter more error.
const PatchWindow kWindow =
    makePatchWindow([](float x, float y) { return std::cbrt(x * x * x + y * y * y); });

// The same weights as integers.
struct alignas(32) IntegerWindow {
  std::array<std::int16_t, kPatchSize * kLanes> weight{};
  float total = 0;  // in units of kWeightScale
};

IntegerWindow makeIntegerWindow() {
  IntegerWindow integers;
  for (std::size_t i = 0; i < kWindow.size(); ++i) {
    integers.weight[i] = static_cast<std::int16_t>(std::lround(kWindow[i] * kWeightScale));
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

template <typename Isa>
bool PatchTemplate::build(const std::uint8_t* centre, int stride) {
  centre_ = centre;
  stride_ = stride;
  auto x = Isa::zero(), y = Isa::zero(), t = Isa::zero(), tt = Isa::zero();
  auto xx = Isa::zero(), xy = Isa::zero(), yy = Isa::zero(), xt = Isa::zero(), yt = Isa::zero();
  const auto one = Isa::broadcast(1);
  const auto grey = Isa::broadcast(128);
  // Scharr's smoothing (3 10 3)/16 across each derivative gives less weight to the finest detail, which
  // bilinear interpolation distorts.
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
    Isa::store(weighted_t_ + r * kLanes, wt);
  }
  const float weight = kIntegerWindow.total;
  const auto mean = [&](const auto& sum) { return static_cast<float>(Isa::total(sum)) / weight; };
  mean_ = mean(t);
  variance_ = mean(tt) - mean_ * mean_;
  if (variance_ < kMinVariance) return false;
  Eigen::Matrix2f products;
  products << mean(xx), mean(xy), mean(xy), mean(yy);
  const Eigen::Vector2f level(mean(x), mean(y));
  const Eigen::Vector2f slope = (Eigen::Vector2f(mean(xt), mean(yt)) - mean_ * level) / variance_;
  if (!factor(products, slope, level)) return false;

  auto own_x = Isa::zero(), own_y = Isa::zero(), own_t = Isa::zero(), own_w = Isa::zero();
  row = first;
  for (int r = 0; r < kRows; ++r, row += stride) {
    const auto v = Isa::widen(row);
    own_x = Isa::multiplyAdd(own_x, Isa::load(gradient_x_ + r * kLanes), v);
    own_y = Isa::multiplyAdd(own_y, Isa::load(gradient_y_ + r * kLanes), v);
    own_t = Isa::multiplyAdd(own_t, Isa::load(weighted_t_ + r * kLanes), v);
    own_w = Isa::multiplyAdd(own_w, Isa::load(kIntegerWindow.weight.data() + r * kLanes), v);
  }
  own_ = {Isa::total(own_x), Isa::total(own_y), Isa::total(own_t), Isa::total(own_w)};
  return true;
}

template bool PatchTemplate::build<simd::Native>(const std::uint8_t*, int);
#ifdef SWIFTLET_SIMD_NATIVE
template bool PatchTemplate::build<simd::Scalar>(const std::uint8_t*, int);
#endif

bool PatchTemplate::factor(const Eigen::Matrix2f& products, const Eigen::Vector2f& slope,
                           const Eigen::Vector2f& level) {
  slope_ = slope;
  level_ = level;
  // Covariances without the components along T and 1: the Schur complement of gain and offset.
  const Eigen::Matrix2f reduced =
      products - variance_ * slope * slope.transpose() - level * level.transpose();
  // The factor 1/4 converts doubled differences to gradients.
  const float a = 0.25F * reduced(0, 0);
  const float b = 0.25F * reduced(0, 1);
  const float c = 0.25F * reduced(1, 1);
  const float least = 0.5F * (a + c) - std::sqrt(0.25F * (a - c) * (a - c) + b * b);
  if (!(least > kMinEigenvalue)) return false;
  // Residuals are projected on doubled gradients: (G G^T)^-1 G e = 2 (2G 2G^T)^-1 2G e.
  step_free_ = -2.0F * reduced.inverse();
  step_fixed_ = -2.0F * products.inverse();
  level_share_ = 1.0F + 0.5F * level.dot(step_fixed_ * level);
  return true;
}

template <typename Isa>
void PatchTemplate::visit(const ImageView& image, Cell& cell) const {
  const std::uint8_t* const first = image.row(static_cast<int>(cell.base.y()) - kPatchRadius) +
                                    (static_cast<int>(cell.base.x()) - kPatchRadius);
  for (int j = 0; j < 2; ++j) {
    auto x0 = Isa::zero(), y0 = Isa::zero(), t0 = Isa::zero(), w0 = Isa::zero();
    auto x1 = Isa::zero(), y1 = Isa::zero(), t1 = Isa::zero(), w1 = Isa::zero();
    const std::uint8_t* row = first + j * image.stride;
    for (int r = 0; r < kRows; ++r, row += image.stride) {
      const auto gx = Isa::load(gradient_x_ + r * kLanes);
      const auto gy = Isa::load(gradient_y_ + r * kLanes);
      const auto wt = Isa::load(weighted_t_ + r * kLanes);
      const auto w = Isa::load(kIntegerWindow.weight.data() + r * kLanes);
      const auto here = Isa::widen(row);
      const auto right = Isa::widen(row + 1);
      x0 = Isa::multiplyAdd(x0, gx, here);
      y0 = Isa::multiplyAdd(y0, gy, here);
      t0 = Isa::multiplyAdd(t0, wt, here);
      w0 = Isa::multiplyAdd(w0, w, here);
      x1 = Isa::multiplyAdd(x1, gx, right);
      y1 = Isa::multiplyAdd(y1, gy, right);
      t1 = Isa::multiplyAdd(t1, wt, right);
      w1 = Isa::multiplyAdd(w1, w, right);
    }
    const auto at = static_cast<std::size_t>(2 * j);
    cell.sums[at] = {Isa::total(x0), Isa::total(y0), Isa::total(t0), Isa::total(w0)};
    cell.sums[at + 1] = {Isa::total(x1), Isa::total(y1), Isa::total(t1), Isa::total(w1)};
  }
}

// Means over the window of the difference I - T times 2G, T - mean and 1.
Eigen::Vector4f PatchTemplate::projection(const Sums& sums) const {
  Eigen::Vector4f e;
  // Subtract integers, which is exact, before converting to float.
  for (std::size_t i = 0; i < 4; ++i) {
    e[static_cast<Eigen::Index>(i)] = static_cast<float>(sums[i] - own_[i]) / kIntegerWindow.total;
  }
  e[2] -= mean_ * e[3];
  return e;
}

Eigen::Vector2f PatchTemplate::step(const Eigen::Vector4f& e, Light light) const {
  if (light == Light::kFixed) return step_fixed_ * e.head<2>();
  return step_free_ * (e.head<2>() - slope_ * e[2] - level_ * e[3]);
}

bool PatchTemplate::iterate(const Cell& cell, Light light, float stop, Eigen::Vector2f& position) const {
  // Steps at the cell's four corners; the step at (u, v) is their bilinear interpolation.
  std::array<Eigen::Vector2f, 4> d;
  for (std::size_t i = 0; i < 4; ++i) d[i] = step(projection(cell.sums[i]) + cell.correction, light);
  Eigen::Vector2f f = position - cell.base;
  for (int k = 0; k < kStepsPerCell; ++k) {
    const Eigen::Vector2f top = d[0] + f.x() * (d[1] - d[0]);
    const Eigen::Vector2f bottom = d[2] + f.x() * (d[3] - d[2]);
    const Eigen::Vector2f move = top + f.y() * (bottom - top);
    f += move;
    position = cell.base + f;
    const bool inside =
        f.x() > -kCellSlack && f.y() > -kCellSlack && f.x() < 1 + kCellSlack && f.y() < 1 + kCellSlack;
    if (!inside) return false;
    if (move.squaredNorm() < stop * stop) return true;
  }
  return false;
}

template <typename Isa>
bool PatchTemplate::settle(const ImageView& image, const AlignmentLimits& limits, Light light,
                           const Eigen::Vector2f& guess, Cell& cell, Eigen::Vector2f& position) const {
  const float max_squared = limits.max_displacement * limits.max_displacement;
  const auto width = static_cast<float>(image.width - 1);
  const auto height = static_cast<float>(image.height - 1);
  for (int k = 0; k < limits.cells; ++k) {
    if (!(position.x() > -kOutside && position.y() > -kOutside && position.x() < width + kOutside &&
          position.y() < height + kOutside)) {
      return false;
    }
    if (k > 0 || !cell.visited) {
      cell.base = {std::floor(position.x()), std::floor(position.y())};
      cell.visited = true;
      visit<Isa>(image, cell);
    }
    const bool settled = iterate(cell, light, limits.stop, position);
    if (!((position - guess).squaredNorm() < max_squared)) return false;
    if (settled) return true;
  }
  return true;
}

template <typename Isa>
bool PatchTemplate::align(const ImageView& image, const AlignmentLimits& limits, Finish finish,
                          Eigen::Vector2f& position) const {
  const Eigen::Vector2f guess = position;
  Cell cell;
  if (!settle<Isa>(image, limits, Light::kFree, guess, cell, position)) return false;
  if (finish == Finish::kCoarse) return true;
  const Light light = correct(image, position, cell);
  Eigen::Vector2f better = position;
  if (settle<Isa>(image, limits, light, guess, cell, better)) position = better;
  return true;
}

template bool PatchTemplate::align<simd::Native>(const ImageView&, const AlignmentLimits&, Finish,
                                                 Eigen::Vector2f&) const;
#ifdef SWIFTLET_SIMD_NATIVE
template bool PatchTemplate::align<simd::Scalar>(const ImageView&, const AlignmentLimits&, Finish,
                                                 Eigen::Vector2f&) const;
#endif

namespace {

// Cubic convolution (Keys, 1981, a = -1/2): four taps, exact for quadratics.
std::array<float, 4> cubicWeights(float t) {
  return {0.5F * t * (-1.0F + t * (2.0F - t)), 1.0F + 0.5F * t * t * (3.0F * t - 5.0F),
          0.5F * t * (1.0F + t * (4.0F - 3.0F * t)), 0.5F * t * t * (t - 1.0F)};
}

}  // namespace

PatchTemplate::Light PatchTemplate::correct(const ImageView& image, const Eigen::Vector2f& position,
                                            Cell& cell) const {
  const Eigen::Vector2f f = position - cell.base;
  const std::array<float, 4> u = cubicWeights(f.x());
  const std::array<float, 4> v = cubicWeights(f.y());
  constexpr int kRowsRead = kRows + 3;
  alignas(32) float across[kRowsRead * kLanes];
  const std::uint8_t* row = image.row(static_cast<int>(cell.base.y()) - kPatchRadius - 1) +
                            (static_cast<int>(cell.base.x()) - kPatchRadius - 1);
  for (int y = 0; y < kRowsRead; ++y, row += image.stride) {
    for (int x = 0; x < kLanes; ++x) {
      across[y * kLanes + x] = u[0] * static_cast<float>(row[x]) + u[1] * static_cast<float>(row[x + 1]) +
                               u[2] * static_cast<float>(row[x + 2]) + u[3] * static_cast<float>(row[x + 3]);
    }
  }
  const std::uint8_t* own = centre_ - static_cast<std::ptrdiff_t>(kPatchRadius) * stride_ - kPatchRadius;
  alignas(32) float sum_x[kLanes]{}, sum_y[kLanes]{}, sum_t[kLanes]{}, sum_w[kLanes]{}, squares[kLanes]{};
  for (int y = 0; y < kRows; ++y, own += stride_) {
    const float* a = across + y * kLanes;
    const float* w = kWindow.data() + y * kLanes;
    const std::int16_t* gx = gradient_x_ + y * kLanes;
    const std::int16_t* gy = gradient_y_ + y * kLanes;
    for (int x = 0; x < kLanes; ++x) {
      const float t = static_cast<float>(own[x]);
      const float e =
          v[0] * a[x] + v[1] * a[x + kLanes] + v[2] * a[x + 2 * kLanes] + v[3] * a[x + 3 * kLanes] - t;
      const float we = w[x] * e;
      sum_x[x] += static_cast<float>(gx[x]) * e;
      sum_y[x] += static_cast<float>(gy[x]) * e;
      sum_t[x] += we * (t - 128.0F);
      sum_w[x] += we;
      squares[x] += we * e;
    }
  }
  const float pixels = kIntegerWindow.total / kWeightScale;
  Eigen::Vector4f e(sumOf(sum_x) / kWeightScale, sumOf(sum_y) / kWeightScale, sumOf(sum_t), sumOf(sum_w));
  e /= pixels;
  e[2] -= mean_ * e[3];
  std::array<Eigen::Vector4f, 4> corner;
  for (std::size_t i = 0; i < 4; ++i) corner[i] = projection(cell.sums[i]);
  const Eigen::Vector4f top = corner[0] + f.x() * (corner[1] - corner[0]);
  const Eigen::Vector4f bottom = corner[2] + f.x() * (corner[3] - corner[2]);
  cell.correction = e - (top + f.y() * (bottom - top));
  // e[3] is the offset; its variance is that of the noise divided by pixels and level_share_.
  const float unexplained =
      std::max(sumOf(squares) / pixels - e[2] * e[2] / variance_ - e[3] * e[3], kRounding);
  const float evidence = e[3] * e[3] * level_share_ * (pixels - kParameters) / unexplained;
  return evidence < kMaxUnchanged ? Light::kFixed : Light::kFree;
}

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
