#pragma once
// The report's document (docs/report.md): everything that the page shows of one or two runs.

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

/// A run and what is known about its surroundings.
struct ReportedRun {
  RunView view;
  std::string true_surface;           ///< PLY file in the truth's axes; empty: none
  std::map<int, std::string> labels;  ///< names of the map's labels; may be empty
  nlohmann::ordered_json moments;     ///< from servedMoments() or embeddedMoments(); null: none
};

/// One run of the document. A surface that cannot be read is noted as missing.
nlohmann::ordered_json runDocument(const ReportedRun& run);

/// {"format", "program", "runs", "differences"}; differences only for two runs.
nlohmann::ordered_json reportDocument(const std::vector<ReportedRun>& runs);

}  // namespace swiftlet
