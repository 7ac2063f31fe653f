#pragma once
// Triangle meshes and point sets in PLY files.
//
// Written: binary little-endian; vertices x y z (float) red green blue (uchar, all three the grey value),
// faces as a list (uchar count, int vertex_indices) and label (uchar).
// Read: ASCII and binary little-endian; elements `vertex` (x y z of any number type; red green blue if
// present, converted to grey by luma weights) and `face` (vertex_indices or vertex_index, all triangles;
// label if present, 0 to 255). A file without faces is a set of points. Other elements and properties are
// skipped.
// Refused by InputError with the line (ASCII) or byte (binary), the field and a remedy: truncated files and
// files with extra bytes at the end, counts that exceed the file's size (found before anything is reserved),
// NaN and infinite coordinates, indices without a vertex, polygons that are not triangles, big-endian files.
// Memory: the file and the mesh once. Source of the format: G. Turk, "The PLY Polygon File Format", 1994.

#include <string>
#include <string_view>

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

/// Empty `grey` and `labels` are written as grey 128 and label 0. InputError if the file cannot be written,
/// or if readPly() would reject the mesh (then nothing is written).
void writePly(const std::string& path, const TriangleMesh& mesh,
              WholeFile::Sync sync = WholeFile::Sync::kYes);

TriangleMesh readPly(const std::string& path);
/// `name` names the file in messages.
TriangleMesh readPlyText(const std::string& name, std::string_view bytes);

}  // namespace swiftlet
