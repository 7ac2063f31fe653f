#pragma once
// The report as a file: one self-contained HTML page.
//
// The page's program (plots and 3D view) is a data file of the installation, share/swiftlet/report_page.html
// beside the bin folder, built if npm is available. The document is inserted into it. Without that file the
// page is plain: tables, and plots as SVG.

#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace swiftlet {

/// Incremented when pages of an earlier program cannot read the document.
inline constexpr int kReportFormat = 1;

/// The page's program in the running program's installation.
struct ReportProgram {
  std::string name;  ///< name of its file; empty: not installed
  std::string text;
};
ReportProgram readReportProgram();

/// `page`: ReportProgram's text. InputError naming `name` if it is not a page of this format.
std::string pageWith(const std::string& page, const std::string& name,
                     const nlohmann::ordered_json& document);

/// The same page for a running run: it loads its document from the relative address `stream`.
std::string livePage(const std::string& page, const std::string& name);

/// Escapes text for HTML.
std::string htmlText(const std::string& text);

/// The scene's "labels": name and colour of each label; labels without a name get a generated one.
nlohmann::ordered_json labelsJson(const std::map<int, std::string>& names);

}  // namespace swiftlet
