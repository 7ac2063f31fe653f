// The manual page: made from the options of a small program, and what roff would take for its own.

#include <catch2/catch.hpp>
#include <string>

#include "firmware_host/commands/man_page.hpp"
#include "firmware_host/settings/registry.hpp"

namespace swiftlet {
namespace {

std::string pageOfASmallProgram() {
  CLI::App app("swiftlet: a small program");
  app.footer("Example:\n  swiftlet look here -n 2");
  CLI::App* look = app.add_subcommand("look", "Look at a place");
  look->add_option("PLACE", "Where to look")->required();
  look->add_option("-n,--times", "How often");
  look->footer(".hidden files count.\nExample:\n  swiftlet look 'a place'\n  swiftlet look \\server");
  CLI::App* map = app.add_subcommand("map", "Look at maps");
  map->footer("");
  map->add_subcommand("slice", "Cut a map")->add_option("MAP", "What to cut")->required();
  app.add_subcommand("secret", "Not to be shown")->group("");
  return manPage(app, "swiftlet 1.2", "2026-01-31");
}

bool has(const std::string& page, const std::string& text) { return page.find(text) != std::string::npos; }

TEST_CASE("man page: commands, options, examples line by line") {
  const std::string page = pageOfASmallProgram();
  CHECK(has(page, ".TH SWIFTLET 1 2026-01-31 \"swiftlet 1.2\""));
  CHECK(has(page, ".SH NAME\nswiftlet \\- a small program\n"));
  CHECK(has(page, ".SS swiftlet look [OPTIONS] PLACE\nLook at a place.\n"));
  CHECK(has(page, ".TP\n\\fB\\-n,\\-\\-times\\fR\nHow often\n"));
  CHECK(has(page, ".EX\nswiftlet look \\(aqa place\\(aq\nswiftlet look \\eserver\n.EE\n"));
  CHECK(has(page, ".SS swiftlet map COMMAND [OPTIONS]\nLook at maps.\n"));
  CHECK(has(page, ".SS swiftlet map slice [OPTIONS] MAP\nCut a map.\n"));
  CHECK_FALSE(has(page, "secret"));
}

TEST_CASE("man page: no text becomes a roff request") {
  CHECK(escapeRoff(".SH no title") == "\\&.SH no title");
  CHECK(escapeRoff("'br") == "\\(aqbr");
  CHECK(escapeRoff("a.b\n.c") == "a.b\n\\&.c");
  CHECK(has(pageOfASmallProgram(), "\n\\&.hidden files count.\n"));
}

TEST_CASE("man page: every setting with its range") {
  const std::string page = pageOfASmallProgram();
  for (const Setting& setting : settingsRegistry()) {
    INFO(setting.key);
    const std::string::size_type at = page.find(".B " + escapeRoff(std::string(setting.key)) + "\n");
    REQUIRE(at != std::string::npos);
    CHECK(has(page.substr(at), "Range: " + escapeRoff(rangeText(setting))));
  }
}

}  // namespace
}  // namespace swiftlet
