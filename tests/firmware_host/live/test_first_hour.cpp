// A new user's first hour: what doctor, fly and record say with nothing attached, without rights, with
// devices that are not there. With devices that are: tests/kernel_sandbox/test_first_hour.sh.

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "firmware_host/commands/program.hpp"
#include "firmware_host/runs/doctor_run.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/firmware_host/without_rights.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

struct Said {
  int code = -1;
  std::string text;  ///< both streams, in the order of their lines
};

/// The program in a process of its own, as it is or as a user without any right.
Said run(const std::vector<std::string>& arguments, bool as_nobody = false) {
  const ScratchFolder folder("first_hour_said");
  const std::string file = folder.file("said.txt");
  std::ofstream{file};
  const pid_t child = fork();
  if (child == 0) {
    const int out = open(file.c_str(), O_WRONLY | O_APPEND);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    if (as_nobody && geteuid() == 0) {
      constexpr uid_t kNobody = 65534;
      if (setgid(kNobody) != 0 || setuid(kNobody) != 0) _exit(99);
    }
    const int code = test::run(arguments);
    std::fflush(nullptr);
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, test::textOf(file)};
}

/// Settings of a vehicle whose devices are files of a folder that need not be there.
std::string vehicle(const ScratchFolder& folder) {
  std::ofstream file(folder.file("vehicle.yaml"));
  file << "vehicle:\n  calibration: '" SWIFTLET_TEST_DATA "/euroc_mh01_4s'\n"
       << "imu_link:\n  device: '" << folder.file("imu") << "'\n"
       << "cameras:\n  device0: '" << folder.file("video0") << "'\n  device1: '" << folder.file("video1")
       << "'\n"
       << "realtime:\n  enabled: false\n";
  return folder.file("vehicle.yaml");
}

std::string lineWith(const std::string& text, const std::string& part) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.find(part) != std::string::npos) return line;
  }
  return {};
}

TEST_CASE("doctor without settings lists what there is, and says how to go on") {
  const Said said = run({"doctor", "--seconds", "0"});
  CHECK(said.code == kExitFailed);  // no vehicle is ready
  for (const char* title : {"this computer", "connected", "next"})
    CHECK_THAT(said.text, Catch::Contains(title));
  for (const char* kind : {"camera", "serial port", "CAN interface", "GPIO chip"})
    CHECK_FALSE(lineWith(said.text, kind).empty());
  CHECK_THAT(said.text, !Catch::Contains("this vehicle"));
  CHECK_THAT(said.text, Catch::Contains("swiftlet settings > vehicle.yaml"));
  CHECK_THAT(said.text, Catch::Contains("swiftlet doctor --settings vehicle.yaml"));
}

TEST_CASE("doctor without rights names the right that is missing and how to get it") {
  const WithoutRights without;
  const DoctorReport report = examine({.seconds = 0}, Settings{});
  const MachineLine* priority = report.computer.find("real-time priority");
  REQUIRE(priority != nullptr);
  CHECK(priority->verdict == MachineVerdict::kPoor);
  CHECK_THAT(priority->remedy, Catch::Contains("setcap cap_sys_nice") || Catch::Contains("rtprio"));
}

TEST_CASE("a device that this user may not open is told from one that is not there") {
  const ScratchFolder folder("first_hour_rights");
  const std::string settings = vehicle(folder);
  for (const char* name : {"imu", "video0"}) {
    std::ofstream{folder.file(name)};
    chmod(folder.file(name).c_str(), 0);
  }
  const Said said = run({"doctor", "--settings", settings}, true);
  CHECK(said.code == kExitFailed);
  for (const char* device : {"IMU (", "camera 0 ("}) {
    const std::string line = lineWith(said.text, device);
    INFO(said.text);
    CHECK_THAT(line, Catch::Contains("no permission to open it") && Catch::Contains("join the group"));
  }
  CHECK_THAT(lineWith(said.text, "camera 1 ("), Catch::Contains("not there"));
}

