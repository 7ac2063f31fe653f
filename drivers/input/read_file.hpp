#pragma once
// Reads a whole file as text.

#include <string>

namespace swiftlet {

/// All bytes of a file. InputError with the system's reason and `remedy` if it cannot be read completely: a
/// plain stream would take a folder or a disk error for the end of the file.
[[nodiscard]] std::string readFile(const std::string& path, const std::string& remedy);

}  // namespace swiftlet
