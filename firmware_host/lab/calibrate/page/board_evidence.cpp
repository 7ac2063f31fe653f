#include "firmware_host/lab/calibrate/page/board_evidence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kUsed = "#1f6fb4";
constexpr const char* kLeftOut = "#cf4646";
constexpr std::size_t kFewestInCell = 5;
constexpr std::size_t kRows = 25;  // per table
constexpr std::size_t kMostFrusta = 150;

ImageGrid gridOf(const BoardEvidence& evidence, std::size_t camera) {
  return {evidence.camera[camera].width(), evidence.camera[camera].height()};
}

struct ViewSum {
  double squares = 0;
  std::size_t used = 0;
  std::size_t outliers = 0;
  [[nodiscard]] double rms() const {
    return used > 0 ? std::sqrt(squares / (2 * static_cast<double>(used))) : 0;
  }
};

std::vector<ViewSum> viewSums(const BoardEvidence& evidence, std::size_t camera) {
  std::vector<ViewSum> sums(evidence.views.size());
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.camera != camera || corner.view >= sums.size()) continue;
    ViewSum& sum = sums[corner.view];
    if (corner.outlier) {
      ++sum.outliers;
      continue;
    }
    sum.squares += corner.residual.squaredNorm();
    ++sum.used;
  }
  return sums;
}

double secondsOf(const BoardEvidence& evidence, std::size_t view) {
  return (evidence.views[view].stamp - evidence.views.front().stamp).seconds();
}

Plot drawing(std::string id, std::string group, std::string title, std::string svg) {
  Plot plot;
  plot.id = std::move(id);
  plot.group = std::move(group);
  plot.title = std::move(title);
  plot.kind = PlotKind::kDrawing;
  plot.svg = std::move(svg);
  return plot;
}

Plot vectorPlot(const BoardEvidence& evidence, std::size_t camera) {
  const ImageGrid grid = gridOf(evidence, camera);
  const std::vector<CellMean> cells = cellMeans(evidence, camera);
  double most = 0;
  for (const CellMean& cell : cells) {
    if (cell.count >= kFewestInCell) most = std::max(most, cell.mean.norm());
  }
  ImageDrawing image(evidence.camera[camera].width(), evidence.camera[camera].height());
  // The longest arrow is one and a half cells.
  const double scale = most > 0 ? 1.5 * grid.size() / most : 1;
  for (const ImageCell& cell : grid.cells()) {
    const CellMean& mean = cells[cell.index];
    if (mean.count >= kFewestInCell) image.arrow(cell.centre, scale * mean.mean, kUsed);
  }
  image.caption(fmt::format("mean of each cell, measured - predicted; the longest is {:.3f} px", most));
  return drawing(fmt::format("vectors{}", camera), "Residuals over the image",
                 fmt::format("camera {}: direction of the residuals", camera), image.svg());
}

Plot scatterPlot(const BoardEvidence& evidence, std::size_t camera) {
  std::vector<Eigen::Vector2d> points;
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.camera == camera) points.push_back(corner.residual);
  }
  return drawing(fmt::format("scatter{}", camera), "Residuals over the image",
                 fmt::format("camera {}: residuals of all {}, right and down", camera, evidence.seen),
                 scatterDrawing(points, evidence.corner_sigma, "px"));
}

Plot coveragePlot(const BoardEvidence& evidence, std::size_t camera) {
  std::vector<Eigen::Vector2d> used;
  std::vector<Eigen::Vector2d> outliers;
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.camera == camera) (corner.outlier ? outliers : used).push_back(corner.pixel);
  }
  ImageDrawing image(evidence.camera[camera].width(), evidence.camera[camera].height());
  image.dots(used, kUsed);
  image.dots(outliers, kLeftOut);
  image.caption(fmt::format("{} {} used, {} outliers (red), {:.0f} % of the image's cells covered",
                            used.size(), evidence.seen, outliers.size(),
                            100 * coverageOf(evidence, camera).share));
  return drawing(fmt::format("coverage{}", camera), "Coverage",
                 fmt::format("camera {}: {} seen", camera, evidence.seen), image.svg());
}

