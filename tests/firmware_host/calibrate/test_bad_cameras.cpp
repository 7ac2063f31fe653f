// Views that must not give a calibration: each fault is named.
#include <catch2/catch.hpp>

#include <string>

#include "tests/firmware_host/calibrate/session_input.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

SessionSettings shortSession(std::uint64_t seed) {
  SessionSettings settings;
  settings.seed = seed;
  settings.camera_rate = 3;
  return settings;
}

void checkNamed(const std::string& fault, const CameraInput& input) {
  const CameraSolution solution = calibrateCameras(input);
  std::string all;
  for (const std::string& reason : solution.reasons) all += reason + "\n";
  CAPTURE(all);
  CHECK(all.find(fault) != std::string::npos);
}

}  // namespace

TEST_CASE("views without a fault are good") {
  for (const std::uint64_t seed : {900U, 901U}) {
    const CameraSolution solution =
        calibrateCameras(sessionInput(globalShutterRig(seed), {}, shortSession(seed)));
    std::string all;
    for (const std::string& reason : solution.reasons) all += reason + "\n";
    CAPTURE(seed, all);
    CHECK(solution.reasons.empty());
  }
}

TEST_CASE("bad views of a board are named, not solved silently") {
  const CalibrationRig rig = globalShutterRig(902);
  const CalibrationTarget target;
  const CameraInput good = sessionInput(rig, target, shortSession(902));

  SECTION("too few views") {
    CameraInput input = good;
    input.views.resize(14);
    checkNamed("usable views", input);
  }
  SECTION("board never tilted nor brought to the edges: a few equal views") {
    CameraInput input = good;
    input.views.clear();
    for (int i = 0; i < 40; ++i) {
      for (BoardView view : {good.views[100], good.views[101]}) {
        view.stamp = view.stamp + Duration::fromSeconds(i);
        input.views.push_back(view);
      }
    }
    CHECK_FALSE(calibrateCameras(input).reasons.empty());
  }
  SECTION("one camera blurred") {
    SessionSettings settings = shortSession(902);
    settings.corner_sigma = {0.1, 0.4};
    checkNamed("Camera 1: its corners are", sessionInput(rig, target, settings));
  }
  SECTION("wrong gap between the tags") {
    CameraInput input = good;
    input.target.gap = 0.32;
    checkNamed("The gap between the tags is", input);
  }
  SECTION("board of the wrong size, by the baseline") {
    CameraInput input = good;
    input.target.size *= 1.05;
    input.told_baseline = rig.rig.baseline();
    checkNamed("as large as its file says", input);
  }
  SECTION("board stretched by the printer") {
    CalibrationTarget print{TargetKind::kCheckerboard, 9, 6, 0.06, 0.0606, 0};
    CameraInput input = sessionInput(rig, print, shortSession(902));
    input.target.square_height = 0.06;
    checkNamed("The board's height is +1.0 %", input);
  }
  SECTION("cameras not triggered together") {
    CameraInput input = good;
    for (BoardView& view : input.views) {
      if (view.camera == 1) view.stamp = view.stamp + Duration::fromSeconds(0.005);
    }
    checkNamed("5.0 ms apart", input);
  }
  SECTION("cameras that move against each other") {
    CameraInput input = good;
    // Each image of camera 1 stands for the one before: 0.25 s, with a stamp that says otherwise.
    const BoardView* last = nullptr;
    for (BoardView& view : input.views) {
      if (view.camera != 1) continue;
      if (last != nullptr) view.stamp = last->stamp;
      last = &view;
    }
    CHECK_FALSE(calibrateCameras(input).reasons.empty());
  }
  SECTION("another board than told") {
    CameraInput input = good;
    input.target.columns = 7;
    CHECK_FALSE(calibrateCameras(input).reasons.empty());
  }
}

TEST_CASE("a board that camera 1 sees in few of camera 0's images is no fault of the stamps") {
  CameraInput input = sessionInput(globalShutterRig(902), {}, shortSession(902));
  // Camera 1 sees it in two images of five, or only when camera 0 does not.
  const bool ever = GENERATE(true, false);
  std::size_t image = 0;
  for (BoardView& view : input.views) {
    if (view.camera == 0) ++image;
    const bool both = image % 5 < 2;
    if ((view.camera == 1 && !both) || (view.camera == 0 && both && !ever)) view.corners.clear();
  }
  const bool left_out = GENERATE(false, true);
  if (left_out) std::erase_if(input.views, [](const BoardView& view) { return view.corners.empty(); });
  std::string all;
  for (const std::string& reason : calibrateCameras(input).reasons) all += reason + "\n";
  CAPTURE(all, ever, left_out);
  CHECK(all.find("apart") == std::string::npos);
  CHECK((all.find("image pairs show the board to both cameras") == std::string::npos) == ever);
}

TEST_CASE("a rolling shutter gives no reasons but those that it is known to explain") {
  for (const std::uint64_t seed : {904U, 905U}) {
    CalibrationRig rig = globalShutterRig(seed);
    rig.rig.readout = Duration::fromSeconds(0.02);
    const CameraSolution solution = calibrateCameras(sessionInput(rig, {}, shortSession(seed)));
    std::string all;
    for (const std::string& reason : solution.reasons) all += reason + "\n";
    CAPTURE(seed, all);
    CHECK_FALSE(solution.reasons.empty());
    CHECK(solution.reasons == solution.rolling_reasons);
  }
}
