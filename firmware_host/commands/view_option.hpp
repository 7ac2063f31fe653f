#pragma once
// `--view [ADDRESS:PORT]` of the commands that run live.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

struct ViewOption {
  std::string text;
  CLI::Option* option = nullptr;

  CLI::Option* addTo(CLI::App& command);
  /// Address to serve; empty: the view is off. InputError.
  [[nodiscard]] std::optional<ViewAddress> read() const;
};

}  // namespace swiftlet
