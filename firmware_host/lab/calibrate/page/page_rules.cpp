#include "firmware_host/lab/calibrate/page/page_rules.hpp"

#include <fmt/format.h>

namespace swiftlet {

void PageRules::add(Rule rule) { rules_.push_back(std::move(rule)); }

// NaN breaks a rule: a value that was not found is not good.
void PageRules::atMost(const std::string& what, const std::string& unit, double found, double limit,
                       const std::string& broken) {
  add({what, unit, fmt::format("at most {:.3g}", limit), found, found <= limit, broken});
}

void PageRules::atLeast(const std::string& what, const std::string& unit, double found, double limit,
                        const std::string& broken) {
  add({what, unit, fmt::format("at least {:.3g}", limit), found, found >= limit, broken});
}

void PageRules::finish(const std::vector<std::string>& reasons, CalibrationPage& page) const {
  Table table{"rules", "Rules", {"what", "found", "good", "unit", "kept"}, {}, false};
  std::vector<std::string> broken;
  for (const Rule& rule : rules_) {
    table.rows.push_back(
        {rule.what, shown(rule.found), rule.limit, rule.unit, rule.kept ? "yes" : "no, missed"});
    if (!rule.kept) broken.push_back(rule.broken);
  }
  if (!reasons.empty()) {
    page.verdict = PageVerdict::kRepeat;
    page.verdict_text = "Repeat the calibration: do not fly with this one.";
  } else if (!broken.empty()) {
    page.verdict = PageVerdict::kUsable;
    page.verdict_text = "Usable, but it can be better.";
  } else {
    page.verdict = PageVerdict::kGood;
    page.verdict_text = "Good: all rules are met.";
  }
  page.words.insert(page.words.end(), reasons.begin(), reasons.end());
  page.words.insert(page.words.end(), broken.begin(), broken.end());
  if (!rules_.empty()) page.tables.insert(page.tables.begin(), table);
}

}  // namespace swiftlet
