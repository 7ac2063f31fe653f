#include "firmware_host/lab/calibrate/guidance/calibration_guide.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"
#include "firmware_host/lab/calibrate/board/homography.hpp"
#include "firmware_host/lab/calibrate/board/same_moment.hpp"

namespace swiftlet {
namespace {

constexpr double kMeanTime = 1.0;     // s, window of the mean force, which is subtracted as gravity
constexpr double kLongestStep = 0.1;  // s; longer gaps between samples do not count as motion
constexpr std::size_t kLeastCorners = 8;

// Local linear map of the board at a point: pixels per metre.
Eigen::Matrix2d affineAt(const Eigen::Matrix3d& H, const Eigen::Vector2d& point) {
  const Eigen::Vector3d h = H * point.homogeneous();
  Eigen::Matrix<double, 2, 3> d;
  d << 1 / h.z(), 0, -h.x() / (h.z() * h.z()), 0, 1 / h.z(), -h.y() / (h.z() * h.z());
  return d * H.leftCols<2>();
}

const char* rowName(int row) {
  return row == 0 ? "upper" : row == CalibrationGuide::kRows - 1 ? "lower" : "middle";
}

const char* columnName(int column) {
  const int third = column * 3 / CalibrationGuide::kColumns;
  return third == 0 ? "left" : third == 1 ? "centre" : "right";
}

}  // namespace

double edgeWidth(const ImageView& image, const std::vector<BoardCorner>& corners) {
  constexpr int kReach = 5;  // px around a corner
  constexpr int kLeastRange = 30;
  std::vector<double> widths;
  for (const BoardCorner& corner : corners) {
    const int x0 = static_cast<int>(std::lround(corner.pixel.x()));
    const int y0 = static_cast<int>(std::lround(corner.pixel.y()));
    if (x0 < kReach + 1 || y0 < kReach + 1 || x0 >= image.width - kReach - 1 ||
        y0 >= image.height - kReach - 1) {
      continue;
    }
    int low = 255;
    int high = 0;
    double steepest = 0;
    for (int y = y0 - kReach; y <= y0 + kReach; ++y) {
      for (int x = x0 - kReach; x <= x0 + kReach; ++x) {
        const int value = image.row(y)[x];
        low = std::min(low, value);
        high = std::max(high, value);
        const double gx = 0.5 * (image.row(y)[x + 1] - image.row(y)[x - 1]);
        const double gy = 0.5 * (image.row(y + 1)[x] - image.row(y - 1)[x]);
        steepest = std::max(steepest, std::hypot(gx, gy));
      }
    }
    if (high - low > kLeastRange && steepest > 0) widths.push_back((high - low) / steepest);
  }
  if (widths.empty()) return 0;
  return medianOf(widths);
}

int CalibrationGuide::Camera::covered() const {
  return static_cast<int>(std::count_if(cells.begin(), cells.end(), [](int n) { return n >= kCellCorners; }));
}

CalibrationGuide::CalibrationGuide(const CalibrationTarget& target, std::size_t cameras)
    : target_(target), cameras_(std::min(cameras, kMaxCameras)) {}

void CalibrationGuide::addView(const BoardView& view, int width, int height, double edge_width) {
  Camera& camera = camera_[view.camera];
  camera.width = width;
  camera.height = height;
  ++camera.images;
  camera.corners = view.corners;
  if (view.corners.size() < kLeastCorners) return;
  ++camera.with_board;
  camera.edge_width = edge_width;
  if (edge_width > kWidestEdge) {
    ++camera.blurred;
    return;
  }
  for (const BoardCorner& corner : view.corners) {
    const int x = std::clamp(static_cast<int>(corner.pixel.x() * kColumns / width), 0, kColumns - 1);
    const int y = std::clamp(static_cast<int>(corner.pixel.y() * kRows / height), 0, kRows - 1);
    ++camera.cells[static_cast<std::size_t>(y * kColumns + x)];
  }
  measureTilt(view, camera);
  board_seen_[view.camera] = view.stamp;
  const Duration apart = board_seen_[0] - board_seen_[1];
  if (cameras_ == 2 && std::abs(apart.seconds()) <= kSameMoment) ++shared_;
}

void CalibrationGuide::measureTilt(const BoardView& view, Camera& camera) const {
  std::vector<PointPair> pairs;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  const auto count = static_cast<double>(view.corners.size());
  for (const BoardCorner& corner : view.corners) {
    pairs.push_back({target_.corner(corner.id).head<2>(), corner.pixel});
    centre += pairs.back().from / count;
    place += corner.pixel / count;
  }
  Eigen::Matrix3d H;
  if (!fitHomography(pairs, H)) return;
  const Eigen::JacobiSVD<Eigen::Matrix2d> svd(affineAt(H, centre), Eigen::ComputeFullV);
  const double scale = svd.singularValues()[0];
  if (!std::isfinite(scale) || scale <= 0) return;
  camera.largest_scale = std::max(camera.largest_scale, scale);
  camera.smallest_scale = camera.smallest_scale > 0 ? std::min(camera.smallest_scale, scale) : scale;

  // Foreshortened along the second axis; nearer where the scale increases.
  const Eigen::Vector2d from_middle = place - 0.5 * Eigen::Vector2d(camera.width, camera.height);
  if (std::abs(from_middle.x()) > 0.25 * camera.width || std::abs(from_middle.y()) > 0.25 * camera.height)
    return;
  if (std::acos(std::min(1.0, svd.singularValues()[1] / scale)) < kTilt) return;
  Eigen::Vector2d along = svd.matrixV().col(1);
  const double step = 0.5 * target_.size;
  const double ahead = std::abs(affineAt(H, centre + step * along).determinant());
  const double behind = std::abs(affineAt(H, centre - step * along).determinant());
  if (ahead < behind) along = -along;
  const std::size_t side =
      std::abs(along.x()) > std::abs(along.y()) ? (along.x() < 0 ? 0 : 1) : (along.y() > 0 ? 2 : 3);
  ++camera.tilted[side];
}

void CalibrationGuide::addImu(const ImuSample& sample) {
  const double dt = has_sample_ ? (sample.stamp - last_sample_).seconds() : 0;
  last_sample_ = sample.stamp;
  if (!has_sample_) mean_force_ = sample.accel;
  has_sample_ = true;
  if (dt <= 0 || dt > kLongestStep) return;
  mean_force_ += std::min(1.0, dt / kMeanTime) * (sample.accel - mean_force_);
  const Eigen::Vector3d push = sample.accel - mean_force_;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(sample.gyro[axis]) > kTurnRate) turned_[axis] += dt;
    if (std::abs(push[axis]) > kPush) pushed_[axis] += dt;
  }
}

