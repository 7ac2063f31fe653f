#include <fmt/format.h>

#include <cmath>

#include "firmware_host/lab/calibrate/page/board_evidence.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

/// The flight's sightings as corners without a board, for the shared drawings.
BoardEvidence evidenceOf(const CheckResult& result) {
  BoardEvidence evidence;
  evidence.camera_count = result.rig.camera_count;
  evidence.camera = result.rig.camera;
  evidence.seen = "points";
  double squares = 0;
  double count = 0;
  for (const PieceResult& piece : result.pieces) {
    for (const SightingResidual& one : piece.residuals) {
      CornerResidual corner;
      corner.camera = one.camera;
      corner.view = evidence.views.size();
      corner.pixel = one.pixel;
      corner.residual = one.residual;
      corner.outlier = one.outlier;
      evidence.corners.push_back(corner);
      if (one.outlier) continue;
      squares += one.residual.squaredNorm() / 2;
      ++count;
    }
    SolvedView view;
    view.stamp = piece.begin;
    evidence.views.push_back(view);
  }
  evidence.corner_sigma = count > 0 ? std::sqrt(squares / count) : 1;
  return evidence;
}

}  // namespace

CalibrationPage checkPage(const CheckResult& result) {
  CalibrationPage page;
  page.name = "Check of the calibration on " + result.log;
  page.verdict = result.verdict == CheckVerdict::kHolds   ? PageVerdict::kGood
                 : result.verdict == CheckVerdict::kMoved ? PageVerdict::kRepeat
                                                          : PageVerdict::kUsable;
  page.verdict_text = fmt::format("The calibration {}.", result.verdict == CheckVerdict::kCannotTell
                                                             ? "cannot be checked with this flight"
                                                             : name(result.verdict));
  page.words = result.because;
  Table values{"values",
               "Results of the flight",
               {"what", "file", "flight - file", "1 sigma", "limit", "unit", "effect", "verdict"},
               {},
               false};
  for (const CheckedValue& value : result.values) {
    values.rows.push_back({value.name, fmt::format("{:.5g}", value.file),
                           fmt::format("{:+.3g}", value.change), fmt::format("{:.2g}", value.sigma),
                           fmt::format("{:.3g}", value.limit), value.unit, value.effect,
                           name(value.verdict)});
  }
  page.tables.push_back(values);
  if (result.pieces.empty()) return page;
  for (Plot& plot : boardPlots(evidenceOf(result))) {
    if (plot.id == "views") {
      plot.title = "RMS of each piece of the flight, without outliers";
      plot.group = "Over time";
      plot.x_label = "s since the first piece";
    }
    page.plots.push_back(std::move(plot));
  }
  return page;
}

}  // namespace swiftlet
