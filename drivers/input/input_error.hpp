#pragma once
// Bad input, described so that the user can repair it: which file, line and field, what is wrong, what to do.
// Thrown only by file readers on the host side; the program catches it once, prints what() and exits with
// code 2. Nothing on the flight path throws or catches it.

#include <exception>
#include <string>
#include <vector>

namespace swiftlet {

struct InputError : std::exception {
  InputError(std::string file_name, int line_number, std::string field_name, std::string message_text,
             std::string remedy_text)
      : file(std::move(file_name)),
        line(line_number),
        field(std::move(field_name)),
        message(std::move(message_text)),
        remedy(std::move(remedy_text)) {
    text_ = file;
    if (line > 0) text_ += ":" + std::to_string(line);
    if (!field.empty()) text_ += ": " + field;
    text_ += ": " + message;
    if (!remedy.empty()) text_ += ". " + remedy;
  }
  /// "file:line: field: message. remedy"
  [[nodiscard]] const char* what() const noexcept override { return text_.c_str(); }

  std::string file;
  int line = 0;  ///< from 1; 0 if the fault belongs to the whole file
  std::string field;
  std::string message;
  std::string remedy;

 private:
  std::string text_;
};

/// Suspicious but accepted values, a line each: "file:line: field: what".
using Warnings = std::vector<std::string>;

/// The location of a value, for errors and warnings about it.
struct InputPlace {
  std::string file;
  int line = 0;  ///< from 1; 0 if there are no lines
  std::string field;

  [[nodiscard]] InputError error(const std::string& message, const std::string& remedy) const {
    return {file, line, field, message, remedy};
  }
  /// "file:line: field", without unknown parts.
  [[nodiscard]] std::string where() const {
    std::string text = file;
    if (line > 0) text += ":" + std::to_string(line);
    if (!field.empty()) text += ": " + field;
    return text;
  }
};

}  // namespace swiftlet
