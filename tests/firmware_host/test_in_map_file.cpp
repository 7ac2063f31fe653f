// in_map.tum: its lines do not depend on when the words of loop closure come to the log.

#include <catch2/catch.hpp>
#include <vector>

#include "firmware_host/outputs/run_folder/in_map_file.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kFrames = 12;
constexpr std::uint64_t kKeyframeEvery = 3;

void addFrame(InMapFile& file, std::uint64_t frame) {
  file.addFrame(frame, Stamp{static_cast<std::int64_t>(frame) * 50'000'000}, NavState{});
}

/// What loop closure knew at this keyframe. The first has no location yet.
void addReport(InMapFile& file, std::uint64_t frame) {
  LoopReport report;
  report.frame = frame;
  report.correction.located = frame > 0;
  report.correction.T_map_world.translation.x() = static_cast<double>(frame);
  file.addReport(report);
}

/// Each frame comes before the report on it, which comes `late` frames after, or before; frames that are
/// `held` back come together.
std::string linesOf(std::uint64_t late, std::uint64_t held) {
  const ScratchFolder folder("in_map_file");
  const std::string path = folder.file("in_map.tum");
  InMapFile file(path);
  std::uint64_t next = 0;
  const auto bring = [&](std::uint64_t end) {
    for (; next < std::min(end, kFrames); ++next) addFrame(file, next);
  };
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
    if (frame % (held + 1) == held) bring(frame + 1);
    if (frame >= late && (frame - late) % kKeyframeEvery == 0) addReport(file, frame - late);
  }
  bring(kFrames);
  for (std::uint64_t frame = kFrames - late; frame < kFrames; ++frame) {
    if (frame % kKeyframeEvery == 0) addReport(file, frame);
  }
  file.finish();
  return test::textOf(path);
}

TEST_CASE("a line knows what loop closure knew at the newest keyframe up to it, whatever came late") {
  const std::string prompt = linesOf(0, 0);
  // Nothing before the first location; then the keyframe's own word.
  REQUIRE(prompt.starts_with("0.150000000 3.0"));
  CHECK(linesOf(5, 0) == prompt);
  CHECK(linesOf(kFrames, 0) == prompt);
  CHECK(linesOf(0, 1) == prompt);
  CHECK(linesOf(0, 6) == prompt);
  CHECK(linesOf(0, kFrames) == prompt);
}

}  // namespace
}  // namespace swiftlet
