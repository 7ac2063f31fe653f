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
// Prior on each element of the step of A: grey noise 3 over 0.03, squared. It has an effect only where the
// texture does not determine the affine part.
constexpr float kAffinePrior = 1.0e4F;
// With determinants outside this range the template no longer describes the image.
constexpr float kMinDeterminant = 0.1F;
constexpr float kMaxDeterminant = 10.0F;
// Iterations stop at steps below this [px].
constexpr float kStop = 0.01F;
// Grey values are taken relative to the middle of their range, so that sums are small.
constexpr std::int16_t kMiddle = 128;

// A disc, because pixels in the corners of the square are the first to leave the feature's surface. On
// rendered flights the full square gives young tracks 5 % less error, but old ones (80 frames) a third more
// outliers.
const PatchWindow kWindow = makePatchWindow([](float x, float y) { return std::sqrt(x * x + y * y); });

// Weights are in 1/8 and grey values relative to 128 too, so all sums over the window stay below 2^31 and are
// exact.
constexpr int kWeightUnits = 8;
constexpr int kGreyUnits = 8;

constexpr std::size_t kLaneCount = static_cast<std::size_t>(kRows) * kLanes;
using Plane = std::array<std::int16_t, kLaneCount>;

const struct alignas(32) IntegerWindow {
  IntegerWindow() {
    for (std::size_t i = 0; i < kLaneCount; ++i) {
      weight[i] = static_cast<std::int16_t>(std::lround(kWindow[i] * kWeightUnits));
    }
    for (std::size_t c = 0; c < kPatchSize; ++c) {
      column[c] = static_cast<std::int16_t>(static_cast<int>(c) - kPatchRadius);
    }
  }
  Plane weight{};
  std::array<std::int16_t, kLanes> column{};
} kIntegerWindow;

/// Planes of the template, weighted.
struct alignas(32) Pattern {
  Plane value;  ///< grey minus kMiddle
  Plane x, y;   ///< doubled gradients
};

template <typename Isa>
void readTemplate(const ImageView& patch, int cx, int cy, Pattern& pattern) {
  const auto middle = Isa::broadcast(kMiddle);
  for (int r = 0; r < kRows; ++r) {
    const std::uint8_t* row = patch.row(cy - kPatchRadius + r) + (cx - kPatchRadius);
    // Complete vectors: columns beyond the window have weight zero.
    const int at = r * kLanes;
    const auto w = Isa::load(kIntegerWindow.weight.data() + at);
    const auto x = Isa::subtract(Isa::widen(row + 1), Isa::widen(row - 1));
    const auto y = Isa::subtract(Isa::widen(row + patch.stride), Isa::widen(row - patch.stride));
    Isa::store(pattern.value.data() + at, Isa::multiply(w, Isa::subtract(Isa::widen(row), middle)));
    Isa::store(pattern.x.data() + at, Isa::multiply(w, x));
    Isa::store(pattern.y.data() + at, Isa::multiply(w, y));
  }
}

// `image`: the image under the window, in kGreyUnits.
template <typename Isa>
AffineTemplate::Sums sumWindow(const Pattern& pattern, const Plane& image) {
  auto one = Isa::zero(), square = Isa::zero(), value = Isa::zero();
  auto x = Isa::zero(), xx = Isa::zero(), xy = Isa::zero();
  auto y = Isa::zero(), yx = Isa::zero(), yy = Isa::zero();
  const auto column = Isa::load(kIntegerWindow.column.data());
  for (int r = 0; r < kRows; ++r) {
    const int at = r * kLanes;
    const auto s = Isa::load(image.data() + at);
    const auto w = Isa::load(kIntegerWindow.weight.data() + at);
    const auto gx = Isa::load(pattern.x.data() + at);
    const auto gy = Isa::load(pattern.y.data() + at);
    const auto s_column = Isa::multiply(s, column);
    const auto s_row = Isa::multiply(s, Isa::broadcast(static_cast<std::int16_t>(r - kPatchRadius)));
    one = Isa::multiplyAdd(one, w, s);
    square = Isa::multiplyAdd(square, Isa::multiply(w, s), s);
    value = Isa::multiplyAdd(value, Isa::load(pattern.value.data() + at), s);
    x = Isa::multiplyAdd(x, gx, s);
    y = Isa::multiplyAdd(y, gy, s);
    xx = Isa::multiplyAdd(xx, gx, s_column);
    xy = Isa::multiplyAdd(xy, gx, s_row);
    yx = Isa::multiplyAdd(yx, gy, s_column);
    yy = Isa::multiplyAdd(yy, gy, s_row);
  }
  constexpr float kUnit = 1.0F / (kWeightUnits * kGreyUnits);
  const auto total = [](const auto& sum, float unit) { return unit * static_cast<float>(Isa::total(sum)); };
  AffineTemplate::Sums sums;
  sums.one = total(one, kUnit);
  sums.square = total(square, kUnit / kGreyUnits);
  sums.value = total(value, kUnit);
  constexpr float kHalf = 0.5F * kUnit;  // gradients are doubled
  sums.moment << total(x, kHalf), total(y, kHalf), total(xx, kHalf), total(xy, kHalf), total(yx, kHalf),
      total(yy, kHalf);
  return sums;
}

}  // namespace

