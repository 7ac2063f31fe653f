#pragma once
// The report where the page's program is missing: tables, and plots as SVG.

#include <string>
#include <vector>

#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/report_document.hpp"
#include "firmware_host/lab/report/table.hpp"

namespace swiftlet {

std::string plainPage(const std::vector<ReportedRun>& runs);

/// The page around its content.
std::string plainDocument(const std::string& title, const std::string& content);
std::string tableHtml(const Table& table);

/// The plot as an SVG element: axes, lines and what they are called.
std::string svgPlot(const Plot& plot);

}  // namespace swiftlet
