#include "drivers/simulated/board_renderer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "drivers/simulated/parallel.hpp"

namespace swiftlet {
namespace {

constexpr int kMostInstants = 24;
constexpr int kMostPolygon = 16;  // a convex quadrilateral cut by four lines has 8; rounding may add

// Cuts a convex polygon at one side of a box: keeps the part where `sign` (p[axis] - limit) <= 0.
int cut(const BoardRaster::Point* in, int count, bool x_axis, float limit, float sign,
        BoardRaster::Point* out) {
  const auto depth = [&](const BoardRaster::Point& p) { return sign * ((x_axis ? p.x : p.y) - limit); };
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    const BoardRaster::Point& a = in[i];
    const BoardRaster::Point& b = in[(i + 1) % count];
    const float da = depth(a);
    const float db = depth(b);
    if (da <= 0 && kept < kMostPolygon) out[kept++] = a;
    if (da * db < 0 && kept < kMostPolygon) {
      const float share = da / (da - db);
      out[kept++] = {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)};
    }
  }
  return kept;
}

float areaOf(const BoardRaster::Point* p, int count) {
  float twice = 0;
  for (int i = 1; i + 1 < count; ++i) {  // relative to the first corner, so that no large numbers cancel
    twice += (p[i].x - p[0].x) * (p[i + 1].y - p[0].y) - (p[i + 1].x - p[0].x) * (p[i].y - p[0].y);
  }
  return 0.5F * std::abs(twice);
}

}  // namespace

BoardRaster::BoardRaster(const CalibrationTarget& target) {
  const auto boxOf = [](const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
    return Box{{static_cast<float>(low.x()), static_cast<float>(low.y())},
               {static_cast<float>(high.x()), static_cast<float>(high.y())}};
  };
  const BoardRectangle printed = printedArea(target);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(whiteMargin(target));
  sheet_ = boxOf(printed.low - margin, printed.high + margin);
  for (const BoardRectangle& area : blackAreas(target)) black_.push_back(boxOf(area.low, area.high));

  constexpr double kBinsPerSquare = 5;  // a bin is two cells of a tag, or a fifth of a square
  bin_ = static_cast<float>(target.size / kBinsPerSquare);
  columns_ = static_cast<int>(std::ceil((sheet_.high.x - sheet_.low.x) / bin_));
  rows_ = static_cast<int>(std::ceil((sheet_.high.y - sheet_.low.y) / bin_));
  bins_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (const Box& box : black_) {
    const auto column = [&](float x) {
      return std::clamp(static_cast<int>(std::floor((x - sheet_.low.x) / bin_)), 0, columns_ - 1);
    };
    const auto row = [&](float y) {
      return std::clamp(static_cast<int>(std::floor((y - sheet_.low.y) / bin_)), 0, rows_ - 1);
    };
    for (int j = row(box.low.y - bin_); j <= row(box.high.y + bin_); ++j) {
      for (int i = column(box.low.x - bin_); i <= column(box.high.x + bin_); ++i) {
        bins_[static_cast<std::size_t>(j * columns_ + i)].push_back(box);
      }
    }
  }
}

const std::vector<BoardRaster::Box>& BoardRaster::near(float x, float y) const {
  const int i = std::clamp(static_cast<int>((x - sheet_.low.x) / bin_), 0, columns_ - 1);
  const int j = std::clamp(static_cast<int>((y - sheet_.low.y) / bin_), 0, rows_ - 1);
  return bins_[static_cast<std::size_t>(j * columns_ + i)];
}

float BoardRaster::overlap(const Quad& quad, const Box& bounds, const Box& box) {
  std::array<Point, kMostPolygon> first;
  std::array<Point, kMostPolygon> second;
  std::copy(quad.begin(), quad.end(), first.begin());
  Point* from = first.data();
  Point* to = second.data();
  int count = 4;
  const auto trim = [&](bool x_axis, float limit, float sign) {
    count = cut(from, count, x_axis, limit, sign, to);
    std::swap(from, to);
  };
  if (bounds.low.x < box.low.x) trim(true, box.low.x, -1);
  if (bounds.high.x > box.high.x) trim(true, box.high.x, 1);
  if (bounds.low.y < box.low.y) trim(false, box.low.y, -1);
  if (bounds.high.y > box.high.y) trim(false, box.high.y, 1);
  return count < 3 ? 0.0F : areaOf(from, count);
}

BoardRaster::Shares BoardRaster::shares(const Quad& quad) const {
  Box bounds{quad[0], quad[0]};
  for (const Point& p : quad) {
    bounds.low = {std::min(bounds.low.x, p.x), std::min(bounds.low.y, p.y)};
    bounds.high = {std::max(bounds.high.x, p.x), std::max(bounds.high.y, p.y)};
  }
  const auto apart = [&bounds](const Box& box) {
    return !(bounds.low.x < box.high.x && bounds.high.x > box.low.x && bounds.low.y < box.high.y &&
             bounds.high.y > box.low.y);
  };
  const auto inside = [&bounds](const Box& box) {
    return bounds.low.x >= box.low.x && bounds.high.x <= box.high.x && bounds.low.y >= box.low.y &&
           bounds.high.y <= box.high.y;
  };
  Shares shares;
  if (apart(sheet_)) return shares;
  const float area = areaOf(quad.data(), 4);
  shares.paper = inside(sheet_) ? 1.0F : overlap(quad, bounds, sheet_) / area;
  const float middle_x = 0.5F * (bounds.low.x + bounds.high.x);
  const float middle_y = 0.5F * (bounds.low.y + bounds.high.y);
  const bool small = std::max(bounds.high.x - bounds.low.x, bounds.high.y - bounds.low.y) < 2 * bin_;
  for (const Box& box : small ? near(middle_x, middle_y) : black_) {
    if (apart(box)) continue;
    if (inside(box)) {
      shares.black = 1;
      break;
    }
    shares.black += overlap(quad, bounds, box) / area;
  }
  return shares;
}

