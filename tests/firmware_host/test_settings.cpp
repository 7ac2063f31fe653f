// Settings: what is printed reads back, what is wrong is refused with place, range and remedy.

#include <catch2/catch.hpp>
#include <set>
#include <string>

#include "drivers/input/input_error.hpp"
#include "firmware_host/settings/map_check.hpp"
#include "firmware_host/settings/read_settings.hpp"
#include "firmware_host/settings/registry.hpp"
#include "tests/mapping/depth_scene.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

InputError fileError(const std::string& text) {
  Settings settings;
  INFO(text);
  return test::errorOf([&] { readSettingsText("file.yaml", text, settings); });
}

InputError overrideError(const std::string& assignment) {
  Settings settings;
  INFO(assignment);
  return test::errorOf([&] { overrideSetting(assignment, settings); });
}

TEST_CASE("a pair of cameras that measures nothing near is told, with a remedy") {
  Rig rig = depth_scene::makeRig(CameraKind::kPinholeRadtan);
  CHECK(nearDepthWarning(rig).empty());
  rig.T_body_cam[1].translation.y() -= 1.5;
  const std::string line = nearDepthWarning(rig);
  CHECK(line.find("from 2.3 m on") != std::string::npos);
  CHECK(line.find("shorter baseline") != std::string::npos);
}

TEST_CASE("the registry: keys once, groups together, defaults inside their bounds, everything explained") {
  std::set<std::string_view> keys;
  std::set<std::string> closed_groups;
  std::string group;
  const Settings defaults;
  for (const Setting& setting : settingsRegistry()) {
    INFO(setting.key);
    CHECK(keys.insert(setting.key).second);
    CHECK(setting.doc.size() > 10);
    CHECK(setting.doc.back() == '.');
    const std::string its_group(setting.key.substr(0, setting.key.find('.')));
    if (its_group != group) {
      CHECK(closed_groups.insert(its_group).second);
      group = its_group;
    }
    // A default outside the bounds could not be written back.
    Settings settings;
    CHECK_NOTHROW(overrideSetting(std::string(setting.key) + "=" + valueText(setting, defaults), settings));
  }
}

TEST_CASE("settings read from YAML") {
  Settings settings;
  readSettingsText("f",
                   "# comment\nsmoother:\n  horizon: 2.5\n  estimate_extrinsics: true\n"
                   "frontend:\n  max_features: 150\npairing:\n",
                   settings);
  CHECK(settings.odometry.horizon == 2.5);
  CHECK(settings.odometry.estimate_extrinsics);
  CHECK(settings.odometry.max_features == 150);
  CHECK(settings.odometry.pixel_sigma == OdometrySettings{}.pixel_sigma);
  Settings untouched;
  readSettingsText("f", "", untouched);
  CHECK(printSettings(untouched, false) == printSettings(Settings{}, false));
}

TEST_CASE("what is printed reads back to the same values, explained or not") {
  Settings settings;
  settings.odometry.pixel_sigma = 0.1 + 0.2;  // needs all its digits
  settings.odometry.use_stereo = false;
  settings.effort.iterations = 7;
  for (const bool explain : {true, false}) {
    Settings back;
    readSettingsText("printed", printSettings(settings, explain), back);
    for (const Setting& setting : settingsRegistry()) {
      CHECK(valueText(setting, back) == valueText(setting, settings));
    }
    CHECK(back.odometry.pixel_sigma == settings.odometry.pixel_sigma);
  }
}

TEST_CASE("an unknown key names its line and the nearest known key") {
  const InputError error = fileError("smoother:\n  horizont: 3\n");
  CHECK(error.file == "file.yaml");
  CHECK(error.line == 2);
  CHECK(error.field == "smoother.horizont");
  CHECK_THAT(error.remedy, Catch::Contains("`smoother.horizon`"));
  // The right name in the wrong group.
  CHECK_THAT(fileError("odometry:\n  max_features: 100\n").remedy,
             Catch::Contains("`frontend.max_features`"));
  // Nothing near: no wild guess.
  CHECK_THAT(fileError("zzz: 1\n").remedy, !Catch::Contains("Did you mean"));
}

