// Recorded flights, where they are present (SWIFTLET_DATA, default beside the source tree).

#include <cstdlib>

#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

struct Expected {
  const char* name;
  std::size_t frames;
  std::size_t samples;  ///< up to the last image
  std::size_t truth;
  const char* truth_folder;
};

TEST_CASE("recorded logs are read whole and in order", "[logs]") {
  const char* given = std::getenv("SWIFTLET_DATA");
  const fs::path data = given != nullptr ? given : SWIFTLET_DEFAULT_DATA;
  const std::vector<Expected> logs = {
      {"euroc_mh01_20s", 400, 4191, 4391, "state_groundtruth_estimate0"},
      {"euroc_v101_micro", 95, 941, 299, "state_groundtruth_openvins"},
      {"vil_v102", 400, 4011, 4015, "state_groundtruth_estimate0"},
      {"vil_mh05", 440, 4411, 4415, "state_groundtruth_estimate0"},
  };
  for (const Expected& expected : logs) {
    if (!fs::exists(data / expected.name)) {
      skipCase("no " + (data / expected.name).string(), kRunWithData);
      continue;
    }
    INFO(expected.name);
    const auto log = openLog((data / expected.name).string());
    CHECK(log->rig().camera_count == 2);
    CHECK(log->rig().baseline() == Approx(0.1100778).epsilon(1e-6));
    CHECK(log->frameCount() == expected.frames);
    CHECK(log->groundTruth().size() == expected.truth);
    CHECK(test::contains(log->groundTruthName(), expected.truth_folder));
    SensorMessage message;
    Stamp newest;
    std::size_t samples = 0;
    std::size_t pictures = 0;
    bool ordered = true;
    // Decoding belongs to the benchmarks; the first frames show that it works.
    while (pictures < 20 && log->next(message)) {
      const auto* frame = std::get_if<CameraFrame>(&message);
      const Stamp stamp = frame != nullptr ? frame->stamp : std::get<ImuSample>(message).stamp;
      ordered = ordered && stamp >= newest;
      newest = stamp;
      ++(frame != nullptr ? pictures : samples);
      if (frame != nullptr) CHECK(frame->image.width == 752);
    }
    CHECK(ordered);
    CHECK(pictures == 20);
    CHECK(samples >= 91);
    CHECK(samples <= expected.samples);
    CHECK(log->warnings().empty());
  }
}

}  // namespace
}  // namespace swiftlet
