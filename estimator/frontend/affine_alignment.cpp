#include "estimator/frontend/affine_alignment.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/frontend/affine_sampler.hpp"

namespace swiftlet {
namespace {

constexpr int kLanes = kPatchLanes;
constexpr int kRows = kPatchSize;
// Prior on each element of the step of A: grey noise 3 over 0.03, squared. It matters only where
// texture leaves a direction of the affine part open.
constexpr float kAffinePrior = 1.0e4F;
// Determinants outside mean that the template no longer describes what is seen.
constexpr float kMinDeterminant = 0.1F;
constexpr float kMaxDeterminant = 10.0F;
// Steps below this [px] end the iterations.
constexpr float kStop = 0.01F;
// Greys are taken from the middle of their range, where floats are finest.
constexpr float kMiddle = 128.0F;

// A disc: pixels in the corners of the square are the first to leave the surface that carries the
// feature. On rendered flights the full square gives young tracks 5 % less error and old ones (80
// frames) a third more outliers.
const PatchWindow kWindow = makePatchWindow([](float x, float y) { return std::sqrt(x * x + y * y); });

struct Gradients {
  alignas(32) float value[kRows * kLanes];  ///< less kMiddle
  alignas(32) float x[kRows * kLanes];      ///< weighted
  alignas(32) float y[kRows * kLanes];      ///< weighted
};

template <typename Isa>
void readTemplate(const ImageView& patch, int cx, int cy, Gradients& g) {
  const auto middle = Isa::broadcast(static_cast<std::int16_t>(kMiddle));
  const auto half = Isa::broadcastFloat(0.5F);
  for (int r = 0; r < kRows; ++r) {
    const std::uint8_t* row = patch.row(cy - kPatchRadius + r) + (cx - kPatchRadius);
    // Whole vectors: the columns beyond the window have weight zero.
    const int at = r * kLanes;
    const auto w = Isa::multiply(half, Isa::loadFloats(kWindow.data() + at));
    const auto x = Isa::subtract(Isa::widen(row + 1), Isa::widen(row - 1));
    const auto y = Isa::subtract(Isa::widen(row + patch.stride), Isa::widen(row - patch.stride));
    Isa::storeFloats(g.value + at, Isa::toFloats(Isa::subtract(Isa::widen(row), middle)));
    Isa::storeFloats(g.x + at, Isa::multiply(w, Isa::toFloats(x)));
    Isa::storeFloats(g.y + at, Isa::multiply(w, Isa::toFloats(y)));
  }
}

const std::array<float, kLanes> kColumn = [] {
  std::array<float, kLanes> column{};
  for (std::size_t c = 0; c < kPatchSize; ++c)
    column[c] = static_cast<float>(static_cast<int>(c) - kPatchRadius);
  return column;
}();

// `row`: function of the row's index to the image's sixteen values there.
template <typename Isa, typename Rows>
AffineTemplate::Sums sumWindow(const Gradients& g, const Rows& row) {
  auto one = Isa::zeroFloats(), square = Isa::zeroFloats(), value = Isa::zeroFloats();
  auto x0 = Isa::zeroFloats(), y0 = Isa::zeroFloats(), x1 = Isa::zeroFloats(), y1 = Isa::zeroFloats();
  for (int r = 0; r < kRows; ++r) {
    const int at = r * kLanes;
    const auto s = row(r);
    const auto w = Isa::loadFloats(kWindow.data() + at);
    const auto ws = Isa::multiply(w, s);
    one = Isa::multiplyAdd(one, w, s);
    square = Isa::multiplyAdd(square, ws, s);
    value = Isa::multiplyAdd(value, ws, Isa::loadFloats(g.value + at));
    const auto gx = Isa::loadFloats(g.x + at);
    const auto gy = Isa::loadFloats(g.y + at);
    const auto rs = Isa::multiply(Isa::broadcastFloat(static_cast<float>(r - kPatchRadius)), s);
    x0 = Isa::multiplyAdd(x0, gx, s);
    y0 = Isa::multiplyAdd(y0, gy, s);
    x1 = Isa::multiplyAdd(x1, gx, rs);
    y1 = Isa::multiplyAdd(y1, gy, rs);
  }
  // Fused with zero: a plain product might or might not be fused with the sum over lanes.
  const auto column = Isa::loadFloats(kColumn.data());
  const auto column_x = Isa::multiplyAdd(Isa::zeroFloats(), column, x0);
  const auto column_y = Isa::multiplyAdd(Isa::zeroFloats(), column, y0);
  AffineTemplate::Sums sums;
  sums.one = Isa::total(one);
  sums.square = Isa::total(square);
  sums.value = Isa::total(value);
  sums.moment << Isa::total(x0), Isa::total(y0), Isa::total(column_x), Isa::total(x1), Isa::total(column_y),
      Isa::total(y1);
  return sums;
}

}  // namespace

bool AffineTemplate::build(const ImageView& patch, int cx, int cy) {
  const float* window = kWindow.data();
  Gradients g;
  readTemplate<simd::Native>(patch, cx, cy, g);
  // Parameters: t_x, t_y, then dA row by row; the last two are gain and offset.
  Eigen::Matrix<float, 8, 8> H = Eigen::Matrix<float, 8, 8>::Zero();
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kPatchSize; ++c) {
      const int i = r * kLanes + c;
      const float w = window[i];
      if (w <= 0) continue;
      const auto x = static_cast<float>(c - kPatchRadius);
      const auto y = static_cast<float>(r - kPatchRadius);
      Eigen::Matrix<float, 8, 1> j;
      const float gx = g.x[i] / w;
      const float gy = g.y[i] / w;
      j << gx, gy, gx * x, gx * y, gy * x, gy * y, g.value[i], 1.0F;
      H.noalias() += w * j * j.transpose();
    }
  }
  const float determinant = H(6, 6) * H(7, 7) - H(6, 7) * H(7, 6);
  if (!(determinant > H(7, 7) * H(7, 7))) return false;  // variance below 1 grey^2
  Eigen::Matrix<float, 6, 6> reduced = H.topLeftCorner<6, 6>();
  const Eigen::Matrix2f light = H.bottomRightCorner<2, 2>().inverse();
  const Eigen::Matrix<float, 6, 2> cross = H.topRightCorner<6, 2>();
  reduced -= cross * light * cross.transpose();
  for (int k = 2; k < 6; ++k) reduced(k, k) += kAffinePrior;
  const Eigen::LLT<Eigen::Matrix<float, 6, 6>> factor(reduced);
  if (factor.info() != Eigen::Success) return false;
  own_ = sumWindow<simd::Native>(g, [&g](int r) { return simd::Native::loadFloats(g.value + r * kLanes); });
  constant_ = sumWindow<simd::Native>(g, [](int) { return simd::Native::broadcastFloat(1); });
  inverse_hessian_ = factor.solve(Eigen::Matrix<float, 6, 6>::Identity());
  return inverse_hessian_.allFinite();
}

