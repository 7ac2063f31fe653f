#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "drivers/simulated/board_renderer.hpp"
#include "drivers/simulated/calibration_session.hpp"

namespace swiftlet {
namespace {

// Where the edge of a tag crosses the line of pixels through it, from the mean brightness across it: exact
// for a sensor whose pixels are squares without gaps.
struct EdgeError {
  double sum = 0;
  double square = 0;
  double worst = 0;
  int count = 0;
  void add(double error) {
    sum += error;
    square += error * error;
    worst = std::max(worst, std::abs(error));
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(square / count); }
  [[nodiscard]] double mean() const { return sum / count; }
};

class EdgeMeter {
 public:
  EdgeMeter(const CalibrationSession& session, std::size_t camera, double seconds)
      : session_(session), camera_(camera), seconds_(seconds) {}

  // The exact pixel of a board point, at its own row's time.
  [[nodiscard]] bool project(const Eigen::Vector3d& p_board, Eigen::Vector2d& pixel) const {
    const Rig& rig = session_.truth().rig;
    double t = seconds_;
    for (int round = 0; round < 20; ++round) {
      const SE3 T_cam_world = (session_.trajectory().pose(t) * rig.T_body_cam[camera_]).inverse();
      if (!rig.camera[camera_].project(T_cam_world * (session_.T_world_board() * p_board), pixel))
        return false;
      t = seconds_ + rig.rowTime(camera_, pixel.y());
    }
    return true;
  }

  // Along the line from `a` to `b` of the board, black on one side; `gap` m of one colour on either side.
  void measure(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double gap,
               const std::vector<float>& image, EdgeError& errors) const {
    const CameraModel& lens = session_.truth().rig.camera[camera_];
    Eigen::Vector2d pa;
    Eigen::Vector2d pb;
    if (!project(a, pa) || !project(b, pb)) return;
    const Eigen::Vector2d along = pb - pa;
    const bool by_rows = std::abs(along.y()) > std::abs(along.x());  // profiles run along rows
    const int across = by_rows ? 0 : 1;
    const int line = 1 - across;
    if (std::abs(along[across]) > 0.5 * std::abs(along[line])) return;
    // How far the profile may go: one pixel of it is `step`, in lengths of the edge and in `gap`s across it.
    const Eigen::Vector3d aside = gap * Eigen::Vector3d::UnitZ().cross(b - a).normalized();
    Eigen::Vector2d middle_pixel;
    Eigen::Vector2d aside_pixel;
    if (!project(0.5 * (a + b), middle_pixel) || !project(0.5 * (a + b) + aside, aside_pixel)) return;
    Eigen::Matrix2d pixels;
    pixels << along, aside_pixel - middle_pixel;
    const Eigen::Vector2d step = pixels.inverse() * Eigen::Vector2d::Unit(across);
    const double reach = std::min(0.7 / std::abs(step[1]), 0.3 / (std::abs(step[0]) + 1e-9)) - 1;
    if (reach < 2.5) return;
    const double place = std::round(0.5 * (pa + pb)[line]);
    if (place < 0 || place >= (line == 0 ? lens.width() : lens.height())) return;
    // The point of the edge whose pixel is on this line, by secants.
    double low = 0;
    double high = 1;
    Eigen::Vector2d pixel;
    for (int round = 0; round < 60; ++round) {
      const double middle = 0.5 * (low + high);
      if (!project(a + middle * (b - a), pixel)) return;
      ((pixel[line] < place) == (pb[line] > pa[line]) ? low : high) = middle;
    }
    if (std::abs(pixel[line] - place) > 1e-6) return;
    const int first = static_cast<int>(std::ceil(pixel[across] - reach));
    const int last = static_cast<int>(std::floor(pixel[across] + reach));
    const int end = across == 0 ? lens.width() : lens.height();
    if (first < 1 || last >= end - 1) return;
    const auto at = [&](int i) {
      const int x = by_rows ? i : static_cast<int>(place);
      const int y = by_rows ? static_cast<int>(place) : i;
      return static_cast<double>(image[static_cast<std::size_t>(y * lens.width() + x)]);
    };
    const bool white_first = at(first) > at(last);
    double white = 0;
    for (int i = first; i <= last; ++i) white += (at(i) - kPaperBlack) / (kPaperWhite - kPaperBlack);
    const double edge = white_first ? first - 0.5 + white : last + 0.5 - white;
    errors.add(edge - pixel[across]);
  }

