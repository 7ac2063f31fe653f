#include "drivers/input/read_file.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

std::string readFile(const std::string& path, const std::string& remedy) {
  constexpr std::size_t kPart = 65536;
  const auto part = std::make_unique<std::array<char, kPart>>();
  const std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "rb"));
  std::string bytes;
  while (file) {
    const std::size_t count = std::fread(part->data(), 1, kPart, file.get());
    bytes.append(part->data(), count);
    if (count == 0 && std::ferror(file.get()) == 0) return bytes;
    if (count == 0) break;
  }
  throw InputError(path, 0, "", std::string("cannot be read: ") + std::strerror(errno), remedy);
}

}  // namespace swiftlet
