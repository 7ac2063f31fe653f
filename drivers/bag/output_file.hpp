#pragma once
// A file that a writer of bags fills. Errors: InputError with the system's reason. What is written survives
// the program, and a power cut once the system has put it on the disk or close() has returned.

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>

namespace swiftlet {

class OutputFile {
 public:
  /// Creates or empties it.
  explicit OutputFile(std::string path);
  void write(std::span<const std::uint8_t> bytes);
  /// Bytes written.
  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// Writes over bytes that are there.
  void overwrite(std::uint64_t at, std::span<const std::uint8_t> bytes);
  /// Waits until all is on the disk; nothing may be written afterwards.
  void close();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  [[noreturn]] void fail() const;

  std::string path_;
  std::unique_ptr<std::FILE, Closer> file_;
  std::uint64_t size_ = 0;
};

}  // namespace swiftlet
