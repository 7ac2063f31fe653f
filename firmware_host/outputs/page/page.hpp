#pragma once
// The report's file: one HTML page that needs nothing else.
//
// The page's program (plots and 3D view) is a data file of the installation, share/swiftlet/report_page.html
// beside the bin folder, made at build time where npm is at hand; the document is put into it. Without that
// file the page is plain: tables, and plots as SVG.

#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace swiftlet {

/// Raised when a page of an earlier program could not read the document.
inline constexpr int kReportFormat = 1;

/// The page's program, of the installation that the running program belongs to.
struct ReportProgram {
  std::string name;  ///< of its file; empty: the installation has none
  std::string text;
};
ReportProgram readReportProgram();

/// `page`: ReportProgram's text. InputError names `name` when it is no page of this format.
std::string pageWith(const std::string& page, const std::string& name,
                     const nlohmann::ordered_json& document);

/// The same page for a running run: it loads its document from the address `stream` beside it.
std::string livePage(const std::string& page, const std::string& name);

/// Escapes text for HTML.
std::string htmlText(const std::string& text);

/// The scene's "labels": name and colour of each; those without a name get one.
nlohmann::ordered_json labelsJson(const std::map<int, std::string>& names);

}  // namespace swiftlet
