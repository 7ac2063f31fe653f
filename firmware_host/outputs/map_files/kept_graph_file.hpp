#pragma once
// The graph of a kept map as a file, written and read as a whole. docs/formats.md has the layout.
//
// The same graph gives the same bytes. A CRC covers everything. Then each value is checked: numbers are
// finite, rotations are unit, loops lead to existing nodes. Memory: the file and the graph. InputError names
// the file, the byte, the field and the remedy.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mapping/loop/kept_graph.hpp"

namespace swiftlet {

std::vector<std::uint8_t> keptGraphBytes(const KeptGraph& graph);
/// `name`: the file's name in messages.
KeptGraph readKeptGraph(const std::string& name, std::span<const std::uint8_t> bytes);
KeptGraph readKeptGraphFile(const std::string& path);

}  // namespace swiftlet
