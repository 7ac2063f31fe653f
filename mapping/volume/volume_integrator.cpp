#include "mapping/volume/volume_integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// Pixels between points that list their blocks: 9 cm at 10 m with a focal length of 430 px.
constexpr int kBandStride = 4;
/// Tiles of PreparedImage along the edge of a bundle.
constexpr int kBundleTiles = 2;
/// Largest ratio of a ray's length to its depth: at the corner of a view of 110 degrees.
constexpr double kRayStretch = 1.75;
/// A cube nearer than this [m] is not judged as a whole.
constexpr float kNearestBlock = 0.05F;
/// Noise of estimated poses, which is no pose jump however close in time two images are.
constexpr double kPoseSlack = 0.05;  // m
constexpr double kTurnSlack = 0.05;  // rad

/// The parts of an eighth of a block, in the order of the eighths: x fastest.
struct Octant {
  std::array<std::uint64_t, 8> part{};
  std::uint64_t all = 0;
};
constexpr std::array<Octant, 8> kOctants = [] {
  std::array<Octant, 8> octants{};
  for (int i = 0; i < 8; ++i) {
    Octant& octant = octants[static_cast<std::size_t>(i)];
    for (int k = 0; k < 8; ++k) {
      const auto along = [i, k](int axis) { return 2 * (i >> axis & 1) + (k >> axis & 1); };
      const std::uint64_t bit = partBit(along(0), along(1), along(2));
      octant.part[static_cast<std::size_t>(k)] = bit;
      octant.all |= bit;
    }
  }
  return octants;
}();

bool finite(const SE3& T) { return T.rotation.coeffs().allFinite() && T.translation.allFinite(); }

int reachOf(const VolumeSettings& s) {
  return static_cast<int>(std::ceil(kRayStretch * s.most_range / (s.voxel_size * kBlockSide))) + 2;
}

/// Largest number of blocks that an image lists: as many as its points can touch, but not more than the
/// volume can use.
std::size_t bandCapacity(const VoxelVolume& volume, std::size_t most_pixels) {
  return std::min(8 * (most_pixels / (kBandStride * kBandStride) + 1), 4 * volume.blockCapacity() + 64);
}

}  // namespace

VolumeIntegrator::VolumeIntegrator(VoxelVolume& volume, std::size_t most_pixels)
    : volume_(volume),
      image_(most_pixels),
      update_(volume.settings()),
      window_(reachOf(volume.settings())),
      most_band_(bandCapacity(volume, most_pixels)) {
  band_.reserve(most_band_);
}

std::size_t VolumeIntegrator::bytes() const {
  return sizeof(*this) + image_.bytes() + window_.bytes() + band_.capacity() * sizeof(BlockIndex);
}

Status VolumeIntegrator::checkPose(const DepthImageView& image, const SE3& T_world_body) {
  if (!finite(T_world_body) || !finite(image.T_body_camera)) {
    ++counters_.bad_poses;
    return {StatusCode::kInvalidInput, "depth image: the pose is not finite"};
  }
  const std::optional<Pose> before = last_;
  if (before && image.stamp <= before->stamp) {
    ++counters_.bad_stamps;
    return {StatusCode::kInvalidInput, "depth image: the stamp is not later than the last one"};
  }
  last_ = Pose{image.stamp, T_world_body};
  if (!before) return okStatus();
  const VolumeSettings& s = volume_.settings();
  const double seconds = (image.stamp - before->stamp).seconds();
  const double moved = (T_world_body.translation - before->T_world_body.translation).norm();
  const double turned = T_world_body.rotation.angularDistance(before->T_world_body.rotation);
  if (moved > kPoseSlack + s.most_speed * seconds || turned > kTurnSlack + s.most_turn_rate * seconds) {
    ++counters_.pose_jumps;
    return {StatusCode::kInvalidInput, "depth image: the pose jumped"};
  }
  return okStatus();
}

Status VolumeIntegrator::step(const DepthImageView& image, const SE3& T_world_body,
                              const VolumeEffort& effort, VolumeStep& out) {
  out = {};
  const Status status = accept(image, T_world_body);
  return status.ok() ? fuse(image, T_world_body, effort, out) : status;
}

