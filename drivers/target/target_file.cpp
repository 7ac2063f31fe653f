#include "drivers/target/target_file.hpp"

#include <fmt/format.h>

#include <cmath>

#include "drivers/calibration/yaml_field.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/target/board_pattern.hpp"

namespace swiftlet {
namespace {

constexpr int kFewest = 3;           ///< tags or inner corners per side, as in Kalibr
constexpr int kMostCorners = 100;    ///< per side of a checkerboard: more is a mistake
constexpr double kShortest = 0.001;  ///< m; lengths outside of this range are in another unit
constexpr double kLongest = 2;       ///< m
constexpr double kWidestGap = 1;     ///< tag edges

constexpr const char* kWhatIsWritten = "Write it as `swiftlet calibrate target` does";

int count(const YamlField& field, int most) {
  const double value = field.number();
  if (value != std::round(value) || value < kFewest || value > most) {
    throw field.error(fmt::format("{:g} is not a whole number from {} to {}", value, kFewest, most),
                      "Count the tags of an aprilgrid, the inner corners of a checkerboard");
  }
  return static_cast<int>(value);
}

double length(const YamlField& field) {
  const double value = field.number();
  if (value < kShortest || value > kLongest) {
    throw field.error(fmt::format("{:g} m is not between {:g} and {:g} m", value, kShortest, kLongest),
                      "Measure the print and give the edge length in metres");
  }
  return value;
}

CalibrationTarget readAprilGrid(const YamlField& root) {
  CalibrationTarget target;
  target.columns = count(root.at("tagCols", kWhatIsWritten), kTagCount / kFewest);
  target.rows = count(root.at("tagRows", kWhatIsWritten), kTagCount / kFewest);
  if (target.columns * target.rows > kTagCount) {
    throw root.at("tagCols").error(
        fmt::format("{} x {} tags exceed the {} tags of tag36h11", target.columns, target.rows, kTagCount),
        "Count the columns and rows of tags");
  }
  target.size = length(root.at("tagSize", kWhatIsWritten));
  const YamlField gap = root.at("tagSpacing", kWhatIsWritten);
  target.gap = gap.number();
  if (target.gap <= 0 || target.gap > kWidestGap) {
    throw gap.error(fmt::format("{:g} is not above 0 and at most {:g}", target.gap, kWidestGap),
                    "It is the gap between tags divided by tagSize, without a unit");
  }
  return target;
}

CalibrationTarget readCheckerboard(const YamlField& root) {
  CalibrationTarget target;
  target.kind = TargetKind::kCheckerboard;
  target.columns = count(root.at("targetCols", kWhatIsWritten), kMostCorners);
  target.rows = count(root.at("targetRows", kWhatIsWritten), kMostCorners);
  target.size = length(root.at("colSpacingMeters", kWhatIsWritten));
  target.square_height = length(root.at("rowSpacingMeters", kWhatIsWritten));
  return target;
}

}  // namespace

CalibrationTarget parseTarget(const std::string& name, std::string_view text) {
  const YamlField root = YamlField::parse(name, text);
  if (!root.has("target_type") && root.has("tagCols")) return readAprilGrid(root);  // Basalt's
  const YamlField type =
      root.at("target_type", "Write `target_type: 'aprilgrid'` or `target_type: 'checkerboard'`");
  if (type.text() == "aprilgrid") return readAprilGrid(root);
  if (type.text() == "checkerboard") return readCheckerboard(root);
  if (type.text() == "circlegrid") {
    throw type.error("circle grids are not supported: their circle centres are biased under tilt",
                     "Print an aprilgrid with `swiftlet calibrate target`");
  }
  throw type.error("`" + type.text() + "` is neither aprilgrid nor checkerboard", kWhatIsWritten);
}

CalibrationTarget readTarget(const std::string& file) {
  return parseTarget(file, openFolder("")->text(file));
}

std::string targetYaml(const CalibrationTarget& target) {
  if (target.hasTags()) {
    return fmt::format(
        "target_type: 'aprilgrid'\ntagCols: {}\ntagRows: {}\n"
        "tagSize: {:.6f}  # m, edge of a tag's black border\n"
        "tagSpacing: {:.6f}  # gap between tags / tagSize\n",
        target.columns, target.rows, target.size, target.gap);
  }
  return fmt::format(
      "target_type: 'checkerboard'\ntargetCols: {}  # inner corners\ntargetRows: {}\n"
      "colSpacingMeters: {:.6f}\nrowSpacingMeters: {:.6f}\n",
      target.columns, target.rows, target.size, target.square_height);
}

std::string describe(const CalibrationTarget& target) {
  const double mm = 1e3;
  if (target.hasTags()) {
    return fmt::format("AprilGrid of {} x {} tags, {:.1f} mm each, gap {:.1f} mm", target.columns,
                       target.rows, target.size * mm, target.size * target.gap * mm);
  }
  return fmt::format("checkerboard of {} x {} inner corners, squares of {:.1f} x {:.1f} mm", target.columns,
                     target.rows, target.size * mm, target.square_height * mm);
}

}  // namespace swiftlet
