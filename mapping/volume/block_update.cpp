#include "mapping/volume/block_update.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Depth [m] below which nothing is projected.
constexpr float kNearestDepth = 0.05F;

}  // namespace

struct BlockUpdate::Rows {
  alignas(64) std::array<std::int32_t, kRows> pixel;
  alignas(64) std::array<float, kRows> depth;  ///< of the voxel, along the optical axis
  alignas(64) std::array<float, kRows> slope;  ///< distance from the surface for a metre of depth
  alignas(64) std::array<float, kRows> measured;
  alignas(64) std::array<float, kRows> weight;
  alignas(64) std::array<std::int32_t, kRows> near;  ///< on the surface, for colour and label
};

BlockUpdate::BlockUpdate(const VolumeSettings& settings) : settings_(settings) {}

void BlockUpdate::begin(const PreparedImage& image, const SE3& T_camera_world) {
  image_ = &image;
  T_camera_world_ = T_camera_world;
  const Eigen::Matrix3f step = (T_camera_world.R() * settings_.voxel_size).cast<float>();
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const Eigen::Vector3f offset = step * Eigen::Vector3f(static_cast<float>(i & kBlockMask),
                                                          static_cast<float>((i >> kBlockBits) & kBlockMask),
                                                          static_cast<float>(i >> (2 * kBlockBits)));
    x_[i] = offset.x();
    y_[i] = offset.y();
    z_[i] = offset.z();
  }
}

void BlockUpdate::meet(const Eigen::Vector3f& first, std::size_t at, Rows& rows) const {
  const PinholeIntrinsics& c = image_->camera();
  const auto fx = static_cast<float>(c.fx), fy = static_cast<float>(c.fy);
  // Half a pixel more, so that cutting to an integer rounds to the nearest.
  const auto cx = static_cast<float>(c.cx + 0.5), cy = static_cast<float>(c.cy + 0.5);
  const auto width = static_cast<float>(c.width), height = static_cast<float>(c.height);
  const auto outside = static_cast<std::int32_t>(c.pixels());
  const std::int32_t row_pixels = c.width;
  const float first_x = first.x(), first_y = first.y(), first_z = first.z();
  for (std::size_t i = 0; i < kRows; ++i) {
    const float z = first_z + z_[at + i];
    const float inverse = 1.0F / z;
    const float x = (first_x + x_[at + i]) * inverse;
    const float y = (first_y + y_[at + i]) * inverse;
    const float u = fx * x + cx;
    const float v = fy * y + cy;
    const bool seen = (z > kNearestDepth) & (u >= 0.0F) & (u < width) & (v >= 0.0F) & (v < height);
    // Where not seen the conversion would overflow.
    const auto column = static_cast<std::int32_t>(seen ? u : 0.0F);
    const auto row = static_cast<std::int32_t>(seen ? v : 0.0F);
    rows.pixel[i] = seen ? row * row_pixels + column : outside;
    rows.depth[i] = z;
  }
  const float* const depth = image_->depth();
  const float* const weight = image_->weight();
  const float* const slope = image_->slope();
  for (std::size_t i = 0; i < kRows; ++i) rows.measured[i] = depth[rows.pixel[i]];
  for (std::size_t i = 0; i < kRows; ++i) rows.weight[i] = weight[rows.pixel[i]];
  for (std::size_t i = 0; i < kRows; ++i) rows.slope[i] = slope[rows.pixel[i]];
}

void BlockUpdate::average(VoxelBlock& block, std::size_t at, Rows& rows, Result& result) const {
  const auto truncation = static_cast<float>(settings_.truncation);
  const auto behind = static_cast<float>(settings_.behind);
  const auto behind_ray = static_cast<float>(settings_.behind_ray);
  const auto voxel = static_cast<float>(settings_.voxel_size);
  const float fall = 1.0F / std::max(behind - voxel, 1e-6F);
  const float steps = kDistanceSteps / truncation;
  const float most = std::min(static_cast<float>(settings_.most_weight) * kWeightSteps, 65535.0F);
  std::int16_t* const distance = block.distance.data() + at;
  std::uint16_t* const weight = block.weight.data() + at;
  float largest = 0;
  std::int32_t observed = 0, in_front = 0, is_behind = 0, news = 0;
  for (std::size_t i = 0; i < kRows; ++i) {
    const float measured = rows.measured[i];
    const float ahead = std::abs(measured) - rows.depth[i];
    const float s = ahead * rows.slope[i];
    // A measured surface, or a view that is free at least up to here.
    const bool hit = (measured > 0.0F) & (s > -behind) & (ahead > -behind_ray);
    const bool seen = hit | ((measured < 0.0F) & (s >= truncation));
    const float dropped = std::min((behind + s) * fall, 1.0F);
    const float gain = seen ? std::max(rows.weight[i] * dropped, 1.0F) : 0.0F;
    const float cut = std::min(s, truncation) * steps;
    const auto old_weight = static_cast<float>(weight[i]);
    const auto old_distance = static_cast<float>(distance[i]);
    const float sum = old_weight + gain;
    const float mean = seen ? (old_distance * old_weight + cut * gain) / sum : old_distance;
    // Rounded away from zero: zero is on the surface, and stays on the side it was seen on.
    const float rounded = mean + (mean < 0.0F ? -0.5F : 0.5F);
    const auto new_distance = static_cast<std::int32_t>(rounded);
    const auto new_weight = static_cast<std::int32_t>(std::min(sum, most) + 0.5F);
    distance[i] = static_cast<std::int16_t>(new_distance);
    weight[i] = static_cast<std::uint16_t>(new_weight);
    const float change = std::abs(mean - old_distance);
    largest = change > largest ? change : largest;
    observed += seen ? 1 : 0;
    const bool now_behind = new_distance < 0;
    in_front |= (new_weight > 0) & !now_behind ? 1 : 0;
    is_behind |= (new_weight > 0) & now_behind ? 1 : 0;
    news |= seen & ((old_weight == 0.0F) | (now_behind != (old_distance < 0.0F))) ? 1 : 0;
    rows.near[i] = hit & (s < truncation) ? 1 : 0;
  }
  result.largest_change = std::max(result.largest_change, largest);
  result.observed += static_cast<std::uint32_t>(observed);
  result.sides = static_cast<std::uint8_t>(result.sides | (in_front != 0 ? BlockHeader::kInFront : 0) |
                                           (is_behind != 0 ? BlockHeader::kBehind : 0));
  result.news = result.news || news != 0;
}

