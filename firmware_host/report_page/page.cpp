#include "firmware_host/report_page/page.hpp"

#include <filesystem>

#include "drivers/calibration/input_error.hpp"

namespace swiftlet {
namespace {

/// Stands in the page where the document goes.
constexpr std::string_view kPlace = "<!--swiftlet-report-document-->";

}  // namespace

std::string findReportPage() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return "";
  const std::filesystem::path page =
      program.parent_path().parent_path() / "share" / "swiftlet" / "report_page.html";
  return std::filesystem::exists(page, error) ? page.string() : "";
}

std::string pageWith(const std::string& page, const std::string& name,
                     const nlohmann::ordered_json& document) {
  const std::size_t at = page.find(kPlace);
  if (at == std::string::npos) {
    throw InputError(name, 0, "", "has no place for a report's document",
                     "Build and install the program anew");
  }
  // Text of files may hold what ends a script element; bytes that are no UTF-8 are replaced.
  const std::string json = document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string text;
  text.reserve(page.size() + json.size());
  text.append(page, 0, at);
  text += R"(<script type="application/json" id="report-document">)";
  for (const char c : json) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  text += "</script>";
  return text.append(page, at + kPlace.size());
}

}  // namespace swiftlet
