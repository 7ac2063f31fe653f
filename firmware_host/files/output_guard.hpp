#pragma once
// Keeps a command from writing over what it reads.

#include <string>
#include <vector>

namespace swiftlet {

/// InputError if `output` is one of the files or folders `inputs`, or lies inside one. Symbolic links are
/// followed. Empty names are skipped.
void refuseOutputInInput(const std::string& output, const std::vector<std::string>& inputs);

}  // namespace swiftlet
