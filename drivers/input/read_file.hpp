#pragma once
// A whole file as text, or the reason why it cannot be read.

#include <string>

namespace swiftlet {

/// All bytes of a file. InputError with the system's reason and `remedy` if it cannot be read as a whole: a
/// stream takes a folder, or a disk's error, for the end of the file.
[[nodiscard]] std::string readFile(const std::string& path, const std::string& remedy);

}  // namespace swiftlet
