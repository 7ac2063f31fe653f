#include "firmware_host/files/line_file.hpp"

#include <cerrno>
#include <cstring>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

[[noreturn]] void failToWrite(const std::string& path) {
  throw InputError(path, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                   "Check that the folder is writable and the disk is not full");
}

}  // namespace

LineFile::LineFile(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
  if (!file_) failToWrite(path_);
}

void LineFile::write(std::string_view line) {
  const bool written = std::fwrite(line.data(), 1, line.size(), file_.get()) == line.size() &&
                       std::fputc('\n', file_.get()) != EOF && std::fflush(file_.get()) == 0;
  if (!written) failToWrite(path_);
}

}  // namespace swiftlet
