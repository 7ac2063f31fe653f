#pragma once
// The report's one document (docs/report.md): all that the page shows, of one run or of two.

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

/// A run and what is known of the world it flew through.
struct ReportedRun {
  RunView view;
  std::string true_surface;           ///< PLY file in the truth's axes; empty: none
  std::map<int, std::string> labels;  ///< names of the map's labels; may be empty
  nlohmann::ordered_json moments;     ///< as servedMoments() or embeddedMoments() makes them; null: none
};

/// One run of the document. A surface that cannot be read is noted as missing.
nlohmann::ordered_json runDocument(const ReportedRun& run);

/// {"format", "program", "runs", "differences"}; differences are named where there are two runs.
nlohmann::ordered_json reportDocument(const std::vector<ReportedRun>& runs);

}  // namespace swiftlet
