#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/simulated/calibration_session.hpp"
#include "drivers/simulated/image_sensor.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "drivers/simulated/session_folder.hpp"
#include "firmware_host/lab/calibrate/board/board_detector.hpp"
#include "firmware_host/lab/calibrate/guidance/calibration_guide.hpp"
#include "firmware_host/lab/calibrate/guidance/guided_recording.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

constexpr double kSharpEdge = 1.8;  // px
constexpr int kLookEvery = 5;       // of 20 images a second

bool mentions(const std::vector<std::string>& lines, const std::string& words) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(words) != std::string::npos; });
}

// Plays a session to the guide; returns after how many seconds it was enough, or -1.
double guide(const CalibrationSession& session, CalibrationGuide& guide, double edge_width = kSharpEdge) {
  const std::vector<ImuSample>& samples = session.imu().samples;
  std::size_t next = 0;
  double enough = -1;
  for (int k = 0; k < session.imageCount(); k += kLookEvery) {
    const Stamp now = session.imageStamp(k);
    while (next < samples.size() && samples[next].stamp < now) guide.addImu(samples[next++]);
    for (const BoardView& view : session.views(k)) {
      const CameraModel& lens = session.truth().rig.camera[view.camera];
      guide.addView(view, lens.width(), lens.height(), edge_width);
    }
    if (enough < 0 && guide.missing().empty()) enough = session.imageTime(k);
  }
  return enough;
}

TEST_CASE("a good session is enough, and not before the board was everywhere") {
  int enough = 0;
  constexpr int kSessions = 12;
  for (std::uint64_t seed = 61; seed < 61 + kSessions; ++seed) {
    SessionSettings settings;
    settings.seed = seed;
    settings.duration = 90;
    const CameraKind lens = seed % 2 == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant;
    const CalibrationSession session(drawCalibrationRig(seed, lens), CalibrationTarget{}, settings);
    CalibrationGuide watched(session.target(), 2);
    CHECK(watched.progress() == 0);
    const double seconds = guide(session, watched);
    INFO("seed " << seed << ": " << seconds << " s; "
                 << (watched.missing().empty() ? "" : watched.missing().front()));
    CHECK((seconds < 0 || seconds > 10));
    enough += seconds > 0 ? 1 : 0;
    if (seconds > 0) CHECK(watched.progress() == Approx(1));
  }
  CHECK(enough >= kSessions - 2);
}

TEST_CASE("what a session lacks is named") {
  const CalibrationRig rig = drawCalibrationRig(4, CameraKind::kPinholeRadtan);
  SessionSettings settings;
  settings.duration = 60;

  SECTION("no turning") {
    settings.turning = Turning::kNone;
    CalibrationGuide watched(CalibrationTarget{}, 2);
    CHECK(guide(CalibrationSession(rig, CalibrationTarget{}, settings), watched) < 0);
    for (const char* axis : {"x", "y", "z"}) {
      CHECK(mentions(watched.missing(), std::string("about the IMU's ") + axis + " axis"));
    }
  }
  SECTION("at rest") {
    settings.rests = {{0, 60}};
    CalibrationGuide watched(CalibrationTarget{}, 2);
    CHECK(guide(CalibrationSession(rig, CalibrationTarget{}, settings), watched) < 0);
    CHECK(mentions(watched.missing(), "along the IMU's"));
    CHECK(mentions(watched.missing(), "Change the distance"));
    CHECK(mentions(watched.missing(), "cells covered"));
  }
  SECTION("blurred") {
    CalibrationGuide watched(CalibrationTarget{}, 2);
    CHECK(guide(CalibrationSession(rig, CalibrationTarget{}, settings), watched, 6.0) < 0);
    CHECK(mentions(watched.missing(), "blurred"));
    CHECK(watched.camera(0).covered() == 0);
  }
  SECTION("never on the right") {
    const CalibrationSession session(rig, CalibrationTarget{}, settings);
    CalibrationGuide watched(session.target(), 2);
    for (int k = 0; k < session.imageCount(); ++k) {
      for (BoardView view : session.views(k)) {
        const CameraModel& lens = rig.rig.camera[view.camera];
        if (view.camera == 0) {
          std::erase_if(view.corners, [&](const BoardCorner& c) { return c.pixel.x() > 0.6 * lens.width(); });
        }
        watched.addView(view, lens.width(), lens.height(), kSharpEdge);
      }
    }
    CHECK(mentions(watched.missing(), "right of camera 0"));
    CHECK_FALSE(mentions(watched.missing(), "right of camera 1"));
  }
  SECTION("nothing") {
    const CalibrationGuide watched(CalibrationTarget{}, 2);
    CHECK(mentions(watched.missing(), "Camera 1 has not seen the board"));
  }
}

