#include "firmware_host/commands/view_option.hpp"

#include <fmt/format.h>

namespace swiftlet {

CLI::Option* ViewOption::addTo(CLI::App& command) {
  option =
      command
          .add_option(
              "--view", text,
              fmt::format("Serve a page that shows the run live, by default at {}; port 0: any free port",
                          ViewAddress{}.text()))
          ->type_name("[ADDRESS:PORT]")
          ->expected(0, 1);
  return option;
}

std::optional<ViewAddress> ViewOption::read() const {
  if (option == nullptr || option->count() == 0) return {};
  return parseViewAddress(text);
}

}  // namespace swiftlet
