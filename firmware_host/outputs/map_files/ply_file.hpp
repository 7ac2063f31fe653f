#pragma once
// Triangle meshes and point sets in PLY files.
//
// Written: binary little-endian; vertices x y z (float) red green blue (uchar, all three the grey
// value), faces as a list (uchar count, int vertex_indices) and label (uchar).
// Read: ASCII and binary little-endian; elements `vertex` (x y z of any number type, red green blue
// where given, turned to grey by luma weights) and `face` (vertex_indices or vertex_index, all
// triangles; label where given, 0 to 255). A file without faces is a set of points. Other elements and
// properties are passed over.
// Refused, by InputError with the line (ASCII) or the byte (binary), the field and a remedy: a file cut
// short or with bytes behind its end, counts that the file is too short for (found before anything is
// reserved), NaN and infinite coordinates, indices without a vertex, polygons of other than three
// corners, big-endian files.
// Memory: the file and the mesh once. Source of the format: G. Turk, "The PLY Polygon File Format", 1994.

#include <string>
#include <string_view>

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

/// Empty `grey` and `labels` are written as grey 128 and label 0. InputError if the file cannot be written,
/// or if readPly() would reject the mesh (nothing is written then).
void writePly(const std::string& path, const TriangleMesh& mesh,
              WholeFile::Sync sync = WholeFile::Sync::kYes);

TriangleMesh readPly(const std::string& path);
/// `name` names the file in messages.
TriangleMesh readPlyText(const std::string& name, std::string_view bytes);

}  // namespace swiftlet
