#pragma once
// The graph of a kept map as a file, written whole and read whole. docs/formats.md has the layout.
//
// The same graph gives the same bytes. A CRC covers everything; then each number is looked at, so that what
// is read is finite, rotations are unit, loops lead to nodes that are there. Memory: the file and the graph.
// InputError names the file, the byte, the field and the remedy.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mapping/loop/kept_graph.hpp"

namespace swiftlet {

std::vector<std::uint8_t> keptGraphBytes(const KeptGraph& graph);
/// `name`: of the file, for messages.
KeptGraph readKeptGraph(const std::string& name, std::span<const std::uint8_t> bytes);
KeptGraph readKeptGraphFile(const std::string& path);

}  // namespace swiftlet
