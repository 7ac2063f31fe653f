#include "tests/logs/accuracy_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <istream>
#include <ostream>
#include <sstream>
#include <stdexcept>

namespace swiftlet {
namespace {

constexpr const char* kHeader = "log,cameras,trajectory,all_m,from_3s_m";

const AccuracyRow* findCase(const std::vector<AccuracyRow>& rows, const AccuracyRow& wanted) {
  const auto found = std::ranges::find_if(rows, [&](const AccuracyRow& r) { return r.sameCase(wanted); });
  return found == rows.end() ? nullptr : &*found;
}

// An empty field is a log too short for the figure.
bool readFigure(std::istream& fields, double& figure) {
  std::string text;
  std::getline(fields, text, ',');
  figure = std::nan("");
  std::istringstream number(text);
  return text.empty() || (number >> figure && number.eof());
}

std::string figureText(double figure) { return std::isnan(figure) ? "" : fmt::format("{:.4f}", figure); }

std::string nameOf(const AccuracyRow& row) {
  return fmt::format("{}, {} camera{}, {}", row.log, row.cameras, row.cameras == 1 ? "" : "s",
                     row.trajectory);
}

}  // namespace

bool isWorse(double now, double before) {
  return !(now <= before + std::max(kAllowedShare * before, kAllowedMetres));
}

std::vector<std::string> findWorse(const std::vector<AccuracyRow>& now,
                                   const std::vector<AccuracyRow>& before) {
  std::vector<std::string> lines;
  const auto compare = [&](const AccuracyRow& row, const char* section, double value, double committed) {
    if (std::isnan(committed) || !isWorse(value, committed)) return;
    lines.push_back(
        fmt::format("{}, {}: {:.4f} m, committed {:.4f} m", nameOf(row), section, value, committed));
  };
  for (const AccuracyRow& row : now) {
    const AccuracyRow* committed = findCase(before, row);
    if (committed == nullptr) continue;
    compare(row, "all", row.all, committed->all);
    compare(row, "from 3 s", row.from_3s, committed->from_3s);
  }
  return lines;
}

std::vector<std::string> findLost(const std::vector<AccuracyRow>& now,
                                  const std::vector<AccuracyRow>& before) {
  std::vector<std::string> lines;
  for (const AccuracyRow& row : before) {
    if (findCase(now, row) == nullptr) lines.push_back(nameOf(row));
  }
  return lines;
}

std::vector<AccuracyRow> updatedRows(const std::vector<AccuracyRow>& now, std::vector<AccuracyRow> before) {
  const auto replayed = [&](const AccuracyRow& row) {
    return std::ranges::any_of(now, [&](const AccuracyRow& r) { return r.log == row.log; });
  };
  std::erase_if(before,
                [&](const AccuracyRow& row) { return replayed(row) && findCase(now, row) == nullptr; });
  for (const AccuracyRow& row : now) {
    const auto found = std::ranges::find_if(before, [&](const AccuracyRow& r) { return r.sameCase(row); });
    if (found == before.end()) {
      before.push_back(row);
    } else {
      *found = row;
    }
  }
  return before;
}

std::vector<AccuracyRow> readAccuracyRows(std::istream& in) {
  std::vector<AccuracyRow> rows;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line == kHeader) continue;
    std::istringstream fields(line);
    AccuracyRow row;
    char comma = 0;
    const bool read = std::ranges::count(line, ',') == 4 && std::getline(fields, row.log, ',') &&
                      fields >> row.cameras >> comma && std::getline(fields, row.trajectory, ',') &&
                      readFigure(fields, row.all) && readFigure(fields, row.from_3s);
    if (!read) throw std::runtime_error(fmt::format("line {}: not `{}`", number, kHeader));
    rows.push_back(row);
  }
  return rows;
}

void writeAccuracyRows(std::ostream& out, const std::vector<AccuracyRow>& rows) {
  out << kHeader << '\n';
  for (const AccuracyRow& row : rows) {
    out << fmt::format("{},{},{},{},{}\n", row.log, row.cameras, row.trajectory, figureText(row.all),
                       figureText(row.from_3s));
  }
}

std::string accuracyMarkdown(const std::vector<AccuracyRow>& now, const std::vector<AccuracyRow>& before) {
  std::string text =
      "| log | cameras | trajectory | all [m] | committed | from 3 s [m] | committed |\n"
      "|---|---|---|---|---|---|---|\n";
  for (const AccuracyRow& row : now) {
    const AccuracyRow* committed = findCase(before, row);
    const auto cell = [&](double AccuracyRow::*value) {
      return committed == nullptr ? std::string("new") : figureText(committed->*value);
    };
    text += fmt::format("| `{}` | {} | {} | {} | {} | {} | {} |\n", row.log, row.cameras, row.trajectory,
                        figureText(row.all), cell(&AccuracyRow::all), figureText(row.from_3s),
                        cell(&AccuracyRow::from_3s));
  }
  return text;
}

}  // namespace swiftlet