TEST_CASE("the side from which the board is seen is told") {
  const CameraModel lens(CameraKind::kPinholeRadtan, 752, 480, {458, 457, 367, 248}, {-0.28, 0.07, 0, 0});
  const CalibrationTarget target;
  const Eigen::Vector3d centre = 0.5 * target.corner(target.cornerCount() - 2);
  // left, right, upper, lower of the viewer whose y is up
  const std::array<Eigen::Vector3d, 4> from{{{-0.6, 0, 1}, {0.6, 0, 1}, {0, 0.6, 1}, {0, -0.6, 1}}};
  for (std::size_t side = 0; side < from.size(); ++side) {
    const Eigen::Vector3d eye = centre + from[side];
    Eigen::Matrix3d R;  // camera axes in the board's: x right, y down, z ahead
    R.col(2) = (centre - eye).normalized();
    R.col(0) = (-Eigen::Vector3d::UnitY()).cross(R.col(2)).normalized();
    R.col(1) = R.col(2).cross(R.col(0));
    const SE3 T_cam_board = SE3(R, eye).inverse();
    BoardView view;
    for (int id = 0; id < target.cornerCount(); ++id) {
      Eigen::Vector2d pixel;
      REQUIRE(lens.project(T_cam_board * target.corner(id), pixel));
      view.corners.push_back({id, pixel});
    }
    CalibrationGuide watched(target, 1);
    watched.addView(view, lens.width(), lens.height(), kSharpEdge);
    std::array<int, 4> expected{};
    expected[side] = 1;
    CHECK(watched.camera(0).tilted == expected);
  }
}

TEST_CASE("edges are as wide as the blur makes them") {
  // An erf across the image has slope 1 / (sigma sqrt(2 pi)).
  for (const double sigma : {0.6, 1.2, 2.0}) {
    constexpr int kSide = 41;
    std::vector<std::uint8_t> pixels;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        pixels.push_back(static_cast<std::uint8_t>(
            std::lround(120 + 90 * std::erf((x - 20.3) / (std::sqrt(2.0) * sigma)))));
      }
    }
    const ImageView image{pixels.data(), kSide, kSide, kSide};
    const double width = edgeWidth(image, {{0, {20, 20}}});
    CHECK(width > 0.9 * sigma * std::sqrt(2 * 3.14159));
    CHECK(width < 1.1 * std::hypot(sigma, 0.75) * std::sqrt(2 * 3.14159));
  }
  CHECK(edgeWidth({}, {}) == 0);
}

// A session of EuRoC's rig whose images are rendered one by one.
class RenderedSession {
 public:
  RenderedSession()
      : session_(rig(), CalibrationTarget{}, folder_.session),
        world_(sessionRoom(session_), paint()),
        cameras_{SessionCamera(session_, world_, 0, folder_), SessionCamera(session_, world_, 1, folder_)} {}

  [[nodiscard]] const CalibrationSession& session() const { return session_; }
  [[nodiscard]] std::vector<std::uint8_t> image(int k, std::size_t camera) const {
    std::vector<float> radiance;
    cameras_[camera].render(k, radiance);
    std::vector<std::uint8_t> grey(radiance.size());
    exposeImage(radiance, kWidth, kHeight, SensorSettings{}, 0.8, static_cast<std::uint64_t>(k),
                static_cast<std::uint32_t>(camera), 2, grey.data());
    return grey;
  }
  static constexpr int kWidth = 752;
  static constexpr int kHeight = 480;

 private:
  static CalibrationRig rig() {
    CalibrationRig rig;
    rig.rig = makeRig(RigKind::kEuroc).rig;
    return rig;
  }
  static PaintSettings paint() {
    PaintSettings paint;
    paint.texel = 0.02;
    return paint;
  }
  SessionFolderSettings folder_;
  CalibrationSession session_;
  TexturedWorld world_;
  std::array<SessionCamera, 2> cameras_;
};

// As devices do, again and again, until this pair was looked at.
void showPair(const RenderedSession& rendered, int k, GuidedRecording& guidance) {
  const std::array<std::vector<std::uint8_t>, 2> images{rendered.image(k, 0), rendered.image(k, 1)};
  const int before = guidance.looks();
  for (int round = 0; guidance.looks() == before && round < 2000; ++round) {
    for (std::uint32_t c = 0; c < 2; ++c) {
      CameraFrame frame;
      frame.camera = c;
      frame.stamp = rendered.session().imageStamp(k);
      frame.image = {images[c].data(), RenderedSession::kWidth, RenderedSession::kHeight,
                     RenderedSession::kWidth};
      guidance.takeImage(frame);
    }
    sleepFor(Duration::fromMilliseconds(10));
  }
  REQUIRE(guidance.looks() > before);
}