Status VolumeIntegrator::accept(const DepthImageView& image, const SE3& T_world_body) {
  const Status status = checkPose(image, T_world_body);
  counters_.refused += status.ok() ? 0 : 1;
  return status;
}

Status VolumeIntegrator::fuse(const DepthImageView& image, const SE3& T_world_body,
                              const VolumeEffort& effort, VolumeStep& out) {
  out = {};
  const SE3 T_world_camera = T_world_body * image.T_body_camera;
  vehicle_ = T_world_camera.translation.cast<float>();
  if (const Status status = image_.prepare(image, volume_.settings(), counters_.pixels); !status.ok()) {
    ++counters_.refused;
    return status;
  }
  ++counters_.images;
  begin(T_world_camera);
  listBand(effort.blocks, out);
  for (std::size_t i = 0; i < band_.size(); ++i) {
    const std::uint32_t slot = i < with_room_ ? volume_.obtain(band_[i]) : VoxelVolume::kNone;
    if (slot != VoxelVolume::kNone) {
      update(slot, false, out);
    } else {
      fuseApart(band_[i], out);
    }
  }
  walkBundles(effort.blocks, out);
  counters_.blocks_left_out += out.left_out;
  if (out.left_out + out.no_room > 0)
    return {StatusCode::kCapacityReached, "volume: not all blocks were updated"};
  return okStatus();
}

void VolumeIntegrator::begin(const SE3& T_world_camera) {
  const double block = volume_.settings().voxel_size * kBlockSide;
  T_world_camera_ = T_world_camera;
  T_camera_world_ = T_world_camera.inverse();
  const Eigen::Vector3d at = T_world_camera.translation / block;
  const Eigen::Vector3d whole = at.array().floor();
  centre_ = {static_cast<std::int32_t>(whole.x()), static_cast<std::int32_t>(whole.y()),
             static_cast<std::int32_t>(whole.z())};
  origin_ = (at - whole).cast<float>();
  const Eigen::Matrix3d R = T_world_camera.R();
  R_blocks_camera_ = (R / block).cast<float>();
  half_extent_ = (0.5 * block * R.transpose().cwiseAbs().rowwise().sum()).cast<float>();
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d side(i & 1, i >> 1 & 1, i >> 2);
    octant_centre_[static_cast<std::size_t>(i)] =
        (0.5 * block * R.transpose() * (side.array() - 0.5).matrix()).cast<float>();
  }
  update_.begin(image_, T_camera_world_);
  window_.clear();
  volume_.beginChange();
}

