#pragma once
// The words of one line of g2o text, taken one by one with their names, so that a fault can say which.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "mapping/pose_graph/g2o_text.hpp"

namespace swiftlet {

/// A word of a file as it is shown in messages: printable and short.
std::string shown(std::string_view word);

class G2oFields {
 public:
  void start(std::string_view line, std::size_t number);

  /// The next word; false at the line's end.
  bool word(std::string_view& out);
  [[nodiscard]] bool atEnd() const { return rest_.empty(); }

  /// Each false with `fault` when the word is missing or is not what is asked for.
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
