// Corners of rendered boards beside where they are.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdio>
#include <numbers>
#include <vector>

#include "firmware_host/lab/calibrate/board/board_detector.hpp"
#include "tests/firmware_host/calibrate/board_image.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

constexpr double kRadPerDegree = std::numbers::pi / 180;

CameraModel pinhole() {
  return {CameraKind::kPinholeRadtan, 752, 480, {458, 457, 367, 248}, {-0.28, 0.07, 0.0002, 0.00002}};
}
CameraModel wide() {
  return {CameraKind::kEquidistant, 752, 480, {230, 230, 372, 242}, {0.01, -0.003, 0.001, -0.0003}};
}

/// The board's middle on a ray through `pixel`, so far that `edge` metres there are `edge_px` wide; turned by
/// `tilt` about an axis in the board at angle `axis`, and by `roll` about the ray. The board's y is up.
SE3 pose(const CameraModel& camera, const CalibrationTarget& target, const Eigen::Vector2d& pixel,
         double edge, double edge_px, double tilt, double axis, double roll) {
  Eigen::Vector3d ray;
  REQUIRE(camera.unproject(pixel, ray));
  const BoardRectangle print = printedArea(target);
  const Eigen::Vector2d middle = 0.5 * (print.low + print.high);
  // Facing the camera along the ray: x of the board to the right, z towards the camera.
  const Eigen::Quaterniond facing = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray) *
                                    Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  const Eigen::Quaterniond turned =
      facing * Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(axis), std::sin(axis), 0));
  const double distance = edge * camera.focal() / edge_px;
  const Eigen::Vector3d centre(middle.x(), middle.y(), 0);
  return {turned, ray * distance - turned * centre};
}

struct Tally {
  int visible = 0;  ///< corners whose tag lies wholly in the image
  int found = 0;
  int wrong = 0;  ///< more than a pixel off
  std::vector<double> errors;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();

  [[nodiscard]] double quantile(double part) const {
    std::vector<double> sorted = errors;
    std::sort(sorted.begin(), sorted.end());
    return sorted.empty() ? 0
                          : sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1))];
  }
};

void count(const CalibrationTarget& target, const CameraModel& camera, const SE3& T_cam_board,
           const std::vector<BoardCorner>& corners, Tally& tally) {
  constexpr double kBorder = 5;  // px: a refinement needs its window
  const int group = target.hasTags() ? 4 : 1;
  for (int first = 0; first < target.cornerCount(); first += group) {
    bool inside = true;
    for (int k = 0; k < group; ++k) {
      Eigen::Vector2d pixel;
      inside = inside && camera.project(T_cam_board * target.corner(first + k), pixel) &&
               camera.inImage(pixel, kBorder);
    }
    if (inside) tally.visible += group;
  }
  for (const BoardCorner& corner : corners) {
    Eigen::Vector2d pixel;
    REQUIRE(camera.project(T_cam_board * target.corner(corner.id), pixel));
    const Eigen::Vector2d error = corner.pixel - pixel;
    ++tally.found;
    if (error.norm() > 1) ++tally.wrong;
    tally.errors.push_back(error.norm());
    tally.sum += error;
  }
}

}  // namespace

TEST_CASE("tags of a board are found, none as another, without bias") {
  struct Scene {
    const char* name;
    CameraModel camera;
    double edge_px, tilt, blur, noise;
    double least_found, most_median;
    int views = 2;
  };
  const std::vector<Scene> scenes = {
      {"60 px", pinhole(), 60, 0, 0.7, 3, 0.99, 0.045},
      {"40 px", pinhole(), 40, 0, 0.7, 3, 0.99, 0.045},
      {"20 px", pinhole(), 20, 0, 0.7, 3, 0.9, 0.1},
      {"40 px, 50 degrees", pinhole(), 40, 50 * kRadPerDegree, 0.7, 3, 0.95, 0.08},
      {"30 px, 55 degrees", pinhole(), 30, 55 * kRadPerDegree, 0.7, 3, 0.85, 0.1},
      // Its corners scatter by 0.09 px, so the mean of two views' corners does by 0.005.
      {"40 px, blurred", pinhole(), 40, 20 * kRadPerDegree, 1.6, 6, 0.8, 0.2, 8},
      {"190 degrees, 40 px", wide(), 40, 30 * kRadPerDegree, 0.7, 3, 0.9, 0.08},
  };
  const CalibrationTarget target;
  const PrintedBoard board(target, target.size / 10);
  BoardDetector detector(target);
  Random random(7);
  for (const Scene& scene : scenes) {
    Tally tally;
    for (int view = 0; view < scene.views; ++view) {
      // One by one: the order in which arguments are evaluated is the compiler's.
      const double x = random.uniform(250, 500);
      const double y = random.uniform(180, 300);
      const double axis = random.uniform(0, 6.28);
      const double turn = random.uniform(-0.5, 0.5);
      const SE3 T = pose(scene.camera, target, {x, y}, target.size, scene.edge_px, scene.tilt, axis, turn);
      const GreyImage image = renderBoard(board, scene.camera, T, scene.blur, scene.noise, random);
      count(target, scene.camera, T, detector.detect(image.view()), tally);
    }
    const Eigen::Vector2d bias = tally.sum / std::max(1, tally.found);
    std::printf("%s: %d of %d, median %.3f, 99 %% %.3f, bias %.4f %.4f, wrong %d\n", scene.name, tally.found,
                tally.visible, tally.quantile(0.5), tally.quantile(0.99), bias.x(), bias.y(), tally.wrong);
    CAPTURE(scene.name);
    CHECK(tally.wrong == 0);
    CHECK(tally.found >= scene.least_found * tally.visible);
    CHECK(tally.quantile(0.5) < scene.most_median);
    CHECK(bias.norm() < 0.01);
  }
}

TEST_CASE("a checkerboard's corners keep their numbers in every orientation that its colours tell") {
  const CalibrationTarget target{TargetKind::kCheckerboard, 9, 6, 0.03, 0.03, 0};
  const PrintedBoard board(target, 0.015);
  BoardDetector detector(target);
  Random random(11);
  Tally tally;
  for (int view = 0; view < 6; ++view) {
    const double x = random.uniform(300, 450);
    const double y = random.uniform(200, 280);
    const double tilt = random.uniform(0, 0.7);
    const double axis = random.uniform(0, 6.28);
    const SE3 T = pose(pinhole(), target, {x, y}, 0.03, 30, tilt, axis, view * 60 * kRadPerDegree);
    const GreyImage image = renderBoard(board, pinhole(), T, 0.7, 3, random);
    count(target, pinhole(), T, detector.detect(image.view()), tally);
  }
  std::printf("checkerboard: %d of %d, median %.3f, wrong %d\n", tally.found, tally.visible,
              tally.quantile(0.5), tally.wrong);
  CHECK(tally.wrong == 0);
  CHECK(tally.found >= 0.8 * tally.visible);
  CHECK(tally.quantile(0.5) < 0.06);
}

TEST_CASE("an image without the board has no corners") {
  Random random(3);
  GreyImage image{320, 240, std::vector<std::uint8_t>(320 * 240)};
  for (std::uint8_t& grey : image.pixels) grey = static_cast<std::uint8_t>(random.below(256));
  CHECK(BoardDetector({}).detect(image.view()).empty());
  CHECK(BoardDetector({TargetKind::kCheckerboard, 9, 6, 0.03, 0.03, 0}).detect(image.view()).empty());
  CHECK(BoardDetector({}).detect({}).empty());
}
