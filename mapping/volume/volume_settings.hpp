#pragma once
// Settings of a volume, given at construction. Metres, seconds, radians.

#include <cstddef>
#include <cstdint>

namespace swiftlet {

/// Label values: 0 (kNoLabel) and 1 to 31, so that five bits hold one and 32 bits a set of them.
inline constexpr int kLabelValues = 32;

struct VolumeSettings {
  double voxel_size = 0.05;
  /// Largest distance stored, in front of a surface and behind it.
  double truncation = 0.15;
  /// Voxels deeper behind a surface are not updated, because nothing is known there. Two voxels hold all
  /// corners of the cubes that a surface passes through.
  double behind = 0.10;
  /// Voxels deeper than this along the optical axis are not updated either, for example past the far edge of
  /// a table top seen at a glancing angle.
  double behind_ray = 0.20;
  /// Memory for blocks, headers and index together.
  std::size_t memory_bytes = std::size_t{64} << 20U;
  bool labels = true;  ///< keep label counts

  double least_range = 0.2;  ///< depth [m] below which a pixel counts as unmeasured
  double most_range = 10.0;  ///< depth [m]; farther pixels carve up to here and give no surface
  /// Standard deviation [m] of a measurement of weight 1. Weights are the inverse square of the deviation.
  double reference_sigma = 0.01;
  /// Standard deviation if the image has none: sigma = a + b z^2 [m], as of a stereo sensor.
  double sigma_constant = 0.01;
  double sigma_quadratic = 0.0;
  /// Pixels with a larger deviation [m] only mark free space in front of them and give no surface. Twice the
  /// truncation distance: beyond it two of three measurements miss the band. Prevents double walls far away
  /// with stereo (docs/experiments/map.md).
  double most_sigma = 0.30;
  /// Largest weight of a voxel. Smaller values let the map follow changes faster.
  double most_weight = 100.0;

  /// Bit l set: pixels with label l carve up to their depth and give no surface (moving things).
  std::uint32_t masked_labels = 0;
  /// Labels from this value on are out of range: the pixel keeps its depth and loses the label.
  int label_count = kLabelValues;

  /// A block counts as changed if one of its distances may have moved by more than this [m] since its last
  /// change, or if a side, a first observation or a most frequent label is new. 0: every observation counts.
  double change_tolerance = 0.0005;

  double most_speed = 30.0;      ///< m/s between two images; a larger step is a pose jump
  double most_turn_rate = 10.0;  ///< rad/s between two images; a larger step is a pose jump
};

}  // namespace swiftlet