TEST_CASE("values outside their bounds, of a wrong kind, twice or in a wrong place are refused") {
  const InputError range = fileError("frontend:\n  max_features: 100000\n");
  CHECK(range.line == 2);
  CHECK(range.field == "frontend.max_features");
  CHECK_THAT(range.remedy, Catch::Contains("20 to 400"));

  CHECK(fileError("smoother:\n  horizon: .nan\n").field == "smoother.horizon");
  CHECK(fileError("smoother:\n  horizon: -.inf\n").field == "smoother.horizon");
  CHECK(fileError("smoother:\n  horizon: soon\n").field == "smoother.horizon");
  CHECK(fileError("smoother:\n  horizon: [1, 2]\n").field == "smoother.horizon");
  CHECK(fileError("smoother:\n  horizon:\n").field == "smoother.horizon");
  CHECK(fileError("frontend:\n  max_features: 20.5\n").field == "frontend.max_features");
  CHECK(fileError("frontend:\n  use_stereo: 3\n").field == "frontend.use_stereo");
  CHECK(fileError("smoother:\n  horizon: 2\n  horizon: 3\n").line == 3);
  CHECK(fileError("smoother: 3\n").field == "smoother");
  CHECK(fileError("- 1\n- 2\n").line == 1);
  CHECK(fileError("smoother:\n  horizon: 3\n bad\n").line == 3);
  CHECK(fileError("smoother: {horizon: 3\n").line >= 1);
}

TEST_CASE("the horizon is a number of seconds, or full") {
  Settings settings;
  CHECK(settings.full_smoothing);
  CHECK_THAT(printSettings(settings, true), Catch::Contains("horizon: full") && Catch::Contains("or full"));
  overrideSetting("smoother.horizon=3", settings);
  CHECK_FALSE(settings.full_smoothing);
  CHECK(settings.odometry.horizon == 3);
  Settings back;
  readSettingsText("printed", printSettings(settings, false), back);
  CHECK_FALSE(back.full_smoothing);
  overrideSetting("smoother.horizon=full", settings);
  CHECK(settings.full_smoothing);
  CHECK(settings.odometry.horizon == OdometrySettings{}.horizon);
  CHECK(fileError("smoother:\n  horizon: fully\n").line == 2);
  CHECK(fileError("smoother:\n  pixel_sigma: full\n").line == 2);
}

TEST_CASE("a file with one error changes nothing") {
  Settings settings;
  CHECK_THROWS_AS(readSettingsText("f", "smoother:\n  horizon: 2\n  pixel_sigma: -1\n", settings),
                  InputError);
  CHECK(settings.odometry.horizon == OdometrySettings{}.horizon);
}

TEST_CASE("a second document in a settings file is refused with its line") {
  Settings settings;
  const InputError error = fileError("smoother:\n  pixel_sigma: 0.5\n---\nmesh:\n  enabled: false\n");
  CHECK(error.line == 4);
  CHECK(error.remedy.find("---") != std::string::npos);
  readSettingsText("one.yaml", "---\nsmoother:\n  pixel_sigma: 0.5\n---\n", settings);
  readSettingsText("empty.yaml", "", settings);
  CHECK(settings.odometry.pixel_sigma == 0.5);
}

TEST_CASE("overrides from the command line") {
  Settings settings;
  overrideSetting("smoother.horizon=3", settings);
  overrideSetting("frontend.use_stereo=false", settings);
  CHECK(settings.odometry.horizon == 3);
  CHECK_FALSE(settings.odometry.use_stereo);
  CHECK_THAT(overrideError("smoother.horizon").remedy, Catch::Contains("group.name=value"));
  CHECK_THAT(overrideError("smoother.horizon=").what(), Catch::Contains("Allowed"));
  CHECK_THAT(overrideError("smother.horizon=3").remedy, Catch::Contains("`smoother.horizon`"));
}

TEST_CASE("a settings file that is not there") {
  Settings settings;
  CHECK_THROWS_AS(readSettingsFile("does/not/exist.yaml", settings), InputError);
}

TEST_CASE("a word outside the choice is refused with the words that it might be") {
  CHECK_THAT(overrideError("cameras.shutter=blind").what(),
             Catch::Contains("cameras.shutter") && Catch::Contains("global, rolling"));
  Settings settings;
  overrideSetting("cameras.shutter=rolling", settings);
  CHECK(settings.cameras.shutter == "rolling");
}

}  // namespace
}  // namespace swiftlet
