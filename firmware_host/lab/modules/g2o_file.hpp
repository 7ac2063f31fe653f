#pragma once
// Pose graphs in g2o files, plain or packed by xz (recognized by content). What is accepted, repaired and
// refused: mapping/pose_graph/g2o_text.hpp. InputError names file, line, field and remedy.

#include <string>
#include <string_view>
#include <vector>

#include "mapping/pose_graph/g2o_text.hpp"

namespace swiftlet {

/// Limit of the unpacked text: 50 times the largest published graph. Protects the memory from small packed
/// files that expand enormously.
inline constexpr std::size_t kMaxG2oText = std::size_t{1} << 30U;

struct G2oFile {
  G2oGraph graph;
  G2oReport report;
};

G2oFile readG2oFile(const std::string& path);
/// `name`: the file's name in messages; `bytes` may be packed.
G2oFile readG2oBytes(const std::string& name, std::string_view bytes);

/// Writes plain text. The file appears completely or not at all.
void writeG2oFile(const std::string& path, const G2oGraph& graph);

/// Text of a warning: "name:line: field: text. remedy".
std::string warningText(const std::string& name, const G2oMessage& warning);

}  // namespace swiftlet