bool AffineTemplate::build(const ImageView& patch, int cx, int cy) {
  Pattern pattern;
  readTemplate<simd::Native>(patch, cx, cy, pattern);
  // Parameters: t_x, t_y, then dA row by row; the last two are gain and offset.
  Eigen::Matrix<float, 8, 8> H = Eigen::Matrix<float, 8, 8>::Zero();
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kPatchSize; ++c) {
      const auto i = static_cast<std::size_t>(r * kLanes + c);
      const auto weight = static_cast<float>(kIntegerWindow.weight[i]);
      if (weight <= 0) continue;
      const auto x = static_cast<float>(c - kPatchRadius);
      const auto y = static_cast<float>(r - kPatchRadius);
      Eigen::Matrix<float, 8, 1> j;
      const float gx = static_cast<float>(pattern.x[i]) / (2 * weight);
      const float gy = static_cast<float>(pattern.y[i]) / (2 * weight);
      j << gx, gy, gx * x, gx * y, gy * x, gy * y, static_cast<float>(pattern.value[i]) / weight, 1.0F;
      H.noalias() += (weight / kWeightUnits) * j * j.transpose();
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
  Plane plane;
  for (int r = 0; r < kRows; ++r) {
    const std::uint8_t* row = patch.row(cy - kPatchRadius + r) + (cx - kPatchRadius);
    for (int c = 0; c < kLanes; ++c) {
      plane[static_cast<std::size_t>(r * kLanes + c)] =
          static_cast<std::int16_t>((row[c] - kMiddle) * kGreyUnits);
    }
  }
  own_ = sumWindow<simd::Native>(pattern, plane);
  plane.fill(kGreyUnits);
  constant_ = sumWindow<simd::Native>(pattern, plane);
  inverse_hessian_ = factor.solve(Eigen::Matrix<float, 6, 6>::Identity());
  return inverse_hessian_.allFinite();
}

namespace {

struct Light {
  float gain = 1;
  float offset = 0;  ///< image minus gain times template, both minus kMiddle
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

// Whether the window and the pixels needed to interpolate it lie in the image.
bool windowInside(const ImageView& image, const AffineTemplate::Estimate& e) {
  const Eigen::Vector2f half =
      e.warp.cwiseAbs() * Eigen::Vector2f::Constant(static_cast<float>(kPatchRadius));
  return e.position.x() - half.x() >= 0 && e.position.y() - half.y() >= 0 &&
         e.position.x() + half.x() < static_cast<float>(image.width - 1) &&
         e.position.y() + half.y() < static_cast<float>(image.height - 1);
}

// Samples the image under the window, in kGreyUnits. False if its rows become too long.
template <typename Isa>
bool sampleWindow(const ImageView& image, const AffineTemplate::Estimate& e, Plane& plane) {
  if (!UprightSampler<Isa>().sample(image, e.position, e.warp, kPatchRadius, plane.data())) {
    AffineSampler<Isa> sampler;
    if (!sampler.prepare(e.warp, kPatchRadius)) return false;
    for (int r = 0; r < kRows; ++r) {
      Isa::store(plane.data() + r * kLanes, sampler.sample(image, e.position, r - kPatchRadius));
    }
  }
  constexpr int kUnits = SamplerParts<Isa>::kUnitsPerGrey;
  const auto middle = Isa::broadcast(kMiddle * kUnits);
  const auto to_units = Isa::broadcast((1 << 15) * kGreyUnits / kUnits);
  for (int r = 0; r < kRows; ++r) {
    std::int16_t* const row = plane.data() + r * kLanes;
    Isa::store(row, Isa::multiplyFraction(Isa::subtract(Isa::load(row), middle), to_units));
  }
  return true;
}

}  // namespace

template <typename Isa>
bool AffineTemplate::align(const ImageView& patch, int cx, int cy, const ImageView& image, int iterations,
                           Estimate& estimate) const {
  Pattern pattern;
  readTemplate<Isa>(patch, cx, cy, pattern);
  alignas(32) Plane plane;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (!windowInside(image, estimate) || !sampleWindow<Isa>(image, estimate, plane)) return false;
    const Sums sums = sumWindow<Isa>(pattern, plane);
    const Light light = fitLight(sums, own_, constant_);
    estimate.correlation = light.correlation;
    if (!(light.gain > 0.1F)) return false;
    // Moments of the residual: image minus gain times template minus offset.
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
    // The edge of the patch moves by the affine part times its radius.
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
