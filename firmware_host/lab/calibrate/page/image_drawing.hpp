#pragma once
// SVG drawings: fields over a camera's image, and curves on logarithmic axes.

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

namespace swiftlet {

/// A square cell of an image's grid.
struct ImageCell {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< px
  std::size_t index = 0;
};

/// A grid of about 200 square cells over an image.
class ImageGrid {
 public:
  ImageGrid(int width, int height);
  [[nodiscard]] const std::vector<ImageCell>& cells() const { return cells_; }
  [[nodiscard]] std::size_t indexOf(const Eigen::Vector2d& pixel) const;
  [[nodiscard]] double size() const { return size_; }  ///< px, of a cell's edge

 private:
  double size_;
  int columns_;
  int rows_;
  std::vector<ImageCell> cells_;
};

class ImageDrawing {
 public:
  ImageDrawing(int width, int height);

  void dots(const std::vector<Eigen::Vector2d>& pixels, const char* colour);
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& along, const char* colour);
  /// A value per cell, coloured from 0 to `most`; NaN: none. A colour scale is drawn below the image.
  void heat(const ImageGrid& grid, const std::vector<double>& values, double most, const std::string& unit);
  void caption(const std::string& text);
  [[nodiscard]] std::string svg() const;

 private:
  int width_;
  int height_;
  double line_;  // px, line width
  double below_ = 0;
  std::string under_;
  std::string over_;
};

/// A curve on logarithmic axes.
struct LogCurve {
  std::string name;
  std::string colour;
  bool points = false;
  std::vector<double> x;
  std::vector<double> y;
};
std::string logDrawing(const std::vector<LogCurve>& curves, const std::string& x_label,
                       const std::string& y_label);

/// Points around zero, with circles of one and three sigma.
std::string scatterDrawing(const std::vector<Eigen::Vector2d>& points, double sigma, const std::string& unit);

}  // namespace swiftlet
