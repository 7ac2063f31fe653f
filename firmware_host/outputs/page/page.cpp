#include "firmware_host/outputs/page/page.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"

namespace swiftlet {
namespace {

/// Placeholder of the document in the page.
constexpr std::string_view kPlace = "<!--swiftlet-report-document-->";

}  // namespace

ReportProgram readReportProgram() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return {};
  const std::filesystem::path page =
      program.parent_path().parent_path() / "share" / "swiftlet" / "report_page.html";
  std::ifstream file(page, std::ios::binary);
  if (!file) return {};
  return {page.string(), {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()}};
}

namespace {

/// `page` with `text` in place of the placeholder.
std::string filled(const std::string& page, const std::string& name, std::string_view text) {
  const std::size_t at = page.find(kPlace);
  if (at == std::string::npos) {
    throw InputError(name, 0, "", "has no place for a report's document",
                     "Build and install the program again");
  }
  std::string whole;
  whole.reserve(page.size() + text.size());
  whole.append(page, 0, at);
  whole += text;
  return whole.append(page, at + kPlace.size());
}

}  // namespace

std::string pageWith(const std::string& page, const std::string& name,
                     const nlohmann::ordered_json& document) {
  // Texts from files may contain the end tag of a script element; invalid UTF-8 is replaced.
  const std::string json = document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string text = R"(<script type="application/json" id="report-document">)";
  for (const char c : json) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  text += "</script>";
  return filled(page, name, text);
}

std::string livePage(const std::string& page, const std::string& name) {
  return filled(page, name, R"(<meta id="swiftlet-live" content="stream">)");
}

std::string htmlText(const std::string& text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '&':
        html += "&amp;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

nlohmann::ordered_json labelsJson(const std::map<int, std::string>& names) {
  auto labels = nlohmann::ordered_json::array();
  constexpr int kMostLabels = 255;
  for (int label = 1; label <= kMostLabels; ++label) {
    const auto [red, green, blue] = labelColour(static_cast<std::uint8_t>(label));
    const auto name = names.find(label);
    labels.push_back({{"name", name == names.end() ? fmt::format("label {}", label) : name->second},
                      {"colour", fmt::format("#{:02x}{:02x}{:02x}", red, green, blue)}});
  }
  return labels;
}

}  // namespace swiftlet
