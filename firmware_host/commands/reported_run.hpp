#pragma once
// A run folder beside its truth, as `report` and `view` show it.

#include <string>

#include "firmware_host/lab/report/report_document.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// `truth`: log or file; empty: the log that the run was made from. What is missing or damaged is noted in
/// the run; InputError where there is no run, or no truth of that name.
ReportedRun readReportedRun(const std::string& folder, const std::string& truth, const Settings& settings);

}  // namespace swiftlet
