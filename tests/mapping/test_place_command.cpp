// `swiftlet place`: place recognition alone with given poses, from the command line to its files.

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/run_summary.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::run;
using test::summaryIn;
using test::textOf;

std::string recordedLog() { return SWIFTLET_SOURCE_ROOT "/tests/data/euroc_mh01_4s"; }

std::size_t rowsIn(const std::string& folder) {
  const std::string text = textOf(fs::path(folder) / "places.csv");
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) - 1;
}

}  // namespace

TEST_CASE("place: a log's own images come back, verified against its truth, the same bytes again") {
  const ScratchFolder folder("place_log");
  const std::string out = folder.file("out");
  // Four seconds: what lies a second back counts as a revisit here.
  REQUIRE(run({"place", recordedLog(), "--exclude", "1", "--candidates", "5", "--out", out}) == kExitDone);
  const auto summary = summaryIn(out);
  CHECK(summary["images"]["keyframes"].get<int>() >= 3);
  CHECK(summary["retrieval"]["candidates"].get<std::size_t>() == rowsIn(out));
  CHECK(summary["retrieval"]["recall"].get<double>() ==
        Approx(summary["verification"]["recall"].get<double>()));
  CHECK(summary["retrieval"]["recall"].get<double>() > 0.6);
  REQUIRE(summary["verification"]["accepted"].get<int>() >= 1);
  CHECK(summary["verification"]["precision"].get<double>() == Approx(1));
  CHECK(summary["verification"]["median_error_m"].get<double>() < 0.05);
  CHECK(summary["timing"]["verification"]["count"].get<std::size_t>() == rowsIn(out));
  const std::string before = textOf(fs::path(out) / "places.csv");
  REQUIRE(run({"place", recordedLog(), "--exclude", "1", "--candidates", "5", "--out", out}) == kExitDone);
  CHECK(textOf(fs::path(out) / "places.csv") == before);
}

TEST_CASE("place: a plain folder of images, by stamps in their names or one pose each") {
  const ScratchFolder folder("place_folder");
  const std::string out = folder.file("out");
  const std::string images = recordedLog() + "/mav0/cam0/data";
  const std::string truth = recordedLog() + "/mav0/state_groundtruth_estimate0/data.csv";
  REQUIRE(run({"place", images, "--trajectory", truth, "--exclude", "1", "--out", out}) == kExitDone);
  const auto by_stamps = summaryIn(out);
  CHECK(by_stamps["images"]["keyframes"].get<int>() >= 30);
  // By the poses images up to 30 degrees apart count as the same place; by their looks not all do (0.65).
  CHECK(by_stamps["retrieval"]["recall"].get<double>() > 0.55);
  CHECK_FALSE(by_stamps.contains("verification"));

  const std::string named = folder.file("named");
  const std::string poses = folder.file("poses.tum");
  fs::create_directories(named);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(images)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  {
    LineFile tum(poses);
    for (std::size_t i = 0; i < 8; ++i) {
      const std::string name = "image_" + std::to_string(i) + files[i].extension().string();
      fs::copy_file(files[i], fs::path(named) / name);
      tum.write(std::to_string(i) + ".0 0 0 0 0 0 0 1");
    }
  }
  REQUIRE(run({"place", named, "--trajectory", poses, "--max-gap", "2", "--exclude", "2", "--out", out}) ==
          kExitDone);
  CHECK(summaryIn(out)["images"]["keyframes"] == 8);
  CHECK(summaryIn(out)["retrieval"]["images_revisiting"] == 6);
  // One image without a pose.
  fs::copy_file(files[8], fs::path(named) / ("image_8" + files[8].extension().string()));
  CHECK(run({"place", named, "--trajectory", poses, "--out", out}) == kExitBadInput);
}

TEST_CASE("place: a vocabulary from a file, by option or setting") {
  const ScratchFolder folder("place_vocabulary");
  const std::string out = folder.file("out");
  const std::string file = folder.file("words.swv");
  writeVocabulary(file, Vocabulary::shipped());
  const std::vector<std::string> plain = {"place", recordedLog(), "--exclude", "1", "--out", out};
  const auto with = [&](const std::string& option, const std::string& value) {
    std::vector<std::string> arguments = plain;
    arguments.insert(arguments.end(), {option, value});
    return run(arguments);
  };
  REQUIRE(run(plain) == kExitDone);
  const std::string shipped = textOf(fs::path(out) / "places.csv");
  REQUIRE(with("--vocabulary", file) == kExitDone);
  CHECK(textOf(fs::path(out) / "places.csv") == shipped);
  REQUIRE(with("--set", "loop.vocabulary=" + file) == kExitDone);
  CHECK(textOf(fs::path(out) / "places.csv") == shipped);
  {
    // Two words, in ORB-SLAM's text: other scores.
    std::string bits;
    for (int i = 0; i < 32; ++i) bits += i % 2 == 0 ? "255 " : "0 ";
    std::string none;
    for (int i = 0; i < 32; ++i) none += "0 ";
    LineFile text(folder.file("two.txt"));
    text.write("2 1 0 0");
    text.write("0 1 " + bits + "1.0");
    text.write("0 1 " + none + "1.0");
  }
  REQUIRE(with("--vocabulary", folder.file("two.txt")) == kExitDone);
  CHECK(summaryIn(out)["run"]["vocabulary_words"] == 2);
  CHECK(textOf(fs::path(out) / "places.csv") != shipped);
  CHECK(with("--vocabulary", folder.file("none.swv")) == kExitBadInput);
}

TEST_CASE("place: bad input is named") {
  const ScratchFolder folder("place_bad");
  const std::string out = folder.file("out");
  CHECK(run({"place", folder.file("nothing"), "--out", out}) == kExitBadInput);
  const std::string images = recordedLog() + "/mav0/cam0/data";
  CHECK(run({"place", images, "--out", out}) == kExitBadInput);
  const std::string far = folder.file("far.tum");
  {
    LineFile tum(far);
    tum.write("1.0 0 0 0 0 0 0 1");
    tum.write("1.1 0 0 0 0 0 0 1");
  }
  CHECK(run({"place", recordedLog(), "--trajectory", far, "--out", out}) == kExitBadInput);
  CHECK(run({"place", images, "--trajectory", far, "--out", out}) == kExitBadInput);
  CHECK_FALSE(fs::exists(out));
}

}  // namespace swiftlet
