#pragma once
// Rules for calling a calibration good, as a table and as text.

#include <string>
#include <vector>

#include "firmware_host/lab/calibrate/page/calibration_page.hpp"

namespace swiftlet {

/// Share of the corners; mrcal's documentation calls more suspicious.
inline constexpr double kMostOutliers = 0.03;

class PageRules {
 public:
  /// `broken`: sentence for the top of the page, saying what it means and what to do.
  void atMost(const std::string& what, const std::string& unit, double found, double limit,
              const std::string& broken);
  void atLeast(const std::string& what, const std::string& unit, double found, double limit,
               const std::string& broken);

  /// Adds verdict, text and the table of rules; `reasons`: the solution's own.
  void finish(const std::vector<std::string>& reasons, CalibrationPage& page) const;

 private:
  struct Rule {
    std::string what, unit, limit;
    double found = 0;
    bool kept = true;
    std::string broken;
  };
  void add(Rule rule);
  std::vector<Rule> rules_;
};

}  // namespace swiftlet
