#pragma once
// The manual page, made from the same options that `--help` prints, and from the settings' explanations.
//
// Text in the macros of man(7), as `man`, mandoc and Debian take it. help2man would do for one command; it
// runs the lines of the examples together and knows no commands of a program.

#include <CLI/CLI.hpp>
#include <string>

namespace swiftlet {

/// `date` (YYYY-MM-DD) is printed in the page's footer.
std::string manPage(const CLI::App& app, const std::string& version, const std::string& date);

/// Plain text as roff takes it: no character of it is a command, a hyphen stays one when copied.
std::string escapeRoff(const std::string& text);

}  // namespace swiftlet
