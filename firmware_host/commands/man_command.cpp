#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdlib>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/man_page.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

/// Today, or the date that packagers set for reproducible builds (SOURCE_DATE_EPOCH, seconds).
std::string dateOfPage() {
  const char* epoch = std::getenv("SOURCE_DATE_EPOCH");
  constexpr int kDecimal = 10;
  const std::time_t time = epoch == nullptr ? std::time(nullptr) : std::strtoll(epoch, nullptr, kDecimal);
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(time));
}

}  // namespace

void addManCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("man", "Print the manual page in the format of man(1)");
  command->group("");  // hidden: for the build; users have `man swiftlet`
  command->footer("Example:\n  swiftlet man > swiftlet.1 && man ./swiftlet.1");
  command->callback([&app, &exit_code] {
    const auto version = versionJson().at("swiftlet").get<std::string>();
    fmt::print("{}", manPage(app, "swiftlet " + version, dateOfPage()));
    exit_code = kExitDone;
  });
}

}  // namespace swiftlet