TEST_CASE("a rendered session's corners are found where they are") {
  const RenderedSession rendered;
  BoardDetector detector(rendered.session().target());
  double square = 0;
  double worst = 0;
  double outward = 0;  // an error that all images share: the lens bends the edges, the vignette shades them
  std::size_t found = 0;
  std::size_t visible = 0;
  for (int k = 100; k < 1100; k += 200) {
    for (const BoardView& exact : rendered.session().exactViews(k)) {
      const std::vector<std::uint8_t> image = rendered.image(k, exact.camera);
      const std::vector<BoardCorner> corners = detector.detect(
          {image.data(), RenderedSession::kWidth, RenderedSession::kHeight, RenderedSession::kWidth});
      visible += exact.corners.size();
      for (const BoardCorner& corner : corners) {
        const auto truth = std::find_if(exact.corners.begin(), exact.corners.end(),
                                        [&](const BoardCorner& c) { return c.id == corner.id; });
        if (truth == exact.corners.end()) continue;  // nearer to the edge than the session's border
        const CameraModel& lens = rendered.session().truth().rig.camera[exact.camera];
        const Eigen::Vector2d centre = lens.intrinsics().tail<2>();
        outward += (corner.pixel - truth->pixel).dot((truth->pixel - centre).normalized());
        const double error = (corner.pixel - truth->pixel).norm();
        square += error * error;
        worst = std::max(worst, error);
        ++found;
      }
    }
  }
  INFO(found << " of " << visible << " corners, rms " << std::sqrt(square / static_cast<double>(found))
             << " px, worst " << worst << ", outward " << outward / static_cast<double>(found));
  CHECK(std::abs(outward) < 0.002 * static_cast<double>(found));
  CHECK(found > visible * 3 / 4);
  CHECK(std::sqrt(square / static_cast<double>(found)) < 0.1);
  CHECK(worst < 0.7);
}

TEST_CASE("images that the calibration does not pair are no pairs for the guidance") {
  const CalibrationRig rig = drawCalibrationRig(4, CameraKind::kPinholeRadtan);
  SessionSettings settings;
  settings.duration = 60;
  const CalibrationSession session(rig, CalibrationTarget{}, settings);
  CalibrationGuide watched(session.target(), 2);
  for (int k = 0; k < session.imageCount(); ++k) {
    for (BoardView view : session.views(k)) {
      const CameraModel& lens = rig.rig.camera[view.camera];
      if (view.camera == 1) view.stamp = view.stamp + Duration::fromMilliseconds(3);
      watched.addView(view, lens.width(), lens.height(), kSharpEdge);
    }
  }
  CHECK(mentions(watched.missing(), "both cameras at once: 0 of"));
}

TEST_CASE("IMU samples that the guidance misses are said") {
  const CalibrationRig rig = drawCalibrationRig(4, CameraKind::kPinholeRadtan);
  Calibration calibration;
  calibration.rig = rig.rig;
  std::vector<std::string> lines;
  GuidedRecording guidance(CalibrationTarget{}, [&](const std::string& line) { lines.push_back(line); });
  guidance.begin(calibration);
  for (int i = 0; i < 100000; ++i) guidance.takeImu({});
  CHECK(guidance.goOn());
  guidance.end();
  REQUIRE(guidance.samplesLost() > 0);
  CHECK_THAT(lines.back(), Catch::Matchers::Contains("IMU samples"));
}

TEST_CASE("beside a recording the guidance finds the board and shows it in the view") {
  const RenderedSession rendered;
  Calibration calibration;
  calibration.rig = rendered.session().truth().rig;
  std::vector<std::string> lines;
  ViewAddress address;
  address.port = freePort();
  GuidedRecording guidance(
      rendered.session().target(), [&](const std::string& line) { lines.push_back(line); }, address);
  CHECK(guidance.goOn());
  guidance.begin(calibration);
  for (int i = 0; i < 1000; ++i)
    guidance.takeImu(rendered.session().imu().samples[static_cast<std::size_t>(i)]);

  ViewClient page(address.port);
  REQUIRE(page.connectAndAsk("/"));
  CHECK(page.readAll().find("EventSource") != std::string::npos);
  ViewClient viewer(address.port);
  REQUIRE(viewer.connectAndAsk("/stream"));
  for (int k = 100; k < 400; k += 100) showPair(rendered, k, guidance);
  for (int i = 0; i < 200 && viewer.text().find("data:image/jpeg") == std::string::npos; ++i) {
    static_cast<void>(viewer.readSome(0.05));
  }
  CHECK(viewer.text().find("event: state") != std::string::npos);
  CHECK(viewer.text().find("data:image/jpeg;base64,/9j/") != std::string::npos);

  CHECK(guidance.goOn());
  guidance.end();
  CHECK(guidance.samplesLost() == 0);
  CHECK_FALSE(guidance.missing().empty());
  CHECK_FALSE(mentions(guidance.missing(), "has not seen the board"));
  CHECK_FALSE(mentions(guidance.missing(), "blurred"));
  CHECK(mentions(guidance.missing(), "image pairs"));
  CHECK(std::any_of(lines.begin(), lines.end(),
                    [](const std::string& line) { return line.find("No image yet") != std::string::npos; }));
}

}  // namespace
}  // namespace swiftlet
