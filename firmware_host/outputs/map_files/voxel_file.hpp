#pragma once
// A volume's voxels as points in a PLY file, for tools that do not read kept maps.
//
// Binary little-endian, map axes, metres. One vertex per observed voxel, in the order of the blocks' keys: x
// y z of its centre, distance to the surface (positive in front of it, cut off at the truncation distance)
// and weight (float), red green blue (uchar: the grey value), label and label_probability (uchar, 255:
// certain). Blocks that were only seen as free are omitted. Memory: one block. InputError if the file cannot
// be written.

#include <cstddef>
#include <string>

#include "mapping/volume/confusion_model.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// Returns the number of voxels.
std::size_t writeVoxelPly(const std::string& path, const VoxelVolume& volume,
                          const ConfusionModel& confusion);

}  // namespace swiftlet
