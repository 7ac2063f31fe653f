#pragma once
// Images of a board by tracing rays: an oracle for detection that shares nothing with it but the camera model
// and the board's black areas.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "drivers/target/board_pattern.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet::test {

struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
};

/// The print on a grid as fine as its smallest part: exact where all edges are multiples of `cell`.
class PrintedBoard {
 public:
  PrintedBoard(const CalibrationTarget& target, double cell) : cell_(cell) {
    const BoardRectangle print = printedArea(target);
    low_ = print.low.array() - whiteMargin(target);
    const Eigen::Vector2d size = print.high.array() + whiteMargin(target) - low_.array();
    columns_ = static_cast<int>(std::lround(size.x() / cell));
    rows_ = static_cast<int>(std::lround(size.y() / cell));
    black_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
    for (const BoardRectangle& area : blackAreas(target)) {
      const Eigen::Vector2i first = ((area.low - low_) / cell).array().round().cast<int>();
      const Eigen::Vector2i end = ((area.high - low_) / cell).array().round().cast<int>();
      for (int y = first.y(); y < end.y(); ++y) {
        for (int x = first.x(); x < end.x(); ++x) black_[static_cast<std::size_t>(columns_ * y + x)] = 1;
      }
    }
  }
  /// Grey value; beside the board that of the wall.
  [[nodiscard]] double grey(const Eigen::Vector2d& point) const {
    const int x = static_cast<int>(std::floor((point.x() - low_.x()) / cell_));
    const int y = static_cast<int>(std::floor((point.y() - low_.y()) / cell_));
    if (x < 0 || y < 0 || x >= columns_ || y >= rows_) return 110;
    return black_[static_cast<std::size_t>(columns_ * y + x)] != 0 ? 30 : 200;
  }

 private:
  double cell_;
  Eigen::Vector2d low_;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::uint8_t> black_;
};

/// `blur` [px] and `noise` [grey values] are 1 sigma.
inline GreyImage renderBoard(const PrintedBoard& board, const CameraModel& camera, const SE3& T_cam_board,
                             double blur, double noise, Random& random) {
  constexpr int kSamples = 3;  // per pixel and axis
  const int width = camera.width();
  const int height = camera.height();
  const SE3 T_board_cam = T_cam_board.inverse();
  std::vector<double> sharp(static_cast<std::size_t>(width * height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      for (int k = 0; k < kSamples * kSamples; ++k) {
        const Eigen::Vector2d pixel(x - 0.5 + (k % kSamples + 0.5) / kSamples,
                                    y - 0.5 + (k / kSamples + 0.5) / kSamples);
        Eigen::Vector3d bearing;
        double grey = 60;
        if (camera.unproject(pixel, bearing)) {
          const Eigen::Vector3d ray = T_board_cam.rotation * bearing;
          const Eigen::Vector3d eye = T_board_cam.translation;
          const double along = -eye.z() / ray.z();
          if (eye.z() > 0 && along > 0) grey = board.grey((eye + along * ray).head<2>());
        }
        sum += grey;
      }
      sharp[static_cast<std::size_t>(width * y + x)] = sum / (kSamples * kSamples);
    }
  }
  const int reach = static_cast<int>(std::ceil(3 * blur));
  const auto blurred = [&](const std::vector<double>& in, int step_x, int step_y) {
    std::vector<double> out(in.size());
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        double weights = 0;
        for (int k = -reach; k <= reach; ++k) {
          const int column = std::clamp(x + k * step_x, 0, width - 1);
          const int row = std::clamp(y + k * step_y, 0, height - 1);
          const double weight = std::exp(-0.5 * k * k / (blur * blur));
          sum += weight * in[static_cast<std::size_t>(width * row + column)];
          weights += weight;
        }
        out[static_cast<std::size_t>(width * y + x)] = sum / weights;
      }
    }
    return out;
  };
  const std::vector<double> soft = blur > 0 ? blurred(blurred(sharp, 1, 0), 0, 1) : sharp;
  GreyImage image{width, height, std::vector<std::uint8_t>(soft.size())};
  for (std::size_t i = 0; i < soft.size(); ++i) {
    image.pixels[i] =
        static_cast<std::uint8_t>(std::clamp(std::lround(soft[i] + noise * random.normal()), 0L, 255L));
  }
  return image;
}

}  // namespace swiftlet::test
