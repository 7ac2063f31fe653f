#include "estimator/frontend/affine_alignment.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

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

// A disc: pixels in the corners of the square are the first to leave the surface that carries the
// feature. On rendered flights the full square gives young tracks 5 % less error and old ones (80
// frames) a third more outliers.
const PatchWindow kWindow = makePatchWindow([](float x, float y) { return std::sqrt(x * x + y * y); });

using Vector6f = Eigen::Matrix<float, 6, 1>;

struct Gradients {
  alignas(32) float value[kRows * kLanes];
  alignas(32) float x[kRows * kLanes];  ///< weighted
  alignas(32) float y[kRows * kLanes];  ///< weighted
};

void readTemplate(const ImageView& patch, int cx, int cy, Gradients& g) {
  const float* window = kWindow.data();
  for (int r = 0; r < kRows; ++r) {
    const std::uint8_t* row = patch.row(cy - kPatchRadius + r) + (cx - kPatchRadius);
    const std::uint8_t* above = row - patch.stride;
    const std::uint8_t* below = row + patch.stride;
    // Whole vectors: the columns beyond the window have weight zero.
    for (int c = 0; c < kLanes; ++c) {
      const int i = r * kLanes + c;
      g.value[i] = static_cast<float>(row[c]);
      g.x[i] = 0.5F * window[i] * static_cast<float>(row[c + 1] - row[c - 1]);
      g.y[i] = 0.5F * window[i] * static_cast<float>(below[c] - above[c]);
    }
  }
}

}  // namespace

bool AffineTemplate::build(const ImageView& patch, int cx, int cy) {
  const float* window = kWindow.data();
  Gradients g;
  readTemplate(patch, cx, cy, g);
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
      j << gx, gy, gx * x, gx * y, gy * x, gy * y, g.value[i] - 128.0F, 1.0F;
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
  inverse_hessian_ = factor.solve(Eigen::Matrix<float, 6, 6>::Identity());
  return inverse_hessian_.allFinite();
}

namespace {

// Image values under the warped window; false when any lies outside.
bool sampleWindow(const ImageView& image, const AffineTemplate::Estimate& e, float* value) {
  const Eigen::Vector2f half =
      e.warp.cwiseAbs() * Eigen::Vector2f::Constant(static_cast<float>(kPatchRadius));
  if (!(e.position.x() - half.x() >= 0 && e.position.y() - half.y() >= 0 &&
        e.position.x() + half.x() < static_cast<float>(image.width - 1) &&
        e.position.y() + half.y() < static_cast<float>(image.height - 1))) {
    return false;
  }
  // 16.16 fixed point keeps the inner loop free of rounding calls.
  constexpr float kOne = 65536.0F;
  constexpr std::int32_t kHalfWeight = 128;
  const auto step_x = static_cast<std::int32_t>(e.warp(0, 0) * kOne);
  const auto step_y = static_cast<std::int32_t>(e.warp(1, 0) * kOne);
  for (int r = 0; r < kRows; ++r) {
    const Eigen::Vector2f start = e.position + e.warp * Eigen::Vector2f(-static_cast<float>(kPatchRadius),
                                                                        static_cast<float>(r - kPatchRadius));
    // Half of the 1/256 px to which the weights are cut.
    auto x = static_cast<std::int32_t>(start.x() * kOne) + kHalfWeight;
    auto y = static_cast<std::int32_t>(start.y() * kOne) + kHalfWeight;
    for (int c = 0; c < kPatchSize; ++c, x += step_x, y += step_y) {
      const std::uint8_t* p = image.data + static_cast<std::ptrdiff_t>(y >> 16) * image.stride + (x >> 16);
      const int u = (x >> 8) & 255;
      const int v = (y >> 8) & 255;
      const int top = p[0] * (256 - u) + p[1] * u;
      const int bottom = p[image.stride] * (256 - u) + p[image.stride + 1] * u;
      value[r * kLanes + c] = static_cast<float>(top * (256 - v) + bottom * v) * (1.0F / kOne);
    }
  }
  return true;
}

struct Light {
  float gain = 1;
  float offset = 0;
  float correlation = 0;
};

// Weighted regression of the image on the template.
Light fitLight(const float* value, const float* image) {
  const float* window = kWindow.data();
  std::array<float, kLanes> w{}, t{}, i{}, tt{}, ii{}, ti{};
  for (int k = 0; k < kRows; ++k) {
    for (std::size_t c = 0; c < kLanes; ++c) {
      const std::size_t at = static_cast<std::size_t>(k * kLanes) + c;
      const float a = value[at] - 128.0F;
      const float b = image[at] - 128.0F;
      w[c] += window[at];
      t[c] += window[at] * a;
      i[c] += window[at] * b;
      tt[c] += window[at] * a * a;
      ii[c] += window[at] * b * b;
      ti[c] += window[at] * a * b;
    }
  }
  const auto sum = [](const std::array<float, kLanes>& v) {
    float s = 0;
    for (const float x : v) s += x;
    return s;
  };
  const float n = 1.0F / sum(w);
  const float mean_t = sum(t) * n;
  const float mean_i = sum(i) * n;
  const float var_t = sum(tt) * n - mean_t * mean_t;
  const float var_i = sum(ii) * n - mean_i * mean_i;
  const float covariance = sum(ti) * n - mean_t * mean_i;
  Light light;
  if (!(var_t > 0) || !(var_i > 0)) return light;
  light.gain = covariance / var_t;
  light.offset = mean_i + 128.0F - light.gain * (mean_t + 128.0F);
  light.correlation = covariance / std::sqrt(var_t * var_i);
  return light;
}

}  // namespace

bool AffineTemplate::align(const ImageView& patch, int cx, int cy, const ImageView& image, int iterations,
                           Estimate& estimate) const {
  Gradients g{};
  readTemplate(patch, cx, cy, g);
  alignas(32) float sampled[kRows * kLanes]{};
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (!sampleWindow(image, estimate, sampled)) return false;
    const Light light = fitLight(g.value, sampled);
    estimate.correlation = light.correlation;
    if (!(light.gain > 0.1F)) return false;
    // Moments of the residual times the weighted gradients, lane by lane.
    std::array<float, kLanes> x0{}, y0{}, x1{}, y1{};
    for (int r = 0; r < kRows; ++r) {
      const auto row = static_cast<float>(r - kPatchRadius);
      for (std::size_t c = 0; c < kLanes; ++c) {
        const std::size_t at = static_cast<std::size_t>(r * kLanes) + c;
        const float residual = sampled[at] - light.gain * g.value[at] - light.offset;
        const float px = g.x[at] * residual;
        const float py = g.y[at] * residual;
        x0[c] += px;
        y0[c] += py;
        x1[c] += row * px;
        y1[c] += row * py;
      }
    }
    Vector6f moment = Vector6f::Zero();
    for (std::size_t c = 0; c < kPatchSize; ++c) {
      const float column = static_cast<float>(c) - static_cast<float>(kPatchRadius);
      moment[0] += x0[c];
      moment[1] += y0[c];
      moment[2] += column * x0[c];
      moment[3] += x1[c];
      moment[4] += column * y0[c];
      moment[5] += y1[c];
    }
    const Vector6f step = inverse_hessian_ * moment / light.gain;
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

}  // namespace swiftlet
