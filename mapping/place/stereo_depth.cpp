#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "mapping/place/feature_depth.hpp"

namespace swiftlet {
namespace {

// Patches: 8 x 8 at half resolution for the search (16 x 16 px of the image), 9 x 9 px for the refinement.
constexpr int kSearchSide = 8;
constexpr int kSearchArea = kSearchSide * kSearchSide;
constexpr int kRefineRadius = 4;
constexpr int kRefineSide = 2 * kRefineRadius + 1;
constexpr int kRefineArea = kRefineSide * kRefineSide;
constexpr int kMaxSamples = 200;
// Spacing of the samples [px at full resolution].
constexpr double kSampleStep = 2.0;
// The search requires less than the refinement, because sampling at whole pixels lowers the correlation.
constexpr float kMinSearchCorrelation = 0.6F;
// Samples within this many of the best belong to the same peak.
constexpr int kPeakWidth = 3;
// Least contrast of a patch [grey levels, standard deviation].
constexpr float kMinContrast = 3.0F;
constexpr int kRefineSteps = 8;
constexpr double kRefineConverged = 0.02;  // px
constexpr double kMaxRefineShift = 2.5;    // px from where the search ended
// Step of the numeric warp [px].
constexpr double kWarpStep = 4.0;
// The search's patch is warped for this share of the largest inverse distance.
constexpr double kMiddling = 0.1;
// Matches up to this far beyond infinity are distant points with noise [sigma].
constexpr double kBeyondInfinity = 2.0;
constexpr int kDepthSteps = 4;

float bilinear(const ImageView& image, double x, double y) {
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const auto fx = static_cast<float>(x - ix);
  const auto fy = static_cast<float>(y - iy);
  const std::uint8_t* top = image.row(iy) + ix;
  const std::uint8_t* bottom = top + image.stride;
  const float upper = static_cast<float>(top[0]) + fx * static_cast<float>(top[1] - top[0]);
  const float lower = static_cast<float>(bottom[0]) + fx * static_cast<float>(bottom[1] - bottom[0]);
  return upper + fy * (lower - upper);
}

bool inside(const ImageView& image, double x, double y, double border) {
  return x >= border && y >= border && x < image.width - 1 - border && y < image.height - 1 - border;
}

void halve(const ImageView& from, std::uint8_t* to, int width, int height) {
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* a = from.row(2 * y);
    const std::uint8_t* b = from.row(2 * y + 1);
    std::uint8_t* out = to + static_cast<std::ptrdiff_t>(y) * width;
    for (int x = 0; x < width; ++x) {
      out[x] = static_cast<std::uint8_t>((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
    }
  }
}

// Zero-mean integer template of the search; a correlation takes three sums.
struct SearchTemplate {
  std::array<std::int16_t, kSearchArea> value{};  // grey - mean, rounded
  float norm = 0;

  bool build(const std::array<float, kSearchArea>& grey) {
    float mean = 0;
    for (const float g : grey) mean += g / kSearchArea;
    int squares = 0;
    int sum = 0;
    for (std::size_t i = 0; i < value.size(); ++i) {
      value[i] = static_cast<std::int16_t>(std::lround(grey[i] - mean));
      squares += value[i] * value[i];
      sum += value[i];
    }
    const float variance = static_cast<float>(squares) - static_cast<float>(sum * sum) / kSearchArea;
    norm = std::sqrt(std::max(variance, 0.0F));
    total = sum;
    return norm > kMinContrast * kSearchSide;
  }
  int total = 0;

  // Correlation with the patch whose top-left pixel is `corner`.
  [[nodiscard]] float correlation(const std::uint8_t* corner, int stride) const {
    int sum = 0;
    int squares = 0;
    int product = 0;
    for (int y = 0; y < kSearchSide; ++y) {
      const std::uint8_t* row = corner + static_cast<std::ptrdiff_t>(y) * stride;
      const std::int16_t* mine = value.data() + static_cast<std::ptrdiff_t>(y) * kSearchSide;
      for (int x = 0; x < kSearchSide; ++x) {
        const int g = row[x];
        sum += g;
        squares += g * g;
        product += g * mine[x];
      }
    }
    const float variance =
        static_cast<float>(squares) - static_cast<float>(sum) * static_cast<float>(sum) / kSearchArea;
    if (!(variance > kMinContrast * kMinContrast)) return -1;
    const float covariance =
        static_cast<float>(product) - static_cast<float>(sum) * static_cast<float>(total) / kSearchArea;
    return covariance / (norm * std::sqrt(variance));
  }
};

}  // namespace

StereoDepth::StereoDepth(const Rig& rig, const StereoDepthSettings& settings)
    : rig_(rig), settings_(settings), T_1_0_(rig.T_cam1_cam0()) {
  for (std::size_t c = 0; c < half_.size(); ++c) {
    half_[c].width = rig.camera[c].width() / 2;
    half_[c].height = rig.camera[c].height() / 2;
    half_[c].pixels.resize(static_cast<std::size_t>(half_[c].width) *
                           static_cast<std::size_t>(half_[c].height));
  }
}

// `warp` maps offsets in camera 0 to offsets in camera 1, for a patch at that distance, square to the ray.
bool StereoDepth::warpAt(const Eigen::Vector2d& pixel, double inverse_depth, Eigen::Matrix2d& warp) const {
  for (int axis = 0; axis < 2; ++axis) {
    std::array<Eigen::Vector2d, 2> end;
    for (std::size_t side = 0; side < 2; ++side) {
      Eigen::Vector2d at = pixel;
      at[axis] += side == 0 ? -kWarpStep : kWarpStep;
      Eigen::Vector3d bearing;
      if (!rig_.camera[0].unproject(at, bearing)) return false;
      const Eigen::Vector3d p = T_1_0_.rotation * bearing + inverse_depth * T_1_0_.translation;
      if (!rig_.camera[1].project(p, end[side])) return false;
    }
    warp.col(axis) = (end[1] - end[0]) / (2.0 * kWarpStep);
  }
  return std::abs(warp.determinant()) > 0.05;
}

bool StereoDepth::search(const PlaceFeature& feature, const Eigen::Vector3d& bearing, Match& match) const {
  const ImageView from = half_[0].view();
  const ImageView to = half_[1].view();
  const double nearest = 1.0 / settings_.min_distance;
  const Eigen::Vector2d pixel = feature.pixel.cast<double>();
  Eigen::Matrix2d warp;
  if (!warpAt(pixel, kMiddling * nearest, warp)) return false;
  const Eigen::Matrix2d back = warp.inverse();
  // Pixel (x, y) of the half image has its centre at (2 x + 0.5, 2 y + 0.5) of the whole.
  const Eigen::Vector2d centre = (pixel - Eigen::Vector2d::Constant(0.5)) * 0.5;
  std::array<float, kSearchArea> grey{};
  constexpr double kHalfSide = 0.5 * (kSearchSide - 1);
  const double border = kHalfSide * (back.cwiseAbs().rowwise().sum().maxCoeff());
  if (!inside(from, centre.x(), centre.y(), border)) return false;
  for (int y = 0; y < kSearchSide; ++y) {
    for (int x = 0; x < kSearchSide; ++x) {
      const Eigen::Vector2d at = centre + back * Eigen::Vector2d(x - kHalfSide, y - kHalfSide);
      grey[static_cast<std::size_t>(y * kSearchSide + x)] = bilinear(from, at.x(), at.y());
    }
  }
  SearchTemplate pattern;
  if (!pattern.build(grey)) return false;

  const Eigen::Vector3d rotated = T_1_0_.rotation * bearing;
  Eigen::Vector2d far_end;
  Eigen::Vector2d near_end;
  int samples = kMaxSamples;
  if (rig_.camera[1].project(rotated, far_end) &&
      rig_.camera[1].project(rotated + nearest * T_1_0_.translation, near_end)) {
    samples = std::clamp(static_cast<int>((near_end - far_end).norm() / kSampleStep) + 2, 2, kMaxSamples);
  }
  std::array<float, kMaxSamples> correlation{};
  int best = -1;
  for (int i = 0; i < samples; ++i) {
    float& mine = correlation[static_cast<std::size_t>(i)];
    mine = -1;
    Eigen::Vector2d seen;
    const double inverse_depth = nearest * i / (samples - 1);
    if (!rig_.camera[1].project(rotated + inverse_depth * T_1_0_.translation, seen)) continue;
    // Top-left pixel of the patch whose centre is nearest.
    const int x = static_cast<int>(std::lround((seen.x() - 0.5) * 0.5 - kHalfSide));
    const int y = static_cast<int>(std::lround((seen.y() - 0.5) * 0.5 - kHalfSide));
    if (x < 0 || y < 0 || x + kSearchSide > to.width || y + kSearchSide > to.height) continue;
    mine = pattern.correlation(to.row(y) + x, to.stride);
    if (best < 0 || mine > correlation[static_cast<std::size_t>(best)]) {
      best = i;
      match.inverse_depth = inverse_depth;
      match.pixel = seen;
    }
  }
  if (best < 0 || correlation[static_cast<std::size_t>(best)] < kMinSearchCorrelation) return false;
  const float limit = correlation[static_cast<std::size_t>(best)] - settings_.rival_lead;
  for (int i = 0; i < samples; ++i) {
    if (std::abs(i - best) > kPeakWidth && correlation[static_cast<std::size_t>(i)] > limit) return false;
  }
  return true;
}

bool StereoDepth::refine(const ImageView& image0, const ImageView& image1, const PlaceFeature& feature,
                         Match& match) const {
  Eigen::Matrix2d warp;
  const Eigen::Vector2d pixel = feature.pixel.cast<double>();
  if (!warpAt(pixel, match.inverse_depth, warp)) return false;
  const Eigen::Matrix2d back = warp.inverse();
  // One more pixel on each side for the gradient.
  constexpr int kWide = kRefineSide + 2;
  const double border = (kRefineRadius + 1) * back.cwiseAbs().rowwise().sum().maxCoeff();
  if (!inside(image0, pixel.x(), pixel.y(), border)) return false;
  std::array<float, static_cast<std::size_t>(kWide * kWide)> wide{};
  for (int y = 0; y < kWide; ++y) {
    for (int x = 0; x < kWide; ++x) {
      const Eigen::Vector2d at = pixel + back * Eigen::Vector2d(x - kRefineRadius - 1, y - kRefineRadius - 1);
      wide[static_cast<std::size_t>(y * kWide + x)] = bilinear(image0, at.x(), at.y());
    }
  }
  std::array<float, kRefineArea> grey{};
  std::array<float, kRefineArea> gx{};
  std::array<float, kRefineArea> gy{};
  float mean = 0;
  Eigen::Vector2f gradient_mean = Eigen::Vector2f::Zero();
  for (int y = 0; y < kRefineSide; ++y) {
    for (int x = 0; x < kRefineSide; ++x) {
      const auto i = static_cast<std::size_t>(y * kRefineSide + x);
      const float* at = wide.data() + (y + 1) * kWide + x + 1;
      grey[i] = at[0];
      gx[i] = 0.5F * (at[1] - at[-1]);
      gy[i] = 0.5F * (at[kWide] - at[-kWide]);
      mean += grey[i] / kRefineArea;
      gradient_mean += Eigen::Vector2f(gx[i], gy[i]) / kRefineArea;
    }
  }
  Eigen::Matrix2f H = Eigen::Matrix2f::Zero();
  for (std::size_t i = 0; i < kRefineArea; ++i) {
    grey[i] -= mean;
    gx[i] -= gradient_mean.x();
    gy[i] -= gradient_mean.y();
    H += Eigen::Vector2f(gx[i], gy[i]) * Eigen::RowVector2f(gx[i], gy[i]);
  }
  if (!(H.determinant() > 1e-3F * H.trace() * H.trace()))
    H += 0.01F * H.trace() * Eigen::Matrix2f::Identity();
  const Eigen::Matrix2f H_inverse = H.inverse();
  const Eigen::Vector2d start = match.pixel;
  float correlation = -1;
  for (int step = 0; step < kRefineSteps; ++step) {
    if (!inside(image1, match.pixel.x(), match.pixel.y(), kRefineRadius)) return false;
    std::array<float, kRefineArea> seen{};
    float seen_mean = 0;
    for (int y = 0; y < kRefineSide; ++y) {
      for (int x = 0; x < kRefineSide; ++x) {
        const auto i = static_cast<std::size_t>(y * kRefineSide + x);
        seen[i] = bilinear(image1, match.pixel.x() + x - kRefineRadius, match.pixel.y() + y - kRefineRadius);
        seen_mean += seen[i] / kRefineArea;
      }
    }
    Eigen::Vector2f b = Eigen::Vector2f::Zero();
    float cross = 0;
    float seen_square = 0;
    float square = 0;
    for (std::size_t i = 0; i < kRefineArea; ++i) {
      const float difference = seen[i] - seen_mean - grey[i];
      b += difference * Eigen::Vector2f(gx[i], gy[i]);
      cross += (seen[i] - seen_mean) * grey[i];
      seen_square += (seen[i] - seen_mean) * (seen[i] - seen_mean);
      square += grey[i] * grey[i];
    }
    correlation = cross / std::sqrt(std::max(seen_square * square, 1e-6F));
    const Eigen::Vector2d shift = (H_inverse * b).cast<double>();
    if (!shift.allFinite()) return false;
    match.pixel -= shift;
    if ((match.pixel - start).norm() > kMaxRefineShift) return false;
    if (shift.norm() < kRefineConverged) break;
  }
  return correlation >= settings_.min_correlation;
}

bool StereoDepth::inverseDepthOf(const Eigen::Vector3d& bearing, const Match& match, double& inverse_depth,
                                 double& sigma) const {
  const Eigen::Vector3d rotated = T_1_0_.rotation * bearing;
  inverse_depth = match.inverse_depth;
  Eigen::Vector2d miss = Eigen::Vector2d::Zero();
  Eigen::Vector2d moves = Eigen::Vector2d::Zero();
  for (int step = 0; step < kDepthSteps; ++step) {
    Eigen::Vector2d seen;
    Matrix23d jacobian;
    if (!rig_.camera[1].project(rotated + inverse_depth * T_1_0_.translation, seen, &jacobian)) return false;
    moves = jacobian * T_1_0_.translation;
    miss = match.pixel - seen;
    if (!(moves.squaredNorm() > 0)) return false;
    inverse_depth += moves.dot(miss) / moves.squaredNorm();
  }
  sigma = settings_.pixel_sigma / moves.norm();
  if (!(miss.norm() < settings_.epipolar_gate)) return false;
  if (inverse_depth < -kBeyondInfinity * sigma || inverse_depth > 1.5 / settings_.min_distance) return false;
  // At or beyond infinity: a tiny inverse distance, with the same sigma.
  inverse_depth = std::max(inverse_depth, 1e-6);
  return std::isfinite(sigma);
}

Status StereoDepth::fill(const ImageView& image0, const ImageView& image1, PlaceKeyframe& keyframe,
                         std::size_t& found) {
  found = 0;
  const std::array<const ImageView*, 2> images = {&image0, &image1};
  for (std::size_t c = 0; c < 2; ++c) {
    if (images[c]->empty() || images[c]->width != rig_.camera[c].width() ||
        images[c]->height != rig_.camera[c].height()) {
      return {StatusCode::kInvalidInput, "stereo depth: an image does not have its camera's size"};
    }
    halve(*images[c], half_[c].pixels.data(), half_[c].width, half_[c].height);
  }
  for (PlaceFeature& feature : keyframe.features) {
    if (!feature.pixel.allFinite() || !feature.bearing.allFinite()) continue;
    const Eigen::Vector3d bearing = feature.bearing.cast<double>();
    Match match;
    double inverse_depth = 0;
    double sigma = 0;
    if (!search(feature, bearing, match) || !refine(image0, image1, feature, match)) continue;
    if (!inverseDepthOf(bearing, match, inverse_depth, sigma)) continue;
    ++found;
    if (feature.inverse_depth_sigma > 0 && feature.inverse_depth_sigma < sigma) continue;
    feature.inverse_depth = static_cast<float>(inverse_depth);
    feature.inverse_depth_sigma = static_cast<float>(sigma);
  }
  return okStatus();
}

}  // namespace swiftlet
