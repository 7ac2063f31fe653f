#pragma once
// The manual page, generated from the options that `--help` prints and from the settings' descriptions.
//
// Text in the macros of man(7), for `man`, mandoc and Debian. help2man is not used: it joins the lines of the
// examples and does not know subcommands.

#include <CLI/CLI.hpp>
#include <string>

namespace swiftlet {

/// `date` (YYYY-MM-DD) is printed in the page's footer.
std::string manPage(const CLI::App& app, const std::string& version, const std::string& date);

/// Plain text escaped for roff: no character acts as a command, and hyphens can be copied.
std::string escapeRoff(const std::string& text);

}  // namespace swiftlet
