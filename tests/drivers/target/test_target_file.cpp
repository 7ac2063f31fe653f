#include <catch2/catch.hpp>

#include <string>

#include "drivers/input/input_error.hpp"
#include "drivers/target/target_file.hpp"
#include "tests/support/input_error.hpp"

using namespace swiftlet;

TEST_CASE("Kalibr's aprilgrid and Basalt's JSON are one board") {
  const CalibrationTarget kalibr = parseTarget(
      "a.yaml", "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n");
  const CalibrationTarget basalt = parseTarget(
      "a.json", "{\n\"tagCols\": 6,\n\"tagRows\": 5,\n\"tagSize\": 0.088,\n\"tagSpacing\": 0.3\n}");
  for (const CalibrationTarget& target : {kalibr, basalt}) {
    CHECK(target.hasTags());
    CHECK(target.cornerCount() == 120);
    CHECK(target.corner(4 * 29 + 2).isApprox(Eigen::Vector3d(0.088 * 7.5, 0.088 * 6.2, 0), 1e-12));
  }
}

TEST_CASE("a checkerboard's rows are apart by rowSpacingMeters") {
  const CalibrationTarget target = parseTarget("c.yaml",
                                               "target_type: 'checkerboard'\ntargetCols: 9\ntargetRows: 6\n"
                                               "rowSpacingMeters: 0.03\ncolSpacingMeters: 0.02\n");
  CHECK(target.kind == TargetKind::kCheckerboard);
  CHECK(target.corner(53).isApprox(Eigen::Vector3d(0.16, 0.15, 0), 1e-12));
}

TEST_CASE("what is written is read again") {
  for (const CalibrationTarget& target :
       {CalibrationTarget{TargetKind::kAprilGrid, 7, 4, 0.0312, 0, 0.25},
        CalibrationTarget{TargetKind::kCheckerboard, 8, 5, 0.03, 0.031, 0}}) {
    const CalibrationTarget again = parseTarget("t.yaml", targetYaml(target));
    CHECK(again.kind == target.kind);
    CHECK(again.columns == target.columns);
    CHECK(again.rows == target.rows);
    CHECK((again.corner(again.cornerCount() - 1) - target.corner(target.cornerCount() - 1)).norm() < 1e-5);
  }
}

TEST_CASE("a wrong board names its line, field and remedy") {
  const auto complaint = [](const std::string& text) {
    const InputError error = test::errorOf([&] { (void)parseTarget("t.yaml", text); });
    CHECK_FALSE(error.remedy.empty());
    return error.file + ":" + std::to_string(error.line) + ":" + error.field + ":" + error.message;
  };
  const std::string type = "target_type: 'aprilgrid'\n";
  CHECK(complaint(type + "tagCols: 6\ntagRows: 6\ntagSize: 88\ntagSpacing: 0.3\n") ==
        "t.yaml:4:tagSize:88 m is not between 0.001 and 2 m");
  CHECK(complaint(type + "tagCols: 6.5\ntagRows: 6\ntagSize: 0.1\ntagSpacing: 0.3\n") ==
        "t.yaml:2:tagCols:6.5 is not a whole number from 3 to 195");
  CHECK(complaint(type + "tagCols: 30\ntagRows: 30\ntagSize: 0.1\ntagSpacing: 0.3\n").find("587") !=
        std::string::npos);
  CHECK(
      complaint(type + "tagCols: 6\ntagRows: 6\ntagSize: 0.1\ntagSpacing: 0\n").find("t.yaml:5:tagSpacing") ==
      0);
  CHECK(complaint(type + "tagCols: 6\ntagSize: 0.1\ntagSpacing: 0.3\n").find("tagRows:missing") !=
        std::string::npos);
  CHECK(complaint("target_type: 'circlegrid'\n").find("biased") != std::string::npos);
  CHECK(complaint("target_type: 'charuco'\n").find("`charuco`") != std::string::npos);
  CHECK(complaint("a: 1\n").find("target_type:missing") != std::string::npos);
}
