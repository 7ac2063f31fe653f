#pragma once
// A run folder and its truth, for `report` and `view`.

#include <string>

#include "firmware_host/lab/report/report_document.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// `truth`: log or file; empty: the log of the run. Missing or damaged files are noted in the result.
/// InputError if there is no run, or if a given `truth` does not exist.
ReportedRun readReportedRun(const std::string& folder, const std::string& truth, const Settings& settings);

}  // namespace swiftlet
