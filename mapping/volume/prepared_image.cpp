#include "mapping/volume/prepared_image.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/volume/voxel_block.hpp"

namespace swiftlet {
namespace {

/// Stands for "free however far" in tiles where nothing limits the view.
constexpr float kFarAway = 1e9F;
/// Against a division by zero where nothing was measured [1/m^2].
constexpr float kTinySquare = 1e-12F;
/// Above any difference of inverse depths [1/m].
constexpr float kNoSlope = 1e9F;
/// A pixel weighs at least one step and at most this many, 16 of the reference.
constexpr float kMostPixelWeight = 16 * kWeightSteps;

std::size_t tilesOf(std::size_t pixels) {
  // All levels of the longest thin image included.
  return 2 * (pixels / PreparedImage::kTile + 64);
}

bool possible(const PinholeIntrinsics& c) {
  return c.width > 0 && c.height > 0 && std::isfinite(c.fx) && std::isfinite(c.fy) && c.fx > 0 && c.fy > 0 &&
         std::isfinite(c.cx) && std::isfinite(c.cy);
}

}  // namespace

PreparedImage::PreparedImage(std::size_t most_pixels)
    : most_pixels_(most_pixels),
      depth_(most_pixels + 1),
      weight_(most_pixels + 1),
      slope_(most_pixels + 1),
      inverse_(most_pixels + 1),
      label_(most_pixels + 1),
      free_(tilesOf(most_pixels)),
      deepest_(tilesOf(most_pixels)),
      nearest_(tilesOf(most_pixels)) {}

std::size_t PreparedImage::bytes() const {
  return (4 * depth_.size() + free_.size() + deepest_.size() + nearest_.size()) * sizeof(float) +
         label_.size();
}

Status PreparedImage::prepare(const DepthImageView& image, const VolumeSettings& settings,
                              PixelCounters& counters) {
  if (!possible(image.camera))
    return {StatusCode::kInvalidInput, "depth image: impossible intrinsics or size"};
  if (image.camera.pixels() > most_pixels_) {
    return {StatusCode::kInvalidInput, "depth image: more pixels than reserved"};
  }
  if (image.depth == nullptr) return {StatusCode::kInvalidInput, "depth image: no depth"};
  camera_ = image.camera;
  grey_ = image.intensity;
  checkPixels(image, settings, counters);
  has_labels_ = image.labels != nullptr;
  if (has_labels_) checkLabels(image, settings, counters);
  findSlopes();
  buildPyramid();
  return okStatus();
}

void PreparedImage::checkPixels(const DepthImageView& image, const VolumeSettings& settings,
                                PixelCounters& counters) {
  const std::size_t pixels = camera_.pixels();
  const auto least = static_cast<float>(settings.least_range);
  const auto most = static_cast<float>(settings.most_range);
  std::uint32_t measured = 0, beyond = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float d = image.depth[i];
    // False for NaN. An infinite depth is not usable: it does not prove that the ray is free.
    const bool usable = d >= least && d < kFarAway;
    depth_[i] = usable ? d : 0.0F;
    measured += usable ? 1U : 0U;
    beyond += usable && d > most ? 1U : 0U;
  }
  depth_[pixels] = 0;
  counters.unmeasured += pixels - measured;
  counters.beyond_range += beyond;
  const auto reference = static_cast<float>(settings.reference_sigma);
  const auto weight_of = [reference](float sigma) {
    const float ratio = reference / sigma;
    return std::min(std::max(kWeightSteps * ratio * ratio, 1.0F), kMostPixelWeight);
  };
  // Free up to the range, at most to where the surface may be within the error of the measurement.
  const auto free_before = [least, most](float d, float sigma) {
    const float free = std::min(d - kSureSigmas * sigma, most);
    return free > least ? -free : 0.0F;
  };
  is_even_ = image.sigma == nullptr && settings.sigma_quadratic == 0;
  if (is_even_) {
    const auto sigma = static_cast<float>(settings.sigma_constant);
    even_weight_ = weight_of(sigma);
    for (std::size_t i = 0; i < pixels; ++i)
      depth_[i] = depth_[i] > most ? free_before(depth_[i], sigma) : depth_[i];
    return;
  }
  const auto constant = static_cast<float>(settings.sigma_constant);
  const auto quadratic = static_cast<float>(settings.sigma_quadratic);
  const auto most_sigma = static_cast<float>(settings.most_sigma);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float sigma =
        image.sigma != nullptr ? image.sigma[i] : constant + quadratic * depth_[i] * depth_[i];
    const bool known = sigma > 0 && sigma < kFarAway;
    weight_[i] = weight_of(known ? sigma : 1.0F);
    // A pixel without a valid deviation counts as unmeasured.
    if (!known) depth_[i] = 0;
    const bool far = depth_[i] > most;
    if (!known || (sigma <= most_sigma && !far) || depth_[i] <= 0) continue;
    depth_[i] = free_before(depth_[i], sigma);
    counters.uncertain += far ? 0 : 1;
  }
  weight_[pixels] = 0;
}

