// Every setting can be set and is explained: each member of the settings structs has a key in the
// registry, and each key the explanation that `swiftlet settings` prints for the user.
#include <catch2/catch.hpp>
#include <cctype>
#include <regex>
#include <set>

#include "firmware_host/settings/registry.hpp"
#include "tests/architecture/source_tree.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet::architecture;  // NOLINT(google-build-using-namespace)

namespace {

using swiftlet::test::textOf;

/// Names of the initialised members of struct `name` in a header.
std::set<std::string> membersOf(const std::string& path, const std::string& name) {
  const SourceFile file = parseSource(path, textOf(projectRoot() / path));
  std::set<std::string> members;
  bool inside = false;
  static const std::regex kMember(R"(^\s+(?:int|double|bool|std::string)\s+([a-z0-9_]+)\s*=[^=])");
  for (const std::string& line : file.code_lines) {
    if (line.starts_with("struct " + name)) inside = true;
    if (line.starts_with("}")) inside = false;
    std::smatch match;
    if (inside && std::regex_search(line, match, kMember)) members.insert(match[1]);
  }
  return members;
}

/// The structs whose members a user may set.
struct SettingsStruct {
  const char* path;
  const char* name;
};

constexpr SettingsStruct kStructs[] = {
    {"estimator/odometry/odometry_settings.hpp", "OdometrySettings"},
    {"estimator/messages/effort.hpp", "Effort"},
    {"firmware_host/settings/settings.hpp", "PairingGroup"},
    {"firmware_host/settings/settings.hpp", "CalibrationGroup"},
    {"firmware_host/settings/settings.hpp", "EvaluationGroup"},
    {"firmware_host/settings/settings.hpp", "RealtimeGroup"},
    {"firmware_host/settings/settings.hpp", "BudgetsGroup"},
    {"firmware_host/settings/settings.hpp", "MeshGroup"},
    {"firmware_host/settings/settings.hpp", "LoopGroup"},
    {"firmware_host/settings/device_settings.hpp", "VehicleGroup"},
    {"firmware_host/settings/device_settings.hpp", "ImuLinkGroup"},
    {"firmware_host/settings/device_settings.hpp", "CamerasGroup"},
    {"firmware_host/settings/device_settings.hpp", "TriggerGroup"},
    {"firmware_host/settings/device_settings.hpp", "HilGroup"},
    {"mapping/loop/loop_settings.hpp", "LoopSettings"},
    {"mapping/map/map_settings.hpp", "MapSettings"},
};

/// "group.name" without the group; a member may drop what its group already says.
std::string lastPart(const std::string& key) { return key.substr(key.rfind('.') + 1); }

bool isRegistered(const std::string& member) {
  for (const swiftlet::Setting& setting : swiftlet::settingsRegistry()) {
    if (member.ends_with(lastPart(std::string(setting.key)))) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("every member of a settings struct has a key") {
  for (const SettingsStruct& s : kStructs) {
    const std::set<std::string> members = membersOf(s.path, s.name);
    INFO(s.path << ": " << s.name);
    CHECK(!members.empty());
    for (const std::string& member : members) {
      INFO(member << " is not in the registry: nobody can set it");
      CHECK(isRegistered(member));
    }
  }
}

TEST_CASE("every setting is explained") {
  REQUIRE(swiftlet::settingsRegistry().size() > 5);
  std::set<std::string> keys;
  for (const swiftlet::Setting& setting : swiftlet::settingsRegistry()) {
    INFO(setting.key);
    CHECK(keys.insert(std::string(setting.key)).second);
    CHECK(std::regex_match(std::string(setting.key), std::regex("[a-z0-9_]+\\.[a-z0-9_]+")));
    CHECK(setting.doc.size() > 20);
    CHECK(setting.doc.ends_with('.'));
    CHECK(!swiftlet::rangeText(setting).empty());
  }
}