void VolumeIntegrator::addBandPoint(const Eigen::Vector3f& p) {
  // The corners of a cube that a surface passes through lie within a voxel of it along each axis.
  constexpr float kMargin = 1.0F / kBlockSide;
  std::array<std::int32_t, 6> range;
  for (int axis = 0; axis < 3; ++axis) {
    range[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(std::floor(p[axis] - kMargin));
    range[static_cast<std::size_t>(axis + 3)] = static_cast<std::int32_t>(std::floor(p[axis] + kMargin));
  }
  if (range == last_band_) return;
  last_band_ = range;
  for (std::int32_t z = range[2]; z <= range[5]; ++z) {
    for (std::int32_t y = range[1]; y <= range[4]; ++y) {
      for (std::int32_t x = range[0]; x <= range[3]; ++x) {
        if (band_.size() < most_band_ && window_.meet({x, y, z}))
          band_.push_back(centre_ + BlockIndex{x, y, z});
      }
    }
  }
}

void VolumeIntegrator::listBand(std::uint32_t blocks, VolumeStep& out) {
  band_.clear();
  last_band_.fill(std::numeric_limits<std::int32_t>::max());
  const PinholeIntrinsics& c = image_.camera();
  const auto fx = static_cast<float>(1 / c.fx), fy = static_cast<float>(1 / c.fy);
  const auto cx = static_cast<float>(c.cx), cy = static_cast<float>(c.cy);
  for (int v = 0; v < c.height; v += kBandStride) {
    const float* const depth =
        image_.depth() + static_cast<std::size_t>(v) * static_cast<std::size_t>(c.width);
    const Eigen::Vector3f row = R_blocks_camera_ * Eigen::Vector3f(0, (static_cast<float>(v) - cy) * fy, 1);
    for (int u = 0; u < c.width; u += kBandStride) {
      if (depth[u] <= 0) continue;
      const Eigen::Vector3f ray = row + (static_cast<float>(u) - cx) * fx * R_blocks_camera_.col(0);
      addBandPoint(origin_ + depth[u] * ray);
    }
  }
  if (band_.size() > blocks) {
    const auto nearer = [this](const BlockIndex& a, const BlockIndex& b) {
      const float da = (volume_.centreOf(a) - vehicle_).squaredNorm();
      const float db = (volume_.centreOf(b) - vehicle_).squaredNorm();
      return da != db ? da < db : keyOf(a) < keyOf(b);
    };
    std::nth_element(band_.begin(), band_.begin() + blocks, band_.end(), nearer);
    out.left_out += static_cast<std::uint32_t>(band_.size() - blocks);
    band_.resize(blocks);
  }
  out.band = static_cast<std::uint32_t>(band_.size());
  with_room_ = volume_.makeRoom(vehicle_, band_);
}

void VolumeIntegrator::update(std::uint32_t slot, bool carve, VolumeStep& out) {
  volume_.beginImage(slot);
  BlockHeader& header = volume_.changeHeader(slot);
  VoxelBlock& voxels = volume_.changeVoxels(slot);
  const BlockUpdate::Result result =
      carve ? update_.carve(voxels) : update_.project(header.index, voxels, volume_.changeLabels(slot));
  (carve ? out.carved : out.updated) += 1;
  if (result.observed == 0) return;
  volume_.touch(slot);
  header.sides = result.sides;
  header.drift += result.largest_change;
  const auto tolerance = static_cast<float>(volume_.settings().change_tolerance);
  if (result.news || tolerance <= 0 || header.drift * volume_.distanceStep() > tolerance) {
    volume_.markChanged(slot);
    ++out.changed;
  }
}

void VolumeIntegrator::fuseApart(const BlockIndex& block, VolumeStep& out) {
  if (overflow_ == nullptr) {
    ++out.no_room;
    return;
  }
  apart_.distance.fill(static_cast<std::int16_t>(kDistanceSteps));
  apart_.weight.fill(0);
  apart_.grey.fill(0);
  LabelBlock* const labels = volume_.settings().labels ? &labels_apart_ : nullptr;
  if (labels != nullptr) labels->counts.fill({});
  if (update_.project(block, apart_, labels).observed > 0) overflow_->take(block, apart_, labels);
  ++out.updated;
  ++out.apart;
}

void VolumeIntegrator::walkBundles(std::uint32_t blocks, VolumeStep& out) {
  const PinholeIntrinsics& c = image_.camera();
  for (int row = 0; row < image_.tileRows(); row += kBundleTiles) {
    for (int column = 0; column < image_.tileColumns(); column += kBundleTiles) {
      float deepest = 0;
      for (int r = row; r < std::min(row + kBundleTiles, image_.tileRows()); ++r) {
        for (int k = column; k < std::min(column + kBundleTiles, image_.tileColumns()); ++k) {
          deepest = std::max(deepest, image_.deepest(k, r));
        }
      }
      if (deepest <= 0) continue;
      constexpr double kCentre = 0.5 * kBundleTiles * PreparedImage::kTile - 0.5;
      const Eigen::Vector3f ray(
          static_cast<float>((std::min(column * PreparedImage::kTile + kCentre, c.width - 1.0) - c.cx) /
                             c.fx),
          static_cast<float>((std::min(row * PreparedImage::kTile + kCentre, c.height - 1.0) - c.cy) / c.fy),
          1);
      if (!walk(R_blocks_camera_ * ray, deepest, blocks, out)) return;
    }
  }
}

bool VolumeIntegrator::walk(const Eigen::Vector3f& direction, float length, std::uint32_t blocks,
                            VolumeStep& out) {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  std::array<std::int32_t, 3> at{}, way{};
  std::array<float, 3> next{}, each{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const float d = direction[axis];
    way[i] = d > 0 ? 1 : -1;
    each[i] = d != 0 ? std::abs(1 / d) : kNever;
    next[i] = d != 0 ? ((d > 0 ? 1.0F : 0.0F) - origin_[axis]) / d : kNever;
  }
  for (float t = 0; t <= length;) {
    const BlockIndex block{at[0], at[1], at[2]};
    if (window_.meet(block)) {
      if (out.updated + out.carved >= blocks) {
        ++out.left_out;
        return false;
      }
      meetOnRay(centre_ + block, out);
    }
    const std::size_t axis =
        next[0] < next[1] ? (next[0] < next[2] ? 0U : 2U) : (next[1] < next[2] ? 1U : 2U);
    t = next[axis];
    next[axis] += each[axis];
    at[axis] += way[axis];
  }
  return true;
}

void VolumeIntegrator::meetOnRay(const BlockIndex& block, VolumeStep& out) {
  const std::uint32_t slot = volume_.find(block);
  const BlockState state = slot != VoxelVolume::kNone ? volume_.header(slot).state : BlockState::kUnused;
  const std::uint64_t known = state == BlockState::kFree ? volume_.header(slot).free_parts : 0;
  if (known == kAllParts) return;
  const Eigen::Vector3f centre = (T_camera_world_ * volume_.centreOf(block).cast<double>()).cast<float>();
  const float behind = freeBehind(centre, 1);
  const auto truncation = static_cast<float>(volume_.settings().truncation);
  if (state == BlockState::kVoxels) {
    // In front of a surface seen at a glancing angle, a large depth is a small distance.
    update(slot, behind >= truncation / PreparedImage::kLeastSlope, out);
  } else if (const std::uint64_t parts = behind >= truncation ? kAllParts : freeParts(centre, known);
             parts != 0) {
    volume_.addFree(block, parts, vehicle_);
  }
}

std::uint64_t VolumeIntegrator::freeParts(const Eigen::Vector3f& centre, std::uint64_t known) const {
  const auto truncation = static_cast<float>(volume_.settings().truncation);
  std::uint64_t parts = 0;
  // By halves: an octant that is free as a whole needs one look.
  for (std::size_t i = 0; i < kOctants.size(); ++i) {
    if ((known & kOctants[i].all) == kOctants[i].all) continue;
    const Eigen::Vector3f middle = centre + octant_centre_[i];
    if (freeBehind(middle, 0.5F) >= truncation) {
      parts |= kOctants[i].all;
      continue;
    }
    for (std::size_t k = 0; k < kOctants.size(); ++k) {
      const std::uint64_t part = kOctants[i].part[k];
      if ((known & part) != 0) continue;
      if (freeBehind(middle + 0.5F * octant_centre_[k], 0.25F) >= truncation) parts |= part;
    }
  }
  return parts;
}

float VolumeIntegrator::freeBehind(const Eigen::Vector3f& centre, float share) const {
  constexpr float kUnknown = -1;
  const Eigen::Vector3f extent = share * half_extent_;
  const float nearest = centre.z() - extent.z(), farthest = centre.z() + extent.z();
  if (nearest < kNearestBlock) return kUnknown;
  const PinholeIntrinsics& c = image_.camera();
  // Of the cube's box in camera axes, the corners that project farthest out.
  const auto low = [&](float x) { return x / (x < 0 ? nearest : farthest); };
  const auto high = [&](float x) { return x / (x > 0 ? nearest : farthest); };
  const auto left = static_cast<float>(c.fx) * low(centre.x() - extent.x()) + static_cast<float>(c.cx);
  const auto right = static_cast<float>(c.fx) * high(centre.x() + extent.x()) + static_cast<float>(c.cx);
  const auto top = static_cast<float>(c.fy) * low(centre.y() - extent.y()) + static_cast<float>(c.cy);
  const auto bottom = static_cast<float>(c.fy) * high(centre.y() + extent.y()) + static_cast<float>(c.cy);
  if (!(left >= 0 && top >= 0 && right <= static_cast<float>(c.width - 1) &&
        bottom <= static_cast<float>(c.height - 1))) {
    return kUnknown;
  }
  const float free = image_.freeDepth(static_cast<int>(left), static_cast<int>(top), static_cast<int>(right),
                                      static_cast<int>(bottom));
  return free > 0 ? free - farthest : kUnknown;
}

}  // namespace swiftlet