void CalibrationGuide::missingOf(std::size_t index, std::vector<std::string>& missing) const {
  const Camera& camera = camera_[index];
  if (camera.with_board == 0) {
    missing.push_back(fmt::format("Camera {} has not seen the board: show it whole, evenly lit.", index));
    return;
  }
  if (camera.blurred > camera.with_board / 2) {
    missing.push_back(
        fmt::format("Camera {} sees the board blurred (edges {:.1f} px wide, limit {:.1f}): move slower, add "
                    "light, or focus the lens.",
                    index, camera.edge_width, kWidestEdge));
  }
  if (camera.covered() < kColumns * kRows - kMostEmpty) {
    // The emptiest cell; of equal ones the one nearest the image's middle, because corners may be dark.
    std::size_t best = 0;
    double least = 1e9;
    for (std::size_t i = 0; i < camera.cells.size(); ++i) {
      const double x = (static_cast<double>(i % kColumns) + 0.5) / kColumns - 0.5;
      const double y = (static_cast<double>(i / kColumns) + 0.5) / kRows - 0.5;
      const double value = camera.cells[i] + std::hypot(x, y);
      if (value < least) {
        least = value;
        best = i;
      }
    }
    missing.push_back(fmt::format("Show the board in the {} {} of camera {} ({} of {} cells covered).",
                                  rowName(static_cast<int>(best) / kColumns),
                                  columnName(static_cast<int>(best) % kColumns), index, camera.covered(),
                                  kColumns * kRows - kMostEmpty));
  }
  if (camera.largest_scale < kScaleRange * camera.smallest_scale) {
    missing.push_back(
        fmt::format("Change the distance to the board: the nearest and farthest views of camera {} differ by "
                    "a factor of {:.1f}, {:.1f} is required.",
                    index, camera.largest_scale / std::max(camera.smallest_scale, 1e-9), kScaleRange));
  }
  static constexpr std::array<const char*, 4> kSides{"left", "right", "upper", "lower"};
  for (std::size_t side = 0; side < kSides.size(); ++side) {
    if (camera.tilted[side] >= kTiltedViews) continue;
    missing.push_back(fmt::format(
        "Look at the board from its {} side, tilted by 30 to 45 degrees, in the middle of camera {}.",
        kSides[side], index));
  }
  if (camera.with_board - camera.blurred < kBoardViews) {
    missing.push_back(fmt::format("Keep the board in view of camera {}: {} of {} images.", index,
                                  camera.with_board - camera.blurred, kBoardViews));
  }
}

std::vector<std::string> CalibrationGuide::missing() const {
  std::vector<std::string> missing;
  for (std::size_t c = 0; c < cameras_; ++c) missingOf(c, missing);
  if (cameras_ == 2 && shared_ < kSharedViews) {
    missing.push_back(
        fmt::format("Show the board to both cameras at once: {} of {} image pairs.", shared_, kSharedViews));
  }
  constexpr std::array<char, 3> kAxes{'x', 'y', 'z'};
  for (int axis = 0; axis < 3; ++axis) {
    if (turned_[axis] >= kTurnedSeconds) continue;
    missing.push_back(
        fmt::format("Rotate the rig back and forth about the IMU's {} axis: {:.0f} of {:.0f} s.",
                    kAxes[static_cast<std::size_t>(axis)], turned_[axis], kTurnedSeconds));
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (pushed_[axis] >= kPushedSeconds) continue;
    missing.push_back(fmt::format("Move the rig back and forth along the IMU's {} axis: {:.0f} of {:.0f} s.",
                                  kAxes[static_cast<std::size_t>(axis)], pushed_[axis], kPushedSeconds));
  }
  return missing;
}

double CalibrationGuide::progress() const {
  double sum = 0;
  double count = 0;
  const auto part = [&](double have, double want) {
    sum += std::clamp(have / want, 0.0, 1.0);
    ++count;
  };
  for (std::size_t c = 0; c < cameras_; ++c) {
    const Camera& camera = camera_[c];
    part(camera.covered(), kColumns * kRows - kMostEmpty);
    part(camera.with_board - camera.blurred, kBoardViews);
    part(camera.smallest_scale > 0 ? camera.largest_scale / camera.smallest_scale - 1 : 0, kScaleRange - 1);
    for (const int views : camera.tilted) part(views, kTiltedViews);
  }
  if (cameras_ == 2) part(shared_, kSharedViews);
  for (int axis = 0; axis < 3; ++axis) {
    part(turned_[axis], kTurnedSeconds);
    part(pushed_[axis], kPushedSeconds);
  }
  return sum / count;
}

}  // namespace swiftlet
