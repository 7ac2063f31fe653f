#pragma once
// The map's surface in files: PLY for tools that measure, binary glTF for viewers.
//
// PLY, binary little-endian: vertices x y z nx ny nz (float), red green blue (uchar: the grey value), label
// and label_probability (uchar, 255: certain); faces vertex_indices (uchar count, int) and label (uchar).
// readPly() reads it. glTF 2.0 (Khronos, "glTF 2.0 Specification", sections 4 and 5), one .glb: positions,
// normals, colours (the label's colour with the image's brightness; grey if unlabelled) and the
// application-specific attribute `_LABEL` (label, probability). glTF has y up, so one node rotates the map.
// InputError if a file cannot be written or the mesh is too large for the format (4 GiB). Memory: the file
// once.

#include <string>

#include "firmware_host/outputs/map_files/map_mesh.hpp"

namespace swiftlet {

void writeMapPly(const std::string& path, const MapMesh& mesh);
void writeMapGlb(const std::string& path, const MapMesh& mesh);

/// Red, green, blue of a label; the same everywhere.
std::array<std::uint8_t, 3> labelColour(std::uint8_t label);

}  // namespace swiftlet
