#pragma once
// The page of a calibration: one HTML file with a summary in words at the top (docs/report.md,
// docs/calibration.md).

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/table.hpp"

namespace swiftlet {

enum class PageVerdict { kGood, kUsable, kRepeat };

struct CalibrationPage {
  std::string name;
  PageVerdict verdict = PageVerdict::kGood;
  std::string verdict_text;
  std::vector<std::string> words;  ///< one sentence each
  std::vector<Plot> plots;
  std::vector<Table> tables;
  nlohmann::ordered_json scene;  ///< null: no 3D view
};

/// Writes the page with its program if that is installed, otherwise a plain one. InputError if the file
/// cannot be written.
void writeCalibrationPage(const std::string& path, const CalibrationPage& page);

/// The same as text. `program`: the page of readReportProgram(); empty: plain.
std::string calibrationHtml(const CalibrationPage& page, const std::string& program,
                            const std::string& program_name);

}  // namespace swiftlet