Plot viewPlot(const BoardEvidence& evidence) {
  Plot plot;
  plot.id = "views";
  plot.group = "Views";
  plot.title = "RMS of each view, without outliers";
  plot.x_label = "s since the first view";
  plot.y_label = "px per axis";
  for (std::size_t camera = 0; camera < evidence.camera_count; ++camera) {
    Series series;
    series.name = fmt::format("camera {}", camera);
    series.style = SeriesStyle::kPoints;
    const auto sums = viewSums(evidence, camera);
    for (std::size_t view = 0; view < sums.size(); ++view) {
      if (sums[view].used == 0) continue;
      series.x.push_back(secondsOf(evidence, view));
      series.y.push_back(sums[view].rms());
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

/// Adds both orientations if `both`: the page shows a triangle only from its front.
void addTriangle(TriangleMesh& mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c, std::uint8_t grey, bool both) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3d& corner : {a, b, c}) {
    mesh.vertices.push_back(corner.cast<float>());
    mesh.grey.push_back(grey);
  }
  mesh.faces.push_back({first, first + 1, first + 2});
  if (both) mesh.faces.push_back({first, first + 2, first + 1});
}

TriangleMesh boardMesh(const CalibrationTarget& target) {
  TriangleMesh mesh;
  const auto quad = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high, double z,
                        std::uint8_t grey) {
    const Eigen::Vector3d a(low.x(), low.y(), z);
    const Eigen::Vector3d b(high.x(), low.y(), z);
    const Eigen::Vector3d c(high.x(), high.y(), z);
    const Eigen::Vector3d d(low.x(), high.y(), z);
    addTriangle(mesh, a, b, c, grey, true);
    addTriangle(mesh, a, c, d, grey, true);
  };
  Eigen::Vector3d low = target.corner(0);
  Eigen::Vector3d high = low;
  for (int id = 0; id < target.cornerCount(); ++id) {
    low = low.cwiseMin(target.corner(id));
    high = high.cwiseMax(target.corner(id));
  }
  const double margin = target.size / 2;
  constexpr std::uint8_t kPaper = 235;
  constexpr std::uint8_t kPrint = 40;
  constexpr double kAbove = 1e-3;  // m; draws the print in front of the paper
  quad(low - Eigen::Vector3d::Constant(margin), high + Eigen::Vector3d::Constant(margin), 0, kPaper);
  if (target.hasTags()) {
    for (int id = 0; id < target.cornerCount(); id += 4)
      quad(target.corner(id), target.corner(id + 2), kAbove, kPrint);
  } else {
    for (int row = 0; row + 1 < target.rows; ++row) {
      for (int column = row % 2; column + 1 < target.columns; column += 2) {
        const int id = target.columns * row + column;
        quad(target.corner(id), target.corner(id + target.columns + 1), kAbove, kPrint);
      }
    }
  }
  return mesh;
}

/// A pyramid from the camera's centre to a small image plane in front of it.
void addFrustum(TriangleMesh& mesh, const SE3& T_board_cam, double size, std::uint8_t grey) {
  const Eigen::Vector3d centre = T_board_cam.translation;
  std::vector<Eigen::Vector3d> corners;
  for (const auto& [x, y] : {std::pair{-0.6, -0.4}, {0.6, -0.4}, {0.6, 0.4}, {-0.6, 0.4}}) {
    corners.push_back(T_board_cam * (size * Eigen::Vector3d(x, y, 1)));
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    addTriangle(mesh, centre, corners[i], corners[(i + 1) % corners.size()], grey, true);
  }
}

}  // namespace

Coverage coverageOf(const BoardEvidence& evidence, std::size_t camera) {
  const ImageGrid grid = gridOf(evidence, camera);
  Coverage coverage;
  coverage.cells.assign(grid.cells().size(), false);
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.camera == camera && !corner.outlier) coverage.cells[grid.indexOf(corner.pixel)] = true;
  }
  std::array<double, 9> covered{};
  std::array<double, 9> all{};
  const double width = evidence.camera[camera].width();
  const double height = evidence.camera[camera].height();
  double count = 0;
  for (const ImageCell& cell : grid.cells()) {
    const auto column = std::min(2UL, static_cast<std::size_t>(3 * cell.centre.x() / width));
    const auto row = std::min(2UL, static_cast<std::size_t>(3 * cell.centre.y() / height));
    all[3 * row + column] += 1;
    if (!coverage.cells[cell.index]) continue;
    covered[3 * row + column] += 1;
    count += 1;
  }
  coverage.share = count / static_cast<double>(grid.cells().size());
  constexpr std::array<const char*, 9> kNinths = {"upper left", "upper middle", "upper right",
                                                  "left",       "middle",       "right",
                                                  "lower left", "lower middle", "lower right"};
  std::size_t emptiest = 0;
  for (std::size_t i = 1; i < covered.size(); ++i) {
    if (covered[i] * all[emptiest] < covered[emptiest] * all[i]) emptiest = i;
  }
  coverage.emptiest = kNinths[emptiest];
  return coverage;
}

std::vector<CellMean> cellMeans(const BoardEvidence& evidence, std::size_t camera) {
  const ImageGrid grid = gridOf(evidence, camera);
  std::vector<CellMean> cells(grid.cells().size());
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.camera != camera || corner.outlier) continue;
    CellMean& cell = cells[grid.indexOf(corner.pixel)];
    cell.mean += corner.residual;
    ++cell.count;
  }
  for (CellMean& cell : cells) {
    if (cell.count > 0) cell.mean /= static_cast<double>(cell.count);
  }
  return cells;
}

