// `swiftlet calibrate` as a shell calls it: what it must not write, and what it must not leave.
#include <signal.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/target/target_file.hpp"
#include "firmware_host/files/output_guard.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "tests/firmware_host/said.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

namespace fs = std::filesystem;

/// Grey images of one camera, without a board.
std::string emptyLog(const ScratchFolder& folder, int images) {
  const std::string pictures = folder.file("log/cam0/data");
  fs::create_directories(pictures);
  const std::vector<std::uint8_t> grey(640 * 480, 128);
  for (int i = 0; i < images; ++i) {
    writePng8(pictures + "/" + std::to_string(1000 + i) + ".png", grey.data(), 640, 480);
  }
  return folder.file("log");
}

std::string board(const ScratchFolder& folder) {
  writeWholeFile(folder.file("board.yaml"), targetYaml(CalibrationTarget{}));
  return folder.file("board.yaml");
}

bool endsProgram(int signal) {
  struct sigaction action {};
  sigaction(signal, nullptr, &action);
  return action.sa_handler == SIG_DFL;
}

}  // namespace

TEST_CASE("a search that the user stops gives no calibration, and later signals end the program") {
  const ScratchFolder folder("calibrate_stopped");
  const std::string log = emptyLog(folder, 200);
  std::signal(SIGINT, SIG_DFL);  // Catch has handlers of its own
  std::signal(SIGTERM, SIG_DFL);
  std::thread user([] {
    constexpr int kMostWaits = 20000;
    for (int i = 0; i < kMostWaits && endsProgram(SIGINT); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    kill(getpid(), SIGINT);
  });
  const Said said =
      say({"calibrate", "cameras", log, "--target", board(folder), "--out", folder.file("rig")});
  user.join();
  CHECK(said.code == kExitFailed);
  CHECK(contains(said.text, "stopped early"));
  CHECK_FALSE(fs::exists(folder.file("rig")));
  CHECK(endsProgram(SIGINT));
  CHECK(endsProgram(SIGTERM));
}

TEST_CASE("a refused calibration leaves no older one in its folder, and no file of the user is removed") {
  const ScratchFolder folder("calibrate_again");
  const std::string log = emptyLog(folder, 3);
  const std::string rig = folder.file("rig");
  const auto calibrate = [&] {
    return say({"calibrate", "cameras", log, "--target", board(folder), "--out", rig});
  };
  { const RunClaim earlier(rig, RunKind::kCalibration, false); }
  fs::create_directories(rig + "/cam1");
  fs::create_directories(rig + "/imu0");
  for (const char* name : {"/camchain.yaml", "/camchain-imucam.yaml", "/cam1/sensor.yaml",
                           "/imu0/sensor.yaml", "/imu.yaml", "/notes.txt"}) {
    writeWholeFile(rig + name, "earlier\n");
  }
  CHECK(calibrate().code == kExitFailed);
  CHECK(fs::exists(rig + "/report.html"));
  for (const char* name : {"/camchain.yaml", "/camchain-imucam.yaml", "/cam1", "/imu0", "/imu.yaml"}) {
    CAPTURE(name);
    CHECK_FALSE(fs::exists(rig + name));
  }
  CHECK(textOf(rig + "/notes.txt") == "earlier\n");

  fs::remove(rig + "/swiftlet_run.txt");
  fs::remove(rig + "/report.html");
  fs::create_directories(rig + "/cam1");
  writeWholeFile(rig + "/cam1/sensor.yaml", "of another tool\n");
  const Said said = calibrate();
  CHECK(said.code == kExitBadInput);
  CHECK(contains(said.text, "holds cam1 but no mark of a calibration"));
  CHECK(textOf(rig + "/cam1/sensor.yaml") == "of another tool\n");
}

TEST_CASE("calibrate does not write over what it reads") {
  const ScratchFolder folder("calibrate_inputs");
  const std::string log = emptyLog(folder, 3);
  const std::string target = board(folder);
  const std::string noise = folder.file("rig/imu.yaml");
  fs::create_directories(folder.file("rig"));
  writeWholeFile(noise, "rate_hz: 200\n");
  for (const std::string& out : {log, log + "/cam0/", log + "/rig"}) {
    CAPTURE(out);
    const Said said = say({"calibrate", "cameras", log, "--target", target, "--out", out});
    CHECK(said.code == kExitBadInput);
    CHECK(contains(said.text, "the input"));
  }
  const Said said =
      say({"calibrate", "imu-camera", log, "--target", target, "--imu", noise, "--out", folder.file("rig")});
  CHECK(said.code == kExitBadInput);
  CHECK(contains(said.text, "would overwrite the input"));
  CHECK(textOf(noise) == "rate_hz: 200\n");

  writeWholeFile(folder.file("data.csv"), "1,2,3\n");
  CHECK(say({"calibrate", "imu-noise", folder.file("data.csv"), "--out", folder.file("data.csv")}).code ==
        kExitBadInput);
  CHECK(textOf(folder.file("data.csv")) == "1,2,3\n");

  fs::create_directory_symlink(log, folder.file("link"));
  CHECK_THROWS_AS(refuseOutputInInput(folder.file("link/x.yaml"), {log}), InputError);
  CHECK_NOTHROW(refuseOutputInInput(folder.file("log2"), {log, ""}));
}

TEST_CASE("a board description that was corrected stays") {
  const ScratchFolder folder("calibrate_target");
  const std::string pdf = folder.file("board.pdf");
  CHECK(run({"calibrate", "target", "--out", pdf}) == kExitDone);
  CHECK(run({"calibrate", "target", "--out", pdf}) == kExitDone);
  const std::string corrected = textOf(folder.file("board.yaml")) + "# measured\n";
  writeWholeFile(folder.file("board.yaml"), corrected);
  const Said said = say({"calibrate", "target", "--out", pdf});
  CHECK(said.code == kExitBadInput);
  CHECK(contains(said.text, "corrected by hand"));
  CHECK(textOf(folder.file("board.yaml")) == corrected);
}

TEST_CASE("a baseline without a second camera is refused") {
  const ScratchFolder folder("calibrate_baseline");
  const std::string log = emptyLog(folder, 3);
  const std::string target = board(folder);
  CHECK(run({"calibrate", "cameras", log, "--target", target, "--mono", "--baseline", "110"}) ==
        kExitBadInput);
  const Said said = say({"calibrate", "cameras", log, "--target", target, "--baseline", "110"});
  CHECK(said.code == kExitBadInput);
  CHECK(contains(said.text, "one camera"));
}
