#pragma once
// A text file written line by line, each line handed to the operating system at once: a run's results can be
// read during the run and after a crash. InputError if the file cannot be written.

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

namespace swiftlet {

class LineFile {
 public:
  explicit LineFile(const std::string& path);
  /// Writes `line` and a line end.
  void write(std::string_view line);

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  std::string path_;
  std::unique_ptr<std::FILE, Closer> file_;
};

}  // namespace swiftlet