TEST_CASE("fly, record and doctor name every device that is missing and what to do") {
  const ScratchFolder folder("first_hour_missing");
  const std::string settings = vehicle(folder);
  for (const char* command : {"fly", "record", "doctor"}) {
    std::vector<std::string> arguments = {command, "--settings", settings};
    if (command != std::string("doctor")) arguments.insert(arguments.end(), {"--out", folder.file("out")});
    const Said said = run(arguments);
    INFO(said.text);
    CHECK(said.code == kExitFailed);
    for (const char* device : {"IMU (", "camera 0 (", "camera 1 ("}) {
      CHECK_THAT(lineWith(said.text, device), Catch::Contains(folder.path()) &&
                                                  Catch::Contains("not there") &&
                                                  Catch::Contains("connect it, or correct its name"));
    }
    CHECK_THAT(said.text, Catch::Contains("swiftlet doctor") || Catch::Contains("run this again"));
    CHECK_FALSE(std::filesystem::exists(folder.file("out")));
  }
}

TEST_CASE("settings that name no device or no calibration are wrong use, and say which") {
  const ScratchFolder folder("first_hour_settings");
  for (const char* command : {"fly", "record"}) {
    Said said = run({command, "--out", folder.file("out")});
    CHECK(said.code == kExitBadInput);
    CHECK_THAT(said.text, Catch::Contains("vehicle.calibration"));
    said = run({command, "--out", folder.file("out"), "--set",
                "vehicle.calibration=" SWIFTLET_TEST_DATA "/euroc_mh01_4s"});
    CHECK(said.code == kExitBadInput);
    CHECK_THAT(said.text, Catch::Contains("imu_link.device") && Catch::Contains("swiftlet doctor"));
  }
  const Said said = run({"doctor", "--set", "imu_link.device=/dev/no_such_port"});
  CHECK(said.code == kExitFailed);
  CHECK_THAT(said.text, Catch::Contains("this vehicle") && Catch::Contains("vehicle.calibration"));
}

TEST_CASE("a rig without a calibration is recorded by what the settings say of its size") {
  const ScratchFolder folder("first_hour_bare");
  const std::string imu = "imu_link.device=" + folder.file("imu");
  const std::string camera = "cameras.device0=" + folder.file("video0");
  const auto record = [&](const std::string& resolution) {
    return run({"record", "--out", folder.file("out"), "--set", imu, "--set", camera, "--set",
                "cameras.resolution=" + resolution});
  };
  const Said said = record("640x400");
  INFO(said.text);
  CHECK(said.code == kExitFailed);  // the devices are not there: nothing else is missing
  CHECK_THAT(lineWith(said.text, "camera 0 ("), Catch::Contains("not there"));
  CHECK_THAT(said.text, !Catch::Contains("camera 1") && !Catch::Contains("vehicle.calibration"));
  for (const char* wrong : {"640", "640x", "8x8", "640x400x3", "wide"}) {
    const Said refused = record(wrong);
    CHECK(refused.code == kExitBadInput);
    CHECK_THAT(refused.text, Catch::Contains("cameras.resolution") && Catch::Contains("752x480"));
  }
  const Said flight = run({"fly", "--out", folder.file("out"), "--set", imu, "--set", camera, "--set",
                           "cameras.resolution=640x400"});
  CHECK(flight.code == kExitBadInput);
  CHECK_THAT(flight.text, Catch::Contains("vehicle.calibration"));
}

TEST_CASE("a device of another kind is told as such") {
  const ScratchFolder folder("first_hour_kind");
  const std::string settings = vehicle(folder);
  for (const char* name : {"imu", "video0", "video1"}) std::ofstream{folder.file(name)} << "a file";
  const Said said = run({"fly", "--settings", settings, "--out", folder.file("out")});
  INFO(said.text);
  CHECK(said.code == kExitFailed);
  for (const char* device : {"IMU (", "camera 0 (", "camera 1 ("})
    CHECK_THAT(lineWith(said.text, device),
               Catch::Contains("not the kind of device that the settings expect"));
}

}  // namespace
}  // namespace swiftlet