void PreparedImage::checkLabels(const DepthImageView& image, const VolumeSettings& settings,
                                PixelCounters& counters) {
  const std::size_t pixels = camera_.pixels();
  const auto count = static_cast<unsigned>(std::clamp(settings.label_count, 0, kLabelValues));
  std::uint64_t bad = 0, masked = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const unsigned label = image.labels[i];
    const bool known = label < count;
    label_[i] = static_cast<std::uint8_t>(known ? label : 0U);
    bad += known ? 0U : 1U;
    const bool hidden = known && ((settings.masked_labels >> label) & 1U) != 0;
    masked += hidden ? 1U : 0U;
    depth_[i] = hidden && depth_[i] > 0 ? -depth_[i] : depth_[i];
  }
  label_[pixels] = 0;
  counters.bad_label += bad;
  counters.masked += masked;
}

void PreparedImage::findSlopes() {
  const std::size_t pixels = camera_.pixels();
  const auto width = static_cast<std::size_t>(camera_.width),
             height = static_cast<std::size_t>(camera_.height);
  for (std::size_t i = 0; i < pixels; ++i) inverse_[i] = depth_[i] > 0 ? 1 / depth_[i] : 0.0F;
  std::fill(slope_.begin(), slope_.begin() + static_cast<std::ptrdiff_t>(pixels + 1), 1.0F);
  if (width < 3 || height < 3) return;
  const auto fx = static_cast<float>(camera_.fx), fy = static_cast<float>(camera_.fy);
  const auto cx = static_cast<float>(camera_.cx), cy = static_cast<float>(camera_.cy);
  for (std::size_t v = 1; v + 1 < height; ++v) {
    const float* const row = inverse_.data() + v * width;
    const float y = (static_cast<float>(v) - cy) / fy;
    for (std::size_t u = 1; u + 1 < width; ++u) {
      const float here = row[u];
      // If one neighbour was not measured, the other is used; without both the result is 0.
      const auto nearer = [here](float before, float after) {
        const float down = before > 0 ? here - before : kNoSlope, up = after > 0 ? after - here : kNoSlope;
        const float least = std::abs(down) < std::abs(up) ? down : up;
        return least < kNoSlope ? least : 0.0F;
      };
      const float a = fx * nearer(row[u - 1], row[u + 1]);
      const float b = fy * nearer(*(row + u - width), *(row + u + width));
      const float c = here - a * (static_cast<float>(static_cast<std::int32_t>(u)) - cx) / fx - b * y;
      const float cosine = here / std::sqrt(a * a + b * b + c * c + kTinySquare);
      slope_[v * width + u] = here > 0 ? std::max(cosine, kLeastSlope) : 1.0F;
    }
  }
  // Pixels on the border have the slope of their neighbour.
  for (std::size_t v = 1; v + 1 < height; ++v) {
    slope_[v * width] = slope_[v * width + 1];
    slope_[v * width + width - 1] = slope_[v * width + width - 2];
  }
  std::copy_n(&slope_[width], width, &slope_[0]);
  std::copy_n(&slope_[(height - 2) * width], width, &slope_[(height - 1) * width]);
}

