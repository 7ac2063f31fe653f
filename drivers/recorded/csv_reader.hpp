#pragma once
// Reads the rows of a comma- or blank-separated text file, one at a time, in constant memory.
//
// Blank lines, lines that start with '#', and a first line whose first field is not a number (a header
// without '#') are skipped. CR, surrounding blanks and a byte order mark of UTF-8 are removed; UTF-16 is an
// InputError. A caller that cannot use a row rejects it: the row is counted and named in a warning, and
// reading continues. finish() throws an InputError that names the first bad row if more than a tenth of the
// rows (and more than three) are rejected, or if no row is valid.

#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/log_warnings.hpp"

namespace swiftlet {

/// Input text for messages: in quotes, cut to 40 characters, with unprintable ones replaced.
std::string quoteInput(std::string_view text);

class CsvReader {
 public:
  static constexpr std::size_t kMaxFields = 64;
  static constexpr std::size_t kMaxLine = 4096;  ///< bytes; far above any format read here

  enum class Separator { kComma, kBlank };

  /// kComma if the first line of data has a comma.
  static Separator separatorOf(const std::string& path);
  static Separator separatorOfText(std::string_view text);

  /// Opens `path`; InputError if that fails.
  CsvReader(const std::string& path, Separator separator, LogCounters& counters, LogWarnings& warnings);
  /// Reads text in memory, which must outlive the reader. `name` names the file in messages.
  CsvReader(const std::string& name, std::string_view text, Separator separator, LogCounters& counters,
            LogWarnings& warnings);

  /// Moves to the next row with at least `min_fields` fields; shorter rows are rejected.
  bool next(std::size_t min_fields);
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::string_view field(std::size_t i) const {
    return i < size_ ? fields_[i] : std::string_view{};
  }
  /// The field as a finite number. False: the row is counted as NaN, or, if the field is not a number,
  /// rejected with the field's `name`.
  bool number(std::size_t i, const char* name, double& value);
  bool numbers(std::size_t first, std::span<const char* const> names, double* values);
  /// The field as a decimal integer; otherwise false, and the row is rejected.
  bool integer(std::size_t i, const char* name, std::int64_t& value);
  void reject(const char* field_name, const std::string& message);
  /// The first row that was rejected or counted as NaN, for callers that tolerate none.
  [[nodiscard]] const std::optional<InputError>& firstBad() const { return first_bad_; }

  /// Call after next() has returned false.
  void finish(const char* what, const char* remedy) const;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] int line() const { return line_; }
  /// The header line (first '#' line or text line), empty without one.
  [[nodiscard]] const std::string& header() const { return header_; }
  [[nodiscard]] int headerLine() const { return header_line_; }  ///< 0 without one
  [[nodiscard]] InputError error(const char* field_name, const std::string& message,
                                 const std::string& remedy) const;

 private:
  struct FileCloser {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  bool readLine();
  bool isHeader() const;
  void split();

  std::string name_;
  Separator separator_;
  LogCounters* counters_;
  LogWarnings* warnings_;
  std::unique_ptr<std::FILE, FileCloser> file_;
  std::string_view rest_;  ///< unread text when reading from memory
  std::array<char, kMaxLine> buffer_{};
  std::string_view text_;  ///< the line, trimmed
  bool overlong_ = false;
  std::string header_;
  int header_line_ = 0;
  std::array<std::string_view, kMaxFields> fields_{};
  std::size_t size_ = 0;
  int line_ = 0;
  std::uint64_t rows_ = 0;
  std::uint64_t bad_ = 0;
  std::uint64_t nan_ = 0;
  std::optional<InputError> first_bad_;
};

}  // namespace swiftlet