double outlierShare(const BoardEvidence& evidence) {
  if (evidence.corners.empty()) return 0;
  const auto outliers = std::ranges::count_if(evidence.corners, &CornerResidual::outlier);
  return static_cast<double>(outliers) / static_cast<double>(evidence.corners.size());
}

std::vector<Plot> boardPlots(const BoardEvidence& evidence) {
  std::vector<Plot> plots;
  for (std::size_t camera = 0; camera < evidence.camera_count; ++camera) {
    plots.push_back(vectorPlot(evidence, camera));
    plots.push_back(scatterPlot(evidence, camera));
  }
  for (std::size_t camera = 0; camera < evidence.camera_count; ++camera) {
    plots.push_back(coveragePlot(evidence, camera));
  }
  plots.push_back(viewPlot(evidence));
  return plots;
}

Json boardScene(const BoardEvidence& evidence) {
  Json scene = {{"trajectories", Json::array()}, {"surfaces", Json::array()}, {"labels", Json::array()}};
  if (evidence.views.empty()) return nullptr;
  const TriangleMesh board = boardMesh(evidence.target);
  TriangleMesh cameras;
  std::vector<float> points;
  const std::size_t step = evidence.views.size() / kMostFrusta + 1;
  constexpr std::uint8_t kFirst = 150;
  constexpr std::uint8_t kSecond = 90;
  for (std::size_t i = 0; i < evidence.views.size(); ++i) {
    const SE3 T_board_cam0 = evidence.views[i].T_cam0_board.inverse();
    for (int axis = 0; axis < 3; ++axis) points.push_back(static_cast<float>(T_board_cam0.translation[axis]));
    if (i % step != 0) continue;
    const double size = 0.4 * evidence.target.size + 0.02;
    addFrustum(cameras, T_board_cam0, size, kFirst);
    if (evidence.camera_count > 1)
      addFrustum(cameras, T_board_cam0 * evidence.T_cam1_cam0.inverse(), size, kSecond);
  }
  scene["trajectories"].push_back({{"name", "camera 0"},
                                   {"style", "line"},
                                   {"count", points.size() / 3},
                                   {"points", base64Of(std::span<const float>(points))}});
  scene["surfaces"].push_back(surfaceJson("board", "board", board));
  scene["surfaces"].push_back(surfaceJson("cameras", "cameras at the views", cameras));
  return scene;
}

std::vector<Table> boardTables(const BoardEvidence& evidence) {
  Table views{"worst_views",
              "Worst views",
              {"camera", "time [s]", "RMS [px per axis]", "corners used", "outliers"},
              {},
              true};
  struct Row {
    std::size_t camera, view;
    ViewSum sum;
  };
  std::vector<Row> rows;
  for (std::size_t camera = 0; camera < evidence.camera_count; ++camera) {
    const auto sums = viewSums(evidence, camera);
    for (std::size_t view = 0; view < sums.size(); ++view) {
      if (sums[view].used + sums[view].outliers > 0) rows.push_back({camera, view, sums[view]});
    }
  }
  std::ranges::stable_sort(rows, [](const Row& a, const Row& b) { return a.sum.rms() > b.sum.rms(); });
  for (const Row& row : rows) {
    if (views.rows.size() == kRows) break;
    views.rows.push_back({std::to_string(row.camera), fmt::format("{:.3f}", secondsOf(evidence, row.view)),
                          fmt::format("{:.3f}", row.sum.rms()), std::to_string(row.sum.used),
                          std::to_string(row.sum.outliers)});
  }
  Table outliers{"outliers",
                 "Largest outliers",
                 {"camera", "time [s]", "corner", "u [px]", "v [px]", "off [px]"},
                 {},
                 true};
  std::vector<const CornerResidual*> worst;
  for (const CornerResidual& corner : evidence.corners) {
    if (corner.outlier && corner.view < evidence.views.size()) worst.push_back(&corner);
  }
  std::ranges::stable_sort(worst, [](const CornerResidual* a, const CornerResidual* b) {
    return a->residual.squaredNorm() > b->residual.squaredNorm();
  });
  for (const CornerResidual* corner : worst) {
    if (outliers.rows.size() == kRows) break;
    outliers.rows.push_back(
        {std::to_string(corner->camera), fmt::format("{:.3f}", secondsOf(evidence, corner->view)),
         std::to_string(corner->corner), fmt::format("{:.1f}", corner->pixel.x()),
         fmt::format("{:.1f}", corner->pixel.y()), fmt::format("{:.2f}", corner->residual.norm())});
  }
  std::vector<Table> tables;
  for (const Table& table : {views, outliers}) {
    if (!table.rows.empty()) tables.push_back(table);
  }
  return tables;
}

}  // namespace swiftlet
