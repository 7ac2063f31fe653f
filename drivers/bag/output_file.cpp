#include "drivers/bag/output_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/input/input_error.hpp"

namespace swiftlet {

OutputFile::OutputFile(std::string path) : path_(std::move(path)), file_(std::fopen(path_.c_str(), "wbe")) {
  if (!file_) fail();
  // Writers put whole chunks into it; one that is complete must not wait for the next.
  std::setvbuf(file_.get(), nullptr, _IONBF, 0);
}

void OutputFile::write(std::span<const std::uint8_t> bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail();
  size_ += bytes.size();
}

void OutputFile::overwrite(std::uint64_t at, std::span<const std::uint8_t> bytes) {
  if (std::fseek(file_.get(), static_cast<long>(at), SEEK_SET) != 0) fail();
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail();
}

void OutputFile::close() {
  // A pipe or a device has nothing to wait for.
  if (::fdatasync(::fileno(file_.get())) != 0 && errno != EINVAL && errno != EROFS) fail();
  if (std::fclose(file_.release()) != 0) fail();
}

void OutputFile::fail() const {
  throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                   "Check that the folder exists and is writable and the disk is not full");
}

}  // namespace swiftlet