/// Whether another unmeasured pixel touches this one. A single one is noise; more may be a pole without
/// depth.
bool PreparedImage::isHole(int u, int v) const {
  int unmeasured = 0;
  for (int y = std::max(v - 1, 0); y <= std::min(v + 1, camera_.height - 1); ++y) {
    const float* const line =
        depth_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width);
    for (int x = std::max(u - 1, 0); x <= std::min(u + 1, camera_.width - 1); ++x)
      unmeasured += line[x] == 0 ? 1 : 0;
  }
  return unmeasured > 1;
}

void PreparedImage::buildPyramid() {
  const int columns = (camera_.width + kTile - 1) / kTile;
  const int rows = (camera_.height + kTile - 1) / kTile;
  level_[0] = {columns, rows, 0};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      float nearest = kFarAway, deepest = 0;
      bool has_hole = false;
      const int bottom = std::min((row + 1) * kTile, camera_.height);
      const int right = std::min((column + 1) * kTile, camera_.width);
      for (int v = row * kTile; v < bottom; ++v) {
        const float* line =
            depth_.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(camera_.width);
        for (int u = column * kTile; u < right; ++u) {
          const float d = std::abs(line[u]);
          deepest = std::max(deepest, d);
          if (d > 0) {
            nearest = std::min(nearest, d);
          } else if (!has_hole) {
            has_hole = isHole(u, v);
          }
        }
      }
      const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                      static_cast<std::size_t>(column);
      free_[at] = deepest > 0 && !has_hole ? nearest : 0.0F;
      nearest_[at] = nearest;
      deepest_[at] = deepest;
    }
  }
  levels_ = 1;
  while (levels_ < kMostLevels && (level_[levels_ - 1].width > 1 || level_[levels_ - 1].height > 1)) {
    const Level& fine = level_[levels_ - 1];
    Level& coarse = level_[levels_];
    coarse = {(fine.width + 1) / 2, (fine.height + 1) / 2,
              fine.first + static_cast<std::size_t>(fine.width) * static_cast<std::size_t>(fine.height)};
    for (int row = 0; row < coarse.height; ++row) {
      for (int column = 0; column < coarse.width; ++column) {
        float nearest = kFarAway;
        for (int v = 2 * row; v < std::min(2 * row + 2, fine.height); ++v) {
          for (int u = 2 * column; u < std::min(2 * column + 2, fine.width); ++u) {
            nearest = std::min(nearest, free_[fine.first + static_cast<std::size_t>(v * fine.width + u)]);
          }
        }
        free_[coarse.first + static_cast<std::size_t>(row * coarse.width + column)] = nearest;
      }
    }
    ++levels_;
  }
}

float PreparedImage::freeDepth(int left, int top, int right, int bottom) const {
  // At most 4 x 4 tiles are looked at.
  int shift = 0;
  while (shift + 1 < levels_ && ((right / kTile >> shift) - (left / kTile >> shift) > 3 ||
                                 (bottom / kTile >> shift) - (top / kTile >> shift) > 3)) {
    ++shift;
  }
  const Level& level = level_[shift];
  float nearest = kFarAway;
  for (int row = top / kTile >> shift; row <= bottom / kTile >> shift; ++row) {
    for (int column = left / kTile >> shift; column <= right / kTile >> shift; ++column) {
      nearest = std::min(nearest, free_[level.first + static_cast<std::size_t>(row * level.width + column)]);
    }
  }
  return nearest;
}

}  // namespace swiftlet
