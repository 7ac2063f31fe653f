#include "firmware_host/lab/calibrate/board/board_pdf.hpp"

#include <fmt/format.h>
#include <hpdf.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/target/board_pattern.hpp"
#include "drivers/target/target_file.hpp"

namespace swiftlet {
namespace {

constexpr double kPointsPerMetre = 72 / 0.0254;
constexpr double kPrinterMargin = 0.006;  ///< m, left white by common printers
constexpr double kRulerWidth = 0.009;     ///< m, of ruler and text along the lower and the left edge
constexpr double kRuler = 0.1;            ///< m
constexpr double kStep = 0.0005;          ///< m, so that sizes can be read with a ruler
constexpr double kSmallest = 0.005;       ///< m
constexpr double kDefaultGap = 0.3;       ///< of a tag's edge, as in Kalibr's boards
constexpr double kLargestPaper = 5;       ///< m; the limit of PDF readers
constexpr double kSmallestPaper = 0.08;   ///< m
constexpr float kTextSize = 7;            ///< points

using Papers = std::vector<std::pair<std::string, Eigen::Vector2d>>;

const Papers& papers() {
  static const Papers all = {{"A4", {0.297, 0.21}},        {"A3", {0.42, 0.297}},
                             {"A2", {0.594, 0.42}},        {"A1", {0.841, 0.594}},
                             {"A0", {1.189, 0.841}},       {"letter", {0.2794, 0.2159}},
                             {"tabloid", {0.4318, 0.2794}}};
  return all;
}

/// Turns errors of the library into an exception; they do not depend on user input.
void failPdf(HPDF_STATUS error, HPDF_STATUS detail, void* /*unused*/) {
  throw std::runtime_error(fmt::format("libhpdf: error 0x{:04x}, detail {}", error, detail));
}

float points(double metres) { return static_cast<float>(metres * kPointsPerMetre); }

void line(HPDF_Page page, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  HPDF_Page_MoveTo(page, points(from.x()), points(from.y()));
  HPDF_Page_LineTo(page, points(to.x()), points(to.y()));
}

/// A ruler from `origin` along an axis, with ticks every 10 mm on the side away from the board.
void ruler(HPDF_Page page, const Eigen::Vector2d& origin, bool upright) {
  constexpr double kTick = 0.002;
  const Eigen::Vector2d along = upright ? Eigen::Vector2d::UnitY() : Eigen::Vector2d::UnitX();
  const Eigen::Vector2d across = upright ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
  line(page, origin, origin + kRuler * along);
  for (int i = 0; i <= 10; ++i) {
    const Eigen::Vector2d at = origin + 0.01 * i * along;
    line(page, at, at - (i % 10 == 0 ? 1.5 : 1) * kTick * across);
  }
}

}  // namespace

Eigen::Vector2d paperSize(const std::string& name) {
  for (const auto& [known, size] : papers()) {
    if (known == name) return size;
  }
  double width = 0;
  double height = 0;
  char rest = 0;
  if (std::sscanf(name.c_str(), "%lfx%lf%c", &width, &height, &rest) != 2) {
    throw InputError(
        "--paper", 0, "", "`" + name + "` is not a paper size",
        "Give A4, A3, A2, A1, A0, letter, tabloid, or width and height in mm, for example 600x400");
  }
  const Eigen::Vector2d size = Eigen::Vector2d(std::max(width, height), std::min(width, height)) * 1e-3;
  if (!(size.minCoeff() >= kSmallestPaper && size.maxCoeff() <= kLargestPaper)) {
    throw InputError("--paper", 0, "",
                     fmt::format("{:g} x {:g} mm is out of range: 80 to 5000 mm", width, height),
                     "Give width and height in mm");
  }
  return size;
}

CalibrationTarget boardForPaper(const BoardLayout& layout, const Eigen::Vector2d& paper) {
  const Eigen::Vector2d free = paper - Eigen::Vector2d::Constant(2 * kPrinterMargin + kRulerWidth);
  CalibrationTarget target;
  target.kind = layout.kind;
  target.columns = layout.columns;
  target.rows = layout.rows;
  if (target.hasTags()) {
    // Six rows of tags, as on common boards, and columns according to the paper's shape.
    target.gap = kDefaultGap;
    if (target.rows == 0) target.rows = 6;
    if (target.columns == 0) {
      target.columns = static_cast<int>(std::lround(target.rows * free.x() / free.y()));
    }
    if (target.columns * target.rows > kTagCount) {
      throw InputError("--columns", 0, "",
                       fmt::format("{} x {} tags are more than the {} that tag36h11 has", target.columns,
                                   target.rows, kTagCount),
                       "Use fewer columns and rows");
    }
    // Tags, the gaps between and the squares around them, and a frame as wide as these.
    const auto edges = [](int count) { return count + kDefaultGap * (count + 3); };
    target.size = std::min(free.x() / edges(target.columns), free.y() / edges(target.rows));
  } else {
    // 9 x 6: odd and even, so that no turned board looks the same; half a square of white around.
    if (target.columns == 0) target.columns = 9;
    if (target.rows == 0) target.rows = 6;
    target.size = std::min(free.x() / (target.columns + 2), free.y() / (target.rows + 2));
  }
  target.size = kStep * std::floor(target.size / kStep + 1e-9);
  target.square_height = target.size;
  if (target.size < kSmallest) {
    throw InputError("--columns", 0, "",
                     fmt::format("tags or squares would be {:.1f} mm wide, the minimum is {:g} mm",
                                 target.size * 1e3, kSmallest * 1e3),
                     "Use fewer columns and rows, or larger paper");
  }
  return target;
}

std::string boardPdf(const CalibrationTarget& target, const Eigen::Vector2d& paper) {
  const std::unique_ptr<HPDF_Doc_Rec, decltype(&HPDF_Free)> document(HPDF_New(failPdf, nullptr), &HPDF_Free);
  HPDF_Page page = HPDF_AddPage(document.get());
  HPDF_Page_SetWidth(page, points(paper.x()));
  HPDF_Page_SetHeight(page, points(paper.y()));
  const BoardRectangle print = printedArea(target);
  const Eigen::Vector2d size = print.high - print.low;
  const Eigen::Vector2d margin = 0.5 * (paper + Eigen::Vector2d::Constant(kRulerWidth) - size);
  const Eigen::Vector2d origin = margin - print.low;
  HPDF_Page_SetRGBFill(page, 0, 0, 0);
  // A single path, so that adjacent areas show no seam.
  for (const BoardRectangle& area : blackAreas(target)) {
    const Eigen::Vector2d low = origin + area.low;
    HPDF_Page_Rectangle(page, points(low.x()), points(low.y()), points(area.high.x() - area.low.x()),
                        points(area.high.y() - area.low.y()));
  }
  HPDF_Page_Fill(page);
  const double edge = kPrinterMargin + 0.004;
  HPDF_Page_SetLineWidth(page, 0.4F);
  const bool below = paper.x() > kRuler + 4 * edge;
  const bool beside = paper.y() > kRuler + 4 * edge;
  if (below) ruler(page, {2 * edge, edge}, false);
  if (beside) ruler(page, {edge, 2 * edge}, true);
  if (below || beside) HPDF_Page_Stroke(page);  // without a path it is an error
  const std::string rulers = below && beside ? "Both rulers are 100 mm long. "
                             : below         ? "The ruler is 100 mm long. "
                                             : "";
  const std::string words = rulers + describe(target) + ". Print at 100 %, glue to a flat plate.";
  const float left = points(below ? 2 * edge + kRuler + 0.004 : 2 * edge);
  HPDF_Page_BeginText(page);
  const HPDF_Font font = HPDF_GetFont(document.get(), "Helvetica", nullptr);
  HPDF_Page_SetFontAndSize(page, font, kTextSize);
  const float room = points(paper.x() - kPrinterMargin) - left;
  const float width = HPDF_Page_TextWidth(page, words.c_str());
  if (width > room) HPDF_Page_SetFontAndSize(page, font, kTextSize * room / width);
  HPDF_Page_TextOut(page, left, points(edge - 0.002), words.c_str());
  HPDF_Page_EndText(page);
  HPDF_SaveToStream(document.get());
  std::string bytes(HPDF_GetStreamSize(document.get()), '\0');
  HPDF_UINT32 length = static_cast<HPDF_UINT32>(bytes.size());
  HPDF_ResetStream(document.get());
  HPDF_ReadFromStream(document.get(), reinterpret_cast<HPDF_BYTE*>(bytes.data()), &length);
  bytes.resize(length);
  return bytes;
}

}  // namespace swiftlet