 private:
  const CalibrationSession& session_;
  std::size_t camera_;
  double seconds_;
};

EdgeError edgesOf(const CalibrationSession& session, double exposure, int step) {
  const CalibrationRig& rig = session.truth();
  const CalibrationTarget& target = session.target();
  EdgeError errors;
  for (std::size_t c = 0; c < 2; ++c) {
    const CameraModel& lens = rig.rig.camera[c];
    const BoardRenderer renderer(target, session.T_world_board(), lens, rig.rig.T_body_cam[c]);
    for (int k = 0; k < session.imageCount(); k += step) {
      std::vector<float> image(static_cast<std::size_t>(lens.width() * lens.height()), 0.3F);
      RenderSettings settings;
      settings.exposure = exposure;
      settings.readout = rig.rig.readout.seconds();
      renderer.paint(session.trajectory(), session.imageTime(k), settings, image);
      const EdgeMeter meter(session, c, session.imageTime(k));
      for (int tag = 0; tag < target.columns * target.rows; ++tag) {
        for (int side = 0; side < 4; ++side) {
          const Eigen::Vector3d from = target.corner(4 * tag + side);
          const Eigen::Vector3d way = target.corner(4 * tag + (side + 1) % 4) - from;
          meter.measure(from + 0.3 * way, from + 0.7 * way, 0.2 * target.size, image, errors);
        }
      }
    }
  }
  return errors;
}

TEST_CASE("rendered edges are where they project to") {
  for (std::uint64_t seed = 51; seed < 55; ++seed) {
    SessionSettings settings;
    settings.seed = seed;
    settings.duration = 8;
    const CalibrationSession session(
        drawCalibrationRig(seed, seed % 2 == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant),
        CalibrationTarget{}, settings);
    const EdgeError sharp = edgesOf(session, 1e-6, 80);
    INFO("seed " << seed << (session.truth().rig.rolls() ? " rolling" : " global") << ", " << sharp.count
                 << " edges: mean " << sharp.mean() << ", rms " << sharp.rms() << ", worst " << sharp.worst);
    CHECK(sharp.count > 100);
    CHECK(sharp.rms() < 0.002);
    CHECK(sharp.worst < 0.01);
    const EdgeError moved = edgesOf(session, 0.004, 80);
    INFO("exposed 4 ms, " << moved.count << " edges: mean " << moved.mean() << ", rms " << moved.rms()
                          << ", worst " << moved.worst);
    CHECK(moved.count > 100);
    CHECK(moved.rms() < 0.005);
    CHECK(moved.worst < 0.03);
  }
}

TEST_CASE("a checkerboard is painted as its pattern says and hides the background") {
  CalibrationTarget target;
  target.kind = TargetKind::kCheckerboard;
  target.columns = 8;
  target.rows = 6;
  target.size = 0.05;
  target.square_height = 0.06;
  SessionSettings settings;
  settings.duration = 4;
  const CalibrationSession session(drawCalibrationRig(4, CameraKind::kPinholeRadtan), target, settings);
  const CameraModel& lens = session.truth().rig.camera[0];
  const SE3& T_body_cam = session.truth().rig.T_body_cam[0];
  const BoardRenderer renderer(target, session.T_world_board(), lens, T_body_cam);
  std::vector<float> image(static_cast<std::size_t>(lens.width() * lens.height()), 0.3F);
  RenderSettings render;
  render.exposure = 1e-6;
  renderer.paint(session.trajectory(), session.imageTime(9), render, image);
  std::vector<float> alone = image;
  render.threads = 1;
  std::fill(alone.begin(), alone.end(), 0.3F);
  renderer.paint(session.trajectory(), session.imageTime(9), render, alone);
  CHECK(alone == image);

  const SE3 T_board_cam =
      session.T_world_board().inverse() * session.trajectory().pose(session.imageTime(9)) * T_body_cam;
  const BoardRectangle printed = printedArea(target);
  const double white = whiteMargin(target);
  const std::vector<BoardRectangle> black = blackAreas(target);
  int paper = 0;
  int background = 0;
  for (int y = 0; y < lens.height(); y += 3) {
    for (int x = 0; x < lens.width(); x += 3) {
      Eigen::Vector3d ray;
      REQUIRE(lens.unproject(Eigen::Vector2d(x, y), ray));
      const Eigen::Vector3d down = T_board_cam.rotation * ray;
      const Eigen::Vector3d p = T_board_cam.translation - T_board_cam.translation.z() / down.z() * down;
      // Away from every edge by more than a pixel.
      constexpr double kClear = 0.006;
      const auto depth = [&](const BoardRectangle& box) {
        return std::min(
            {p.x() - box.low.x(), box.high.x() - p.x(), p.y() - box.low.y(), box.high.y() - p.y()});
      };
      const BoardRectangle sheet{printed.low.array() - white, printed.high.array() + white};
      double in_black = -1;
      for (const BoardRectangle& box : black) in_black = std::max(in_black, depth(box));
      const auto seen = static_cast<double>(image[static_cast<std::size_t>(y * lens.width() + x)]);
      if (down.z() >= 0 || depth(sheet) < -kClear) {
        CHECK(seen == Approx(0.3));
        ++background;
      } else if (in_black > kClear) {
        CHECK(seen == Approx(kPaperBlack).margin(1e-4));
        ++paper;
      } else if (in_black < -kClear && depth(sheet) > kClear) {
        CHECK(seen == Approx(kPaperWhite).margin(1e-4));
        ++paper;
      }
    }
  }
  CHECK(paper > 500);
  CHECK(background > 500);
}

}  // namespace
}  // namespace swiftlet
