#pragma once
// The report without the page's program: tables, and plots as SVG.

#include <string>
#include <vector>

#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/report_document.hpp"
#include "firmware_host/lab/report/table.hpp"

namespace swiftlet {

std::string plainPage(const std::vector<ReportedRun>& runs);

/// An HTML file around its content: title, style, version.
std::string htmlDocument(const std::string& title, const std::string& content);
/// The same with a note that the full report is missing.
std::string plainDocument(const std::string& title, const std::string& content);
std::string tableHtml(const Table& table);

/// The plot as an SVG element: axes, lines and labels.
std::string svgPlot(const Plot& plot);

}  // namespace swiftlet
