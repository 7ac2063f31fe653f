#pragma once
// Progress on stderr: on a terminal a bar with the remaining time, otherwise a plain line for every tenth.

#include <cstdint>
#include <string>

namespace swiftlet {

class Progress {
 public:
  /// `total` steps of `what`; 0: shows nothing.
  Progress(std::string what, std::uint64_t total);
  void update(std::uint64_t done);
  /// Ends the line.
  void finish();

 private:
  std::string what_;
  std::uint64_t total_;
  bool terminal_;
  double start_;
  double last_drawn_ = 0;
  std::uint64_t tenths_said_ = 0;
};

}  // namespace swiftlet
