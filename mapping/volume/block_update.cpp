#include "mapping/volume/block_update.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/volume/lanes.hpp"

namespace swiftlet {
namespace {

/// Depth [m] below which nothing is projected.
constexpr float kNearestDepth = 0.05F;
constexpr float kMostWeightSteps = 65535.0F;
/// A measurement shows that something has come if it is nearer than the known surface by this share of the
/// truncation distance (errors of poses and depths are smaller) and by this many of its sigmas.
constexpr float kNearer = 0.5F;
constexpr double kSureSigmas = 3;

}  // namespace

std::uint8_t sidesOf(const VoxelBlock& block) {
  lanes::Shorts in_front{}, behind{};
  for (std::size_t at = 0; at < kBlockVoxels; at += lanes::kLanes) {
    lanes::Shorts distance;
    lanes::UnsignedShorts weight;
    lanes::load(distance, &block.distance[at]);
    lanes::load(weight, &block.weight[at]);
    behind |= (distance < 0) & (weight != 0);
    in_front |= (distance >= 0) & (weight != 0);
  }
  std::array<std::uint64_t, 2> f, b;
  std::memcpy(f.data(), &in_front, sizeof(f));
  std::memcpy(b.data(), &behind, sizeof(b));
  return static_cast<std::uint8_t>(((f[0] | f[1]) != 0 ? BlockHeader::kInFront : 0) |
                                   ((b[0] | b[1]) != 0 ? BlockHeader::kBehind : 0));
}

using lanes::Floats;
using lanes::Ints;

struct BlockUpdate::Sums {
  Floats largest{};
  Ints observed{};
  Ints news{};
  bool label_news = false;
};

BlockUpdate::BlockUpdate(const VolumeSettings& settings)
    : settings_(settings),
      sure_(static_cast<float>(kSureSigmas * kSureSigmas * settings.reference_sigma *
                               settings.reference_sigma) *
            kWeightSteps) {}

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

void BlockUpdate::projectEight(const Eigen::Vector3f& first, std::size_t at, VoxelBlock& block,
                               LabelBlock* labels, Sums& sums) const {
  const PinholeIntrinsics& c = image_->camera();
  Floats x, y, z;
  lanes::load(x, &x_[at]);
  lanes::load(y, &y_[at]);
  lanes::load(z, &z_[at]);
  z += first.z();
  const Floats inverse = 1.0F / z;
  // Half a pixel more, so that cutting to an integer rounds to the nearest.
  const Floats u = static_cast<float>(c.fx) * (x + first.x()) * inverse + static_cast<float>(c.cx + 0.5);
  const Floats v = static_cast<float>(c.fy) * (y + first.y()) * inverse + static_cast<float>(c.cy + 0.5);
  const Ints inside = (z > kNearestDepth) & (u >= 0.0F) & (u < static_cast<float>(c.width)) & (v >= 0.0F) &
                      (v < static_cast<float>(c.height));
  if (!lanes::any(inside)) return;
  // Outside the image the conversion could overflow.
  const Ints column = __builtin_convertvector(inside ? u : Floats{}, Ints);
  const Ints row = __builtin_convertvector(inside ? v : Floats{}, Ints);
  const Ints pixel = inside ? row * c.width + column : Ints{} + static_cast<std::int32_t>(c.pixels());

  Floats measured, slope;
  lanes::gather(measured, image_->depth(), pixel);
  const auto truncation = static_cast<float>(settings_.truncation);
  const auto behind = static_cast<float>(settings_.behind);
  const Ints is_surface = measured > 0.0F;
  const Floats ahead = (is_surface ? measured : -measured) - z;
  const Ints reached = is_surface & (ahead > -static_cast<float>(settings_.behind_ray));
  if (!lanes::any(reached | ((measured < 0.0F) & (ahead >= truncation)))) return;
  lanes::gather(slope, image_->slope(), pixel);
  const Floats s = ahead * slope;
  // A measured surface, or a view that is free at least up to here.
  const Ints hit = reached & (s > -behind);
  Ints seen = hit | ((measured < 0.0F) & (s >= truncation));
  if (const Ints free = seen & (s >= truncation); lanes::any(free)) {
    // The centre falls on one pixel, but the voxel may hold a pole that a neighbouring pixel measures.
    const Ints tile = (row / PreparedImage::kTile) * image_->tileColumns() + column / PreparedImage::kTile;
    Floats nearest;
    lanes::gather(nearest, image_->nearest(), tile);
    const Floats away = nearest - z;
    const auto voxel = static_cast<float>(settings_.voxel_size);
    seen &= ~(free & (away < voxel) & (away > -voxel));
  }
  if (!lanes::any(seen)) return;

  Floats pixel_weight;
  if (image_->weight() != nullptr) {
    lanes::gather(pixel_weight, image_->weight(), pixel);
  } else {
    pixel_weight = Floats{} + image_->evenWeight();
  }
  const float fall = 1.0F / std::max(behind - static_cast<float>(settings_.voxel_size), 1e-6F);
  const Floats drop = (behind + s) * fall;
  const Floats dropped = pixel_weight * (drop < 1.0F ? drop : Floats{} + 1.0F);
  const Floats gain = seen ? (dropped > 1.0F ? dropped : Floats{} + 1.0F) : Floats{};
  const Floats cut = (s < truncation ? s : Floats{} + truncation) * (kDistanceSteps / truncation);

  lanes::Shorts distances;
  lanes::UnsignedShorts weights;
  lanes::load(distances, &block.distance[at]);
  lanes::load(weights, &block.weight[at]);
  const Floats old_distance = __builtin_convertvector(distances, Floats);
  const Floats old_weight = __builtin_convertvector(weights, Floats);
  // A surface where there was none: something has come. What was known then counts as one measurement.
  const Floats nearer = old_distance * (truncation / kDistanceSteps) - s;
  const Ints come = hit & (s >= -static_cast<float>(settings_.voxel_size)) & (nearer > kNearer * truncation) &
                    (nearer * nearer * pixel_weight > sure_) & (old_weight > gain);
  const Floats kept_weight = come ? gain : old_weight;
  const Floats sum = kept_weight + gain;
  const Floats mean = seen ? (old_distance * kept_weight + cut * gain) / sum : old_distance;
  // Rounded to the nearest; what is behind by less than half a step stays behind.
  const Ints now_behind = mean < 0.0F;
  const Floats rounded = mean + (now_behind ? Floats{} - 0.5F : Floats{} + 0.5F);
  const Ints cut_distance = __builtin_convertvector(rounded, Ints);
  const Ints new_distance = (now_behind & (cut_distance == 0)) ? Ints{} - 1 : cut_distance;
  const float most = std::min(static_cast<float>(settings_.most_weight) * kWeightSteps, kMostWeightSteps);
  const Ints new_weight = __builtin_convertvector((sum < most ? sum : Floats{} + most) + 0.5F, Ints);
  distances = __builtin_convertvector(new_distance, lanes::Shorts);
  weights = __builtin_convertvector(new_weight, lanes::UnsignedShorts);
  lanes::store(&block.distance[at], distances);
  lanes::store(&block.weight[at], weights);

  const Floats moved = mean - old_distance;
  const Floats change = moved < 0.0F ? -moved : moved;
  sums.largest = change > sums.largest ? change : sums.largest;
  sums.observed -= seen;
  const Ints near = hit & (s < truncation);
  // A first observation far in front of a surface adds no surface, but turns unknown space into free space.
  sums.news |= seen & ((old_weight == 0.0F) | (now_behind ^ (old_distance < 0.0F)));
  if (lanes::any(near)) colour(pixel, near, gain, sum, at, block, labels, sums);
}

void BlockUpdate::colour(const Ints& pixel, const Ints& near, const Floats& gain, const Floats& sum,
                         std::size_t at, VoxelBlock& block, LabelBlock* labels, Sums& sums) const {
  if (const std::uint8_t* const grey = image_->grey(); grey != nullptr) {
    Floats old, seen;
    for (std::size_t i = 0; i < lanes::kLanes; ++i) {
      old[i] = block.grey[at + i];
      seen[i] = near[i] != 0 ? grey[pixel[i]] : 0;
    }
    // What was free so far has no grey yet.
    const Floats share = old > 0.0F ? gain / sum : Floats{} + 1.0F;
    const Ints mean = __builtin_convertvector(near ? old + share * (seen - old) + 0.5F : old, Ints);
    for (std::size_t i = 0; i < lanes::kLanes; ++i) block.grey[at + i] = static_cast<std::uint8_t>(mean[i]);
  }
  const std::uint8_t* const label = labels != nullptr ? image_->labels() : nullptr;
  if (label == nullptr) return;
  for (std::size_t i = 0; i < lanes::kLanes; ++i) {
    if (near[i] == 0 || label[pixel[i]] == 0) continue;
    sums.label_news = labels->counts[at + i].add(label[pixel[i]]) || sums.label_news;
  }
}

BlockUpdate::Result BlockUpdate::project(const BlockIndex& index, VoxelBlock& block,
                                         LabelBlock* labels) const {
  const double voxel = settings_.voxel_size;
  const Eigen::Vector3d first = T_camera_world_ * Eigen::Vector3d((index.x * kBlockSide + 0.5) * voxel,
                                                                  (index.y * kBlockSide + 0.5) * voxel,
                                                                  (index.z * kBlockSide + 0.5) * voxel);
  Sums sums;
  for (std::size_t at = 0; at < kBlockVoxels; at += lanes::kLanes) {
    projectEight(first.cast<float>(), at, block, labels, sums);
  }
  Result result;
  result.observed = static_cast<std::uint32_t>(lanes::sum(sums.observed));
  result.largest_change = lanes::largest(sums.largest);
  result.news = lanes::any(sums.news) || sums.label_news;
  result.sides = sidesOf(block);
  return result;
}

BlockUpdate::Result BlockUpdate::carve(VoxelBlock& block) const {
  Result result;
  const float most = std::min(static_cast<float>(settings_.most_weight) * kWeightSteps, kMostWeightSteps);
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
    news |= old_weight == 0.0F || (new_distance < 0) != (old_distance < 0.0F) ? 1 : 0;
  }
  result.observed = kBlockVoxels;
  result.largest_change = largest;
  result.sides =
      static_cast<std::uint8_t>(BlockHeader::kInFront | (is_behind != 0 ? BlockHeader::kBehind : 0));
  result.news = news != 0;
  return result;
}

}  // namespace swiftlet