BoardRenderer::BoardRenderer(const CalibrationTarget& target, const SE3& T_world_board,
                             const CameraModel& camera, const SE3& T_body_cam)
    : raster_(target),
      T_board_world_(T_world_board.inverse()),
      centre_(T_world_board * (0.5 * target.corner(target.cornerCount() - 1))),
      camera_(camera),
      T_body_cam_(T_body_cam) {
  corner_.reserve(static_cast<std::size_t>(camera.width() + 1) *
                  static_cast<std::size_t>(camera.height() + 1));
  for (int row = 0; row <= camera.height(); ++row) {
    for (int column = 0; column <= camera.width(); ++column) {
      Eigen::Vector3d ray;
      if (!camera.unproject({column - 0.5, row - 0.5}, ray)) {
        ray.setConstant(std::numeric_limits<double>::quiet_NaN());  // meets nothing
      }
      corner_.push_back(ray.cast<float>());
    }
  }
}

int BoardRenderer::instantsFor(const SplineTrajectory& trajectory, double seconds, double exposure) const {
  const MotionState motion = trajectory.at(seconds);
  const SE3 T_world_cam = motion.T_world_body * T_body_cam_;
  const double distance = std::max(0.05, (T_world_cam.translation - centre_).norm());
  const double speed = motion.v_world_body.norm() + motion.omega_body.norm() * T_body_cam_.translation.norm();
  const double moved = (motion.omega_body.norm() + speed / distance) * exposure * camera_.focal();
  return std::clamp(static_cast<int>(std::ceil(moved / kPixelsPerInstant)), 1, kMostInstants);
}

void BoardRenderer::paintRow(const SplineTrajectory& trajectory, double seconds, double exposure,
                             int instants, int row, float* radiance) const {
  const int width = camera_.width();
  const auto columns = static_cast<std::size_t>(width) + 1;
  const Eigen::Vector3f* above = corner_.data() + static_cast<std::size_t>(row) * columns;
  std::array<std::vector<BoardRaster::Point>, 2> met{std::vector<BoardRaster::Point>(columns),
                                                     std::vector<BoardRaster::Point>(columns)};
  std::vector<BoardRaster::Shares> sum(static_cast<std::size_t>(width));
  const float weight = 1.0F / static_cast<float>(instants);
  for (int k = 0; k < instants; ++k) {
    const double instant = seconds + exposure * ((k + 0.5) / instants - 0.5);
    const SE3 T_board_cam = T_board_world_ * trajectory.pose(instant) * T_body_cam_;
    if (T_board_cam.translation.z() <= 0) continue;  // behind the board
    const Eigen::Matrix3f R = T_board_cam.R().cast<float>();
    const Eigen::Vector3f eye = T_board_cam.translation.cast<float>();
    for (std::size_t line = 0; line < 2; ++line) {
      for (std::size_t i = 0; i < columns; ++i) {
        const Eigen::Vector3f ray = R * above[line * columns + i];
        // Rays that do not descend to the board give NaN points, which overlap nothing.
        const float reach = ray.z() < 0 ? -eye.z() / ray.z() : std::numeric_limits<float>::quiet_NaN();
        met[line][i] = {eye.x() + reach * ray.x(), eye.y() + reach * ray.y()};
      }
    }
    for (std::size_t i = 0; i + 1 < columns; ++i) {
      const BoardRaster::Quad quad{met[0][i], met[0][i + 1], met[1][i + 1], met[1][i]};
      if (!std::isfinite(quad[0].x + quad[1].x + quad[2].x + quad[3].x)) continue;
      const BoardRaster::Shares shares = raster_.shares(quad);
      sum[i].paper += weight * shares.paper;
      sum[i].black += weight * shares.black;
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    radiance[i] += sum[i].paper * (kPaperWhite - radiance[i]) - sum[i].black * (kPaperWhite - kPaperBlack);
  }
}

void BoardRenderer::paint(const SplineTrajectory& trajectory, double seconds, const RenderSettings& settings,
                          std::vector<float>& radiance) const {
  const int instants = instantsFor(trajectory, seconds, settings.exposure);
  parallelFor(camera_.height(), settings.threads, [&](int row) {
    const double row_time = settings.readout * (static_cast<double>(row) / (camera_.height() - 1) - 0.5);
    paintRow(trajectory, seconds + row_time, settings.exposure, instants, row,
             radiance.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(camera_.width()));
  });
}

}  // namespace swiftlet
