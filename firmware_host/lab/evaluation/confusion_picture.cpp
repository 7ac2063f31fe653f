#include "firmware_host/lab/evaluation/confusion_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <vector>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

/// Rarer classes are not part of the mean IoU either.
constexpr double kLeastShare = 0.01;
constexpr int kCell = 56, kLeft = 150, kTop = 120, kMargin = 20;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string text(int x, int y, const char* anchor, const std::string& what, const std::string& more = "") {
  return fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     escaped(what));
}

}  // namespace

std::map<int, std::string> readLabelNames(const std::string& log) {
  namespace fs = std::filesystem;
  std::map<int, std::string> names;
  const fs::path mav = fs::path(log) / "mav0" / "labels0" / "labels.csv";
  const fs::path path = fs::exists(mav) ? mav : fs::path(log) / "labels0" / "labels.csv";
  std::ifstream file(path);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    int label = -1;
    const std::size_t comma = std::min(line.find(','), line.size());
    const auto [end, error] = std::from_chars(line.data(), line.data() + comma, label);
    if (error != std::errc() || end != line.data() + comma || label < 0 || comma + 1 >= line.size()) {
      throw InputError(path.string(), number, "id,name", "\"" + line + "\" is not a label with a name",
                       "Write a number and a name separated by a comma, for example 3,wall");
    }
    names[label] = line.substr(comma + 1);
  }
  return names;
}

std::string confusionSvg(const LabelConfusion& labels, const std::map<int, std::string>& names) {
  const std::vector<std::uint8_t> classes = labels.classes(kLeastShare);
  const auto nameOf = [&](std::uint8_t label) {
    const auto at = names.find(label);
    return at == names.end() ? fmt::format("{}", label) : at->second;
  };
  const int columns = static_cast<int>(classes.size()) + 2, rows = static_cast<int>(classes.size());
  const int width = kLeft + columns * kCell + kMargin, height = kTop + rows * kCell + kMargin;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
      width, height);
  svg += text(kMargin, 24, "start",
              fmt::format("Labels of the map: true class by row, found by column [% of the row]; accuracy "
                          "{:.1f} %, mean IoU {:.1f} %",
                          100 * labels.accuracy(), 100 * labels.meanIntersectionOverUnion(kLeastShare)));
  for (int column = 0; column < columns; ++column) {
    const std::string name = column < rows ? nameOf(classes[static_cast<std::size_t>(column)])
                                           : (column == rows ? "other" : "none");
    const int x = kLeft + column * kCell + kCell / 2, y = kTop - 8;
    svg += text(x, y, "start", name, fmt::format(" transform=\"rotate(-40 {} {})\"", x, y));
  }
  for (int row = 0; row < rows; ++row) {
    const std::uint8_t truth = classes[static_cast<std::size_t>(row)];
    const auto all = static_cast<double>(labels.places(truth));
    double others = all;
    svg += text(kLeft - 8, kTop + row * kCell + kCell / 2 + 4, "end", nameOf(truth));
    for (int column = 0; column < columns; ++column) {
      double count = others;
      if (column < rows) {
        count = static_cast<double>(labels.count(truth, classes[static_cast<std::size_t>(column)]));
      } else if (column == rows) {
        count = others - static_cast<double>(labels.count(truth, 0));
      }
      others -= count;
      const double share = count / all;
      // From white to dark blue, or to dark red for errors.
      const auto tint = [share](int dark) { return static_cast<int>(255 - share * (255 - dark)); };
      const int x = kLeft + column * kCell, y = kTop + row * kCell;
      svg += fmt::format(
          "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"rgb({},{},{})\" stroke=\"#ccc\"/>\n", x,
          y, kCell, kCell, tint(column == row ? 20 : 160), tint(column == row ? 70 : 20),
          tint(column == row ? 140 : 20));
      if (share >= 0.0005) {
        svg += text(x + kCell / 2, y + kCell / 2 + 4, "middle", fmt::format("{:.1f}", 100 * share),
                    share > 0.5 ? " fill=\"white\"" : "");
      }
    }
  }
  return svg + "</svg>";
}

}  // namespace swiftlet