namespace {

struct Light {
  float gain = 1;
  float offset = 0;  ///< image less gain times template, both less kMiddle
  float correlation = 0;
};

// Weighted regression of the image on the template. `constant`: sums of an image that is 1 everywhere.
Light fitLight(const AffineTemplate::Sums& image, const AffineTemplate::Sums& pattern,
               const AffineTemplate::Sums& constant) {
  const float n = 1.0F / constant.one;
  const float mean_t = pattern.one * n;
  const float mean_i = image.one * n;
  const float var_t = pattern.square * n - mean_t * mean_t;
  const float var_i = image.square * n - mean_i * mean_i;
  const float covariance = image.value * n - mean_t * mean_i;
  Light light;
  if (!(var_t > 0) || !(var_i > 0)) return light;
  light.gain = covariance / var_t;
  light.offset = mean_i - light.gain * mean_t;
  light.correlation = covariance / std::sqrt(var_t * var_i);
  return light;
}

// The window and the pixels that interpolate it lie in the image.
bool windowInside(const ImageView& image, const AffineTemplate::Estimate& e) {
  const Eigen::Vector2f half =
      e.warp.cwiseAbs() * Eigen::Vector2f::Constant(static_cast<float>(kPatchRadius));
  return e.position.x() - half.x() >= 0 && e.position.y() - half.y() >= 0 &&
         e.position.x() + half.x() < static_cast<float>(image.width - 1) &&
         e.position.y() + half.y() < static_cast<float>(image.height - 1);
}

}  // namespace

template <typename Isa>
bool AffineTemplate::align(const ImageView& patch, int cx, int cy, const ImageView& image, int iterations,
                           Estimate& estimate) const {
  Gradients g;
  readTemplate<Isa>(patch, cx, cy, g);
  const auto to_grey = Isa::broadcastFloat(1.0F / AffineSampler<Isa>::kUnitsPerGrey);
  const auto middle = Isa::broadcast(static_cast<std::int16_t>(kMiddle * AffineSampler<Isa>::kUnitsPerGrey));
  AffineSampler<Isa> sampler;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (!windowInside(image, estimate) || !sampler.prepare(estimate.warp, kPatchRadius)) return false;
    const Sums sums = sumWindow<Isa>(g, [&](int r) {
      const auto sampled = sampler.sample(image, estimate.position, r - kPatchRadius);
      return Isa::multiply(Isa::toFloats(Isa::subtract(sampled, middle)), to_grey);
    });
    const Light light = fitLight(sums, own_, constant_);
    estimate.correlation = light.correlation;
    if (!(light.gain > 0.1F)) return false;
    // Of the residual: image less gain times template less offset.
    const Eigen::Matrix<float, 6, 1> moment =
        sums.moment - light.gain * own_.moment - light.offset * constant_.moment;
    const Eigen::Matrix<float, 6, 1> step = inverse_hessian_ * moment / light.gain;
    Eigen::Matrix2f change;
    change << 1 + step[2], step[3], step[4], 1 + step[5];
    const float determinant = change.determinant();
    if (!(determinant > 0.25F && determinant < 4.0F)) return false;
    estimate.warp = estimate.warp * change.inverse();
    estimate.position -= estimate.warp * step.head<2>();
    const float size = estimate.warp.determinant();
    if (!(size > kMinDeterminant && size < kMaxDeterminant)) return false;
    // The rim of the patch moves by the affine part times its radius.
    const float rim = step.tail<4>().cwiseAbs().maxCoeff() * static_cast<float>(kPatchRadius);
    if (step.head<2>().squaredNorm() < kStop * kStop && rim < 3 * kStop) break;
  }
  return true;
}

template bool AffineTemplate::align<simd::Native>(const ImageView&, int, int, const ImageView&, int,
                                                  Estimate&) const;
#ifdef SWIFTLET_SIMD_NATIVE
template bool AffineTemplate::align<simd::Scalar>(const ImageView&, int, int, const ImageView&, int,
                                                  Estimate&) const;
#endif

}  // namespace swiftlet
