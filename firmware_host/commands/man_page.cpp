#include "firmware_host/commands/man_page.hpp"

#include <fmt/format.h>

#include <sstream>

#include "firmware_host/settings/registry.hpp"

namespace swiftlet {
namespace {

constexpr const char* kExitStatus =
    ".SH EXIT STATUS\n"
    ".TP\n"
    ".B 0\n"
    "Success; \\fBdoctor\\fR: the devices work as configured.\n"
    ".TP\n"
    ".B 1\n"
    "The run or the check failed: missing devices, no pose, a result out of its limits.\n"
    ".TP\n"
    ".B 2\n"
    "Wrong usage or invalid input; the message names file, line, field and remedy.\n";
constexpr const char* kFiles =
    ".SH FILES\n"
    ".TP\n"
    ".I /etc/swiftlet/vehicle.yaml\n"
    "Settings of this vehicle, read by the service \\fBswiftlet.service\\fR; an example is in\n"
    ".IR /usr/share/swiftlet/examples/vehicle .\n"
    ".TP\n"
    ".I /var/lib/swiftlet\n"
    "Run folders written by the service.\n";
constexpr const char* kSeeAlso =
    ".SH SEE ALSO\n"
    "The package \\fBswiftlet\\-doc\\fR has a page for each part in\n"
    ".IR /usr/share/doc/swiftlet .\n";

bool isExample(const std::string& line) { return line.starts_with("  "); }

/// Prose is filled; indented lines of examples keep their line breaks.
std::string footer(const std::string& text) {
  std::string page;
  bool example = false;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    if (isExample(line) != example) {
      page += example ? ".EE\n.RE\n.PP\n" : ".PP\n.RS 4\n.EX\n";
      example = !example;
    }
    page += escapeRoff(example ? line.substr(line.find_first_not_of(' ')) : line) + "\n";
  }
  return example ? page + ".EE\n.RE\n" : page;
}

void addOption(const CLI::Option& option, const CLI::Formatter& words, std::string& page) {
  page += fmt::format(".TP\n\\fB{}\\fR{}\n{}\n",
                      escapeRoff(words.make_option_name(&option, option.get_positional())),
                      escapeRoff(words.make_option_opts(&option)), escapeRoff(option.get_description()));
}

void addOptions(const CLI::App& app, bool help_too, std::string& page) {
  const CLI::Formatter words;
  for (const bool positional : {true, false}) {
    for (const CLI::Option* option : app.get_options()) {
      if (option->get_positional() != positional || option->get_group().empty()) continue;
      if (!help_too && option == app.get_help_ptr()) continue;
      addOption(*option, words, page);
    }
  }
}

std::string usage(const CLI::App& command) {
  const CLI::Formatter words;
  std::string line = "[OPTIONS]";
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional()) line += " " + words.make_option_usage(option);
  }
  return line;
}

/// `before`: name of the program and of the parent commands.
void addCommand(const std::string& before, const CLI::App& command, std::string& page) {
  const std::string name = before + " " + command.get_name();
  const auto parts = command.get_subcommands({});
  page += fmt::format(".SS {} {}\n{}.\n", escapeRoff(name),
                      parts.empty() ? escapeRoff(usage(command)) : "COMMAND [OPTIONS]",
                      escapeRoff(command.get_description()));
  addOptions(command, false, page);
  if (!command.get_footer().empty()) page += ".PP\n" + footer(command.get_footer());
  for (const CLI::App* part : parts) addCommand(name, *part, page);
}

void addSettings(std::string& page) {
  page +=
      ".SH SETTINGS\n"
      "YAML, in groups: the part before the dot is the group's name.\n"
      "\\fBswiftlet settings\\fR prints all of them as a file with these explanations.\n";
  const Settings defaults;
  for (const Setting& setting : settingsRegistry()) {
    page += fmt::format(".TP\n.B {}\n{}\nRange: {}; default {}.\n", escapeRoff(std::string(setting.key)),
                        escapeRoff(std::string(setting.doc)), escapeRoff(rangeText(setting)),
                        escapeRoff(valueText(setting, defaults)));
  }
}

}  // namespace

std::string escapeRoff(const std::string& text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins_line = i == 0 || text[i - 1] == '\n';
    switch (text[i]) {
      case '\\':
        escaped += "\\e";
        break;
      case '-':
        escaped += "\\-";
        break;
      case '`':
        escaped += "\\(ga";
        break;
      case '^':
        escaped += "\\(ha";
        break;
      case '\'':
        escaped += "\\(aq";
        break;
      case '.':
        escaped += begins_line ? "\\&." : ".";
        break;
      default:
        escaped += text[i];
    }
  }
  return escaped;
}

std::string manPage(const CLI::App& app, const std::string& version, const std::string& date) {
  const std::string& title = app.get_description();
  const std::size_t colon = title.find(": ");
  std::string page = fmt::format(
      ".\\\" Made by `swiftlet man` from the program's own options and settings.\n"
      ".TH SWIFTLET 1 {} \"{}\" \"User Commands\"\n"
      ".SH NAME\nswiftlet \\- {}\n"
      ".SH SYNOPSIS\n.B swiftlet\n.I COMMAND\n[\\fIOPTIONS\\fR]\n"
      ".SH DESCRIPTION\n",
      date, escapeRoff(version), escapeRoff(colon == std::string::npos ? title : title.substr(colon + 2)));
  page += footer(app.get_footer());
  page += ".SH OPTIONS\n";
  addOptions(app, true, page);
  page += ".SH COMMANDS\n";
  for (const CLI::App* command : app.get_subcommands({})) {
    if (!command->get_group().empty()) addCommand("swiftlet", *command, page);
  }
  addSettings(page);
  return page + kExitStatus + kFiles + kSeeAlso;
}

}  // namespace swiftlet