void BlockUpdate::colour(VoxelBlock& block, LabelBlock* labels, std::size_t at, const Rows& rows,
                         Result& result) const {
  const std::uint8_t* const grey = image_->grey();
  const std::uint8_t* const label = labels != nullptr ? image_->labels() : nullptr;
  for (std::size_t i = 0; i < kRows; ++i) {
    if (rows.near[i] == 0) continue;
    const std::int32_t pixel = rows.pixel[i];
    if (grey != nullptr) {
      const auto weight = static_cast<std::int32_t>(block.weight[at + i]);
      const auto gain = std::min(static_cast<std::int32_t>(rows.weight[i]) + 1, weight);
      const std::int32_t old = block.grey[at + i];
      // The weight before this image is at least weight - gain; the first observation takes the grey as it
      // is.
      const std::int32_t next = (old * (weight - gain) + grey[pixel] * gain + weight / 2) / weight;
      block.grey[at + i] = static_cast<std::uint8_t>(std::clamp(next, 0, 255));
    }
    if (label != nullptr && label[pixel] != 0) {
      result.news = labels->counts[at + i].add(label[pixel]) || result.news;
    }
  }
}

BlockUpdate::Result BlockUpdate::project(const BlockIndex& index, VoxelBlock& block,
                                         LabelBlock* labels) const {
  const double voxel = settings_.voxel_size;
  const Eigen::Vector3d first = T_camera_world_ * Eigen::Vector3d((index.x * kBlockSide + 0.5) * voxel,
                                                                  (index.y * kBlockSide + 0.5) * voxel,
                                                                  (index.z * kBlockSide + 0.5) * voxel);
  const bool coloured = image_->grey() != nullptr || (labels != nullptr && image_->labels() != nullptr);
  Result result;
  Rows rows;
  for (std::size_t at = 0; at < kBlockVoxels; at += kRows) {
    meet(first.cast<float>(), at, rows);
    average(block, at, rows, result);
    if (coloured) colour(block, labels, at, rows, result);
  }
  return result;
}

BlockUpdate::Result BlockUpdate::carve(VoxelBlock& block) const {
  Result result;
  const float most = std::min(static_cast<float>(settings_.most_weight) * kWeightSteps, 65535.0F);
  float largest = 0;
  std::int32_t is_behind = 0, news = 0;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const auto old_weight = static_cast<float>(block.weight[i]);
    const auto old_distance = static_cast<float>(block.distance[i]);
    const float sum = old_weight + kWeightSteps;
    const float mean = (old_distance * old_weight + kDistanceSteps * kWeightSteps) / sum;
    const auto new_distance = static_cast<std::int32_t>(mean + (mean < 0.0F ? -0.5F : 0.5F));
    block.distance[i] = static_cast<std::int16_t>(new_distance);
    block.weight[i] = static_cast<std::uint16_t>(static_cast<std::int32_t>(std::min(sum, most) + 0.5F));
    const float change = std::abs(mean - old_distance);
    largest = change > largest ? change : largest;
    is_behind |= new_distance < 0 ? 1 : 0;
    news |= (old_weight == 0.0F) | ((new_distance < 0) != (old_distance < 0.0F)) ? 1 : 0;
  }
  result.observed = kBlockVoxels;
  result.largest_change = largest;
  result.sides =
      static_cast<std::uint8_t>(BlockHeader::kInFront | (is_behind != 0 ? BlockHeader::kBehind : 0));
  result.news = news != 0;
  return result;
}

}  // namespace swiftlet
