#include "drivers/calibration/depth_sensor.hpp"

#include <fmt/format.h>

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {
namespace {

// Units outside are mistakes: a unit of metres would waste 16 bits, one below a micrometre is not measurable
// [m].
constexpr double kLeastUnit = 1e-6;
constexpr double kMostUnit = 0.1;

}  // namespace

DepthSensor readDepthSensor(const NamedText& file, std::vector<std::string>& warnings) {
  const YamlField root = YamlField::parse(file.name, file.text);
  const CameraModel lens = readLens(root, "distortion_coefficients", warnings).model;
  if (lens.kind() != CameraKind::kPinholeRadtan || !lens.distortion().isZero(0)) {
    throw root.at("distortion_coefficients")
        .error("depth images must come from a camera without distortion",
               "Rectify them, and give zeros here");
  }
  DepthSensor sensor;
  const Eigen::Vector4d& k = lens.intrinsics();
  sensor.camera = {k[0], k[1], k[2], k[3], lens.width(), lens.height()};
  sensor.T_body_camera =
      readTransform(root.at("T_BS", "Give the transform from the depth camera to the body"), warnings);
  if (root.has("depth_unit_m")) {
    const YamlField unit = root.at("depth_unit_m");
    sensor.metres_per_unit = unit.number();
    if (!(sensor.metres_per_unit >= kLeastUnit && sensor.metres_per_unit <= kMostUnit)) {
      throw unit.error(fmt::format("{:g} m per unit of depth", sensor.metres_per_unit),
                       fmt::format("Give metres per unit, {:g} to {:g}", kLeastUnit, kMostUnit));
    }
  }
  return sensor;
}

}  // namespace swiftlet
