// Mistakes in units, axes, clocks and calibration: each is named, and nothing else is.

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <numbers>
#include <set>

#include "drivers/input/input_error.hpp"
#include "drivers/simulated/simulated_flight.hpp"
#include "drivers/simulated/track_simulator.hpp"
#include "firmware_host/inspection/force_fit.hpp"
#include "firmware_host/inspection/image_findings.hpp"
#include "firmware_host/inspection/inspect_log.hpp"
#include "firmware_host/inspection/signed_axes.hpp"
#include "tests/firmware_host/inspection/wrong_log.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kImages = 400;

/// What is said of a log: findings, or the error that refuses it.
std::vector<std::string> saidOf(const std::string& log) {
  LogRequest request;
  request.log = log;
  std::vector<std::string> said;
  try {
    for (const Finding& finding : inspectLog(request, Settings{}, kImages).findings) {
      said.push_back(finding.line());
    }
  } catch (const InputError& error) {
    said.emplace_back(error.what());
  }
  return said;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "\n  " + line;
  return text;
}

/// Each mistake that is not in `undecided` is named, alone; of those there, nothing else is said.
void checkMistakes(const std::string& log, const std::set<std::string>& undecided) {
  const ScratchFolder folder("inspection");
  for (const test::Mistake& mistake : test::mistakes()) {
    const std::string wrong = folder.file(mistake.name);
    test::wrongLog(log, mistake.name, wrong);
    const std::vector<std::string> said = saidOf(wrong);
    INFO(mistake.name << ": " << mistake.named << joined(said));
    // A log shorter than the shift is refused.
    const bool apart = joined(said).find("do not overlap in time") != std::string::npos;
    if (apart && mistake.name.starts_with("clock")) continue;
    if (mistake.named.empty()) {
      CHECK(said.empty());
    } else if (!said.empty() || !undecided.contains(mistake.name)) {
      CHECK(said.size() == 1);
      CHECK_THAT(joined(said), Catch::Contains(mistake.named));
    }
  }
}

TEST_CASE("four seconds of a log are enough for most mistakes", "[inspection]") {
  // Five stretches of accelerations are wanted, and shifts that leave half of the images covered.
  checkMistakes(shortLog(), {"accel_negated", "accel_axes_exchanged", "accel_axis_negated", "clock_5s",
                             "clock_minus_5s", "stamps_jitter"});
}

TEST_CASE("every mistake is named on two logs", "[.][long]") {
  for (const char* name : {"euroc_mh01_20s", "vil_v102"}) {
    const auto log = findLog(name);
    if (!log) {
      skipCase("no recorded log " + std::string(name), kRunWithData);
      return;
    }
    checkMistakes(*log, {});
  }
}

/// A camera's tracks on a simulated flight, without images.
struct Flight {
  SimulatedFlight flight;
  std::vector<TrackedImage> images;

  explicit Flight(const SimulationSettings& settings) : flight(settings) {
    TrackSimulator tracks(flight.world(), flight.trueRig(), flight.trajectory(), settings.tracks);
    TrackedFrame frame;
    for (int k = 0; k < flight.imageCount(); ++k) {
      tracks.step(flight.imageTime(k), flight.imageStamp(k), frame);
      TrackedImage image;
      image.stamp = flight.imageStamp(k);
      image.follows = k > 0;
      for (const TrackedFeature& feature : frame.features) {
        if (feature.seen[0]) {
          image.points.push_back({static_cast<std::uint32_t>(feature.id), feature.pixel[0]});
        }
      }
      std::ranges::sort(image.points, {}, &TrackedPoint::track);
      images.push_back(std::move(image));
    }
  }
};

TEST_CASE("gravity and the sign of the accelerometer follow from tracks", "[inspection]") {
  SimulationSettings settings;
  settings.seed = 5;
  settings.flight.duration = 20;
  settings.mono = true;
  const Flight flown(settings);
  const Rig& rig = flown.flight.trueRig();
  const ForceFitter fitter(flown.images, flown.flight.imu().samples, rig.camera[0], rig.T_body_cam[0],
                           rig.camera_to_imu_shift, Eigen::Vector3d::Zero());
  const ForceFit fit = fitter.fit(Eigen::Matrix3d::Identity());
  CHECK(fit.windows >= 8);
  CHECK(fit.negative * 5 <= fit.windows);
  CHECK(fit.gravity == Approx(9.81).epsilon(0.1));
  const ForceFit negated = fitter.fit(-Eigen::Matrix3d::Identity());
  CHECK(negated.negative * 5 >= negated.windows * 4);
  for (const Eigen::Matrix3d& axes : signedAxes()) {
    // A rotor's thrust acts along one axis, x of this rig: the two across it are not told apart by a flight.
    if (axes(0, 0) == 1) continue;
    const ForceFit other = fitter.fit(axes);
    INFO(axesText(axes) << ": " << other.error << " px, " << other.negative << " of " << other.windows);
    CHECK((other.error > 1.2 * fit.error || other.negative * 2 > other.windows));
  }
}

TEST_CASE("signed axes are all, and the nearest is found", "[inspection]") {
  const std::vector<Eigen::Matrix3d> all = signedAxes();
  REQUIRE(all.size() == 48);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const Eigen::Matrix3d& axes : all) {
    double angle = 0;
    CHECK(nearestSignedAxes(axes * turn, angle).isApprox(axes));
    CHECK(angle == Approx(0.1));
  }
  CHECK(axesText(Eigen::Vector3d(1, -1, 1).asDiagonal()) == "y for -y");
}

TEST_CASE("even stamps are those of the line, gap by gap", "[inspection]") {
  std::vector<Stamp> stamps;
  for (int i = 0; i < 100; ++i) {
    const int ms = 50 * i + (i >= 60 ? 700 : 0) + (i % 2 == 0 ? 2 : -2);
    stamps.push_back(Stamp{} + Duration::fromMilliseconds(ms));
  }
  const std::vector<Stamp> even = evenStamps(stamps);
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const std::int64_t ms = 50 * static_cast<std::int64_t>(i) + (i >= 60 ? 700 : 0);
    CHECK(std::abs((even[i] - Stamp{}).seconds() - 1e-3 * static_cast<double>(ms)) < 0.3e-3);
  }
}

TEST_CASE("a still camera is neither doubled nor moved", "[inspection]") {
  std::vector<Stamp> stamps;
  std::vector<TrackedImage> images;
  for (int i = 0; i < 50; ++i) {
    stamps.push_back(Stamp{} + Duration::fromMilliseconds(50 * i));
    TrackedImage image;
    image.stamp = stamps.back();
    image.follows = i > 0;
    image.kept = 100;
    images.push_back(image);
  }
  CHECK(imageFindings(stamps, images).empty());
  for (TrackedImage& image : images) image.flow = 3;
  CHECK(imageFindings(stamps, images).empty());
  for (std::size_t i = 5; i < 50; i += 5) images[i].flow = 0;
  REQUIRE(imageFindings(stamps, images).size() == 1);
  CHECK(imageFindings(stamps, images).front().what == "images doubled");
}

}  // namespace
}  // namespace swiftlet
