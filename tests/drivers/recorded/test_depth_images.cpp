// The depth folder of a log: values in metres at their stamps, and every kind of damage.

#include <catch2/catch.hpp>

#include "drivers/recorded/depth_images.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::TempFolder;

constexpr const char* kSensor =
    "sensor_type: camera\n"
    "T_BS:\n"
    "  cols: 4\n"
    "  rows: 4\n"
    "  data: [0, 0, 1, 0.5, -1, 0, 0, 0, 0, -1, 0, 0.25, 0, 0, 0, 1]\n"
    "rate_hz: 20\n"
    "resolution: [64, 48]\n"
    "camera_model: pinhole\n"
    "intrinsics: [50, 60, 31.5, 24]\n"
    "distortion_model: radial-tangential\n";

struct DepthFolder {
  explicit DepthFolder(
      const std::string& tail = "distortion_coefficients: [0, 0, 0, 0]\ndepth_unit_m: 0.002\n") {
    fs::create_directories(folder() / "data");
    test::writeText(folder() / "sensor.yaml", kSensor + tail);
    test::writeText(folder() / "data.csv",
                    "#timestamp [ns],filename\n1000,1000.png\n2000,2000.png\n3000,3000.png\n");
    std::vector<std::uint16_t> units(64 * 48, 0);
    for (std::size_t i = 0; i < units.size(); ++i) units[i] = static_cast<std::uint16_t>(5 * i);
    test::writeBytes(folder() / "data/1000.png", test::encodePng16(units, 64, 48));
    test::writeBytes(folder() / "data/2000.png", test::encodePng16(std::vector<std::uint16_t>(20, 7), 5, 4));
  }
  [[nodiscard]] fs::path folder() const { return temp.path() / "mav0" / "depth0"; }
  TempFolder temp;
};

std::string refusal(const DepthFolder& log) {
  LogWarnings warnings;
  return test::messageOf([&] { const DepthImages images(log.temp.path().string(), warnings); });
}

TEST_CASE("depth images come in metres at their stamp, with the camera that took them", "[depth_images]") {
  const DepthFolder log;
  LogWarnings warnings;
  SE3 shift;
  shift.translation = {0, 0, 1};
  DepthImages images(log.temp.path().string(), warnings, shift);
  const DepthImageView view = images.at(Stamp{1000});
  REQUIRE(view.depth != nullptr);
  CHECK(view.depth[300] == Approx(3.0));
  CHECK(view.depth[0] == 0);
  CHECK(view.camera.width == 64);
  CHECK(view.camera.fy == 60);
  CHECK(view.T_body_camera.translation.isApprox(Eigen::Vector3d(0.5, 0, 1.25)));
  CHECK(images.at(Stamp{1001}).depth == nullptr);
  CHECK(warnings.lines().empty());
}

TEST_CASE("a depth image that is missing or of another size is counted, named and left out",
          "[depth_images]") {
  const DepthFolder log;
  LogWarnings warnings;
  DepthImages images(log.temp.path().string(), warnings);
  CHECK(images.at(Stamp{2000}).depth == nullptr);
  CHECK(images.at(Stamp{3000}).depth == nullptr);
  CHECK(images.counters().damaged_images == 1);
  CHECK(images.counters().missing_images == 1);
  REQUIRE(warnings.lines().size() == 2);
  CHECK_THAT(warnings.lines()[0], Catch::Contains("2000.png") && Catch::Contains("5x4"));
  CHECK_THAT(warnings.lines()[1], Catch::Contains("3000.png: missing"));
}

TEST_CASE("a depth camera that bends or a unit that cannot be is refused, with the line", "[depth_images]") {
  CHECK_THAT(refusal(DepthFolder("distortion_coefficients: [0.1, 0, 0, 0]\n")),
             Catch::Contains("sensor.yaml:11") && Catch::Contains("without distortion"));
  CHECK_THAT(refusal(DepthFolder("distortion_coefficients: [0, 0, 0, 0]\ndepth_unit_m: 1000\n")),
             Catch::Contains("depth_unit_m") && Catch::Contains("1000 m"));
  CHECK(refusal(DepthFolder("distortion_coefficients: [0, 0, 0, 0]\n")).empty());
}

TEST_CASE("a log without depth has none", "[depth_images]") {
  const TempFolder temp;
  LogWarnings warnings;
  DepthImages images(temp.path().string(), warnings);
  CHECK(images.empty());
  CHECK(images.at(Stamp{1}).depth == nullptr);
}

}  // namespace
}  // namespace swiftlet
