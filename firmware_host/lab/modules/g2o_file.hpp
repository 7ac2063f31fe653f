#pragma once
// Pose graphs in g2o files, plain or packed by xz (told by content, not by name). What is taken, repaired and
// refused: mapping/pose_graph/g2o_text.hpp. InputError names file, line, field and remedy.

#include <string>
#include <string_view>
#include <vector>

#include "mapping/pose_graph/g2o_text.hpp"

namespace swiftlet {

/// Unpacked text above this is refused: 50 times the largest published graph, and what a packed file of a few
/// kilobytes could be made to grow to would fill the memory.
inline constexpr std::size_t kMaxG2oText = std::size_t{1} << 30U;

struct G2oFile {
  G2oGraph graph;
  G2oReport report;
};

G2oFile readG2oFile(const std::string& path);
/// `name` names the file in messages; `bytes` may be packed.
G2oFile readG2oBytes(const std::string& name, std::string_view bytes);

/// Plain text. The file appears whole or not at all.
void writeG2oFile(const std::string& path, const G2oGraph& graph);

/// "name:line: field: text. remedy" of a warning.
std::string warningText(const std::string& name, const G2oMessage& warning);

}  // namespace swiftlet
