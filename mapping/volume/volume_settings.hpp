#pragma once
// What a volume is told once. Metres, seconds, radians.

#include <cstddef>
#include <cstdint>

namespace swiftlet {

/// Label values: 0 (kNoLabel) and 1 to 31, so that five bits hold one and 32 bits a set of them.
inline constexpr int kLabelValues = 32;

struct VolumeSettings {
  double voxel_size = 0.05;
  /// Distances are known up to here, in front of a surface and behind.
  double truncation = 0.15;
  /// Voxels deeper behind a surface than this are left alone: what is there is not known. Two voxels hold all
  /// corners of the cubes that a surface passes through.
  double behind = 0.10;
  /// ... nor deeper than this along the optical axis: past the far edge of a table top, say, that is seen at
  /// a glancing angle.
  double behind_ray = 0.20;
  /// Everything together: blocks, their headers, their index.
  std::size_t memory_bytes = std::size_t{64} << 20U;
  bool labels = true;  ///< keep label counts

  double least_range = 0.2;  ///< depth [m] below which a pixel counts as unmeasured
  double most_range = 10.0;  ///< farther pixels carve up to here and give no surface
  /// A measurement whose standard deviation is this [m] has weight 1; others by the inverse square.
  double reference_sigma = 0.01;
  /// Where the image brings no deviations: sigma = a + b z^2 [m], as a stereo sensor's.
  double sigma_constant = 0.01;
  double sigma_quadratic = 0.0;
  /// A pixel whose deviation is larger [m] says what is free in front of it, and not where the surface is:
  /// twice the truncation distance, beyond which two of three such measurements miss the band. On vil_mh05 it
  /// is what keeps far walls by stereo from standing twice (docs/map.md).
  double most_sigma = 0.30;
  /// Weight at which a voxel stops to gain, so that what changed since is forgotten.
  double most_weight = 100.0;

  /// Bit l set: pixels with label l carve up to their depth and give no surface (moving things).
  std::uint32_t masked_labels = 0;
  /// Labels from here on are out of range: the pixel keeps its depth and loses the label.
  int label_count = kLabelValues;

  /// A block counts as changed when a distance in it may have moved by more than this [m] since it last did,
  /// or a side, a first observation or a most frequent label is new. 0: by any observation.
  double change_tolerance = 0.0005;

  double most_speed = 30.0;      ///< m/s between two images; a larger step is a pose jump
  double most_turn_rate = 10.0;  ///< rad/s, likewise
};

}  // namespace swiftlet
