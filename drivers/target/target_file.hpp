#pragma once
// Files that describe a calibration board: Kalibr's target YAML (aprilgrid, checkerboard) and Basalt's JSON,
// which has the keys of Kalibr's aprilgrid. Lengths in metres.
//
// Kalibr's checkerboard counts inner corners; rowSpacingMeters is the distance between rows, here
// CalibrationTarget::square_height. A circlegrid is refused: its centres are biased under tilt and
// distortion. Errors: InputError with file, line, field and remedy.

#include <string>
#include <string_view>

#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

[[nodiscard]] CalibrationTarget readTarget(const std::string& file);
/// `name` names the file in messages.
[[nodiscard]] CalibrationTarget parseTarget(const std::string& name, std::string_view text);
/// Text of a target file for Kalibr and readTarget(); lengths rounded to a micrometre.
[[nodiscard]] std::string targetYaml(const CalibrationTarget& target);

/// "AprilGrid of 6 x 6 tags, 88.0 mm each, gap 26.4 mm".
[[nodiscard]] std::string describe(const CalibrationTarget& target);

}  // namespace swiftlet
