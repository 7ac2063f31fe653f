#pragma once
// Reads the words of one line of g2o text one by one, with field names for error messages.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "mapping/pose_graph/g2o_text.hpp"

namespace swiftlet {

/// A word of a file for messages: printable and short.
std::string shown(std::string_view word);

class G2oFields {
 public:
  void start(std::string_view line, std::size_t number);

  /// The next word; false at the end of the line.
  bool word(std::string_view& out);
  [[nodiscard]] bool atEnd() const { return rest_.empty(); }

  /// Each returns false and sets `fault` if the word is missing or of another kind.
  bool id(const char* name, std::int64_t& out, G2oMessage& fault);
  bool number(const char* name, double& out, G2oMessage& fault);
  bool numbers(std::span<const char* const> names, std::span<double> out, G2oMessage& fault);
  bool end(G2oMessage& fault);

 private:
  bool missing(const char* name, G2oMessage& fault) const;

  std::string_view rest_;
  std::string kind_;
  std::size_t line_ = 0;
  std::size_t words_ = 0;
};

}  // namespace swiftlet
