#pragma once
// Plots, tables and 3D views of board views, for the pages of `calibrate cameras` and `calibrate imu-camera`.

#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/target/calibration_target.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"
#include "firmware_host/lab/calibrate/page/image_drawing.hpp"
#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/table.hpp"

namespace swiftlet {

struct BoardEvidence {
  std::size_t camera_count = 0;
  std::array<CameraModel, kMaxCameras> camera;
  SE3 T_cam1_cam0;
  double corner_sigma = 0;       ///< px per axis
  std::string seen = "corners";  ///< name of what is seen: "points" for a flight
  CalibrationTarget target;
  std::vector<SolvedView> views;
  std::vector<CornerResidual> corners;
};

/// Share of the image's cells with used corners, and the emptiest part of the image.
struct Coverage {
  double share = 0;
  std::string
      emptiest;  ///< "upper left" and so on: the ninth of the image with the fewest cells that have corners
  std::vector<bool> cells;  ///< of ImageGrid
};
Coverage coverageOf(const BoardEvidence& evidence, std::size_t camera);

/// Mean residual of each cell of ImageGrid, without outliers.
struct CellMean {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  ///< px
  std::size_t count = 0;
};
std::vector<CellMean> cellMeans(const BoardEvidence& evidence, std::size_t camera);

/// Share of the corners that were removed as outliers.
double outlierShare(const BoardEvidence& evidence);

/// Residuals over the image and in a scatter, RMS of each view, coverage.
std::vector<Plot> boardPlots(const BoardEvidence& evidence);
/// The board and the cameras that saw it, in the board's axes.
nlohmann::ordered_json boardScene(const BoardEvidence& evidence);
/// The worst views and outliers.
std::vector<Table> boardTables(const BoardEvidence& evidence);

}  // namespace swiftlet
