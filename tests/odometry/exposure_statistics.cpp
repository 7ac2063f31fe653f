// What control of exposure and gain is worth when the light changes: rendered flights on recorded motions,
// whose light goes to a twentieth within 2 s, back, and down again, with the control in the loop and with
// exposure and gain as they were right at the start; beside them the control under constant light.
//   exposure_statistics --images FOLDER [--motions FOLDER] [--motion NAME] [--seeds N]
// Images are rendered into FOLDER, or found there. Motions: EuRoC's ground truth, a folder a flight, with
// groundtruth.csv.xz; all of them without --motion. Seeds: worlds, noise and sensor errors, 1 unless said.
// Exit code 1 when a figure misses; the ratio that counts is that of the mean errors over the seeds.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "tests/odometry/rendered_flight.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::RenderedFlight;
using test::RunFrame;

namespace {

constexpr double kDuration = 24;  // s
constexpr double kDim = 0.05;
constexpr double kMostAte = 1.3;  // times that under constant light
constexpr std::uint64_t kSeedStep = 10;

struct Motion {
  const char* name;
  double skip;  ///< s until it moves well
  std::uint64_t seed;
};
constexpr std::array kMotions = {Motion{"V1_01_easy", 8, 701}, Motion{"V1_02_medium", 12, 702},
                                 Motion{"V1_03_difficult", 12, 703}, Motion{"V2_01_easy", 8, 704},
                                 Motion{"V2_02_medium", 10, 705}};

struct Light {
  const char* name;
  ExposureMode mode;
  bool changes;
};
constexpr std::array kLights = {Light{"constant", ExposureMode::kOdometry, false},
                                Light{"changing", ExposureMode::kOdometry, true},
                                Light{"fixed", ExposureMode::kFixed, true}};

struct Figures {
  double ate = 0;     ///< m
  double tracks = 0;  ///< that went on from the frame before, mean
  double fewest = 0;  ///< likewise, of the tenth with the fewest
  double bad = 0;     ///< share of frames without a good state
};

SimulationSettings settingsOf(const std::string& motions, const Motion& motion, const Light& light) {
  SimulationSettings settings;
  settings.seed = motion.seed;
  settings.given_motion = motions + "/" + motion.name + "/groundtruth.csv.xz";
  settings.motion_skip = motion.skip;
  settings.flight.duration = kDuration;
  settings.depth_every = 0;
  settings.exposure_mode = light.mode;
  if (light.changes) settings.light_changes = {{6, kDim}, {12, 1}, {18, kDim}};
  return settings;
}

Figures figuresOf(const RenderedFlight& flight) {
  OdometrySettings settings;
  const std::vector<RunFrame> frames = flight.fly(flight.given(), settings);
  Figures figures;
  figures.ate = test::ate(frames, 1);
  std::vector<double> tracks;
  int bad = 0;
  for (const RunFrame& frame : frames) {
    if (frame.seconds < 1) continue;
    tracks.push_back(frame.statistics.known);
    figures.tracks += frame.statistics.known;
    bad += frame.has_state && frame.state.health == Health::kGood ? 0 : 1;
  }
  const auto count = static_cast<double>(tracks.size());
  figures.tracks /= count;
  figures.fewest = test::quantile(tracks, 0.1);
  figures.bad = bad / count;
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  std::string images;
  std::string motions = "../shared/data/euroc_imu_gt_all";
  std::string only;
  int seeds = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--images") == 0) images = argv[i + 1];
    if (std::strcmp(argv[i], "--motions") == 0) motions = argv[i + 1];
    if (std::strcmp(argv[i], "--motion") == 0) only = argv[i + 1];
    if (std::strcmp(argv[i], "--seeds") == 0) seeds = std::max(1, std::atoi(argv[i + 1]));
  }
  if (images.empty()) {
    std::fprintf(
        stderr,
        "usage: exposure_statistics --images FOLDER [--motions FOLDER] [--motion NAME] [--seeds N]\n");
    return 2;
  }
  std::printf("%-16s %-4s %-9s %8s %12s %12s %10s\n", "motion", "seed", "light", "ATE [m]", "tracks kept",
              "10 % least", "not good");
  bool good = true;
  for (Motion motion : kMotions) {
    if (!only.empty() && only != motion.name) continue;
    std::array<double, kLights.size()> ate = {};
    for (int seed = 0; seed < seeds; ++seed, motion.seed += kSeedStep) {
      std::array<Figures, kLights.size()> figures;
      for (std::size_t i = 0; i < kLights.size(); ++i) {
        const std::string folder =
            images + "/" + motion.name + "_" + std::to_string(motion.seed) + "_" + kLights[i].name;
        figures[i] = figuresOf(RenderedFlight(settingsOf(motions, motion, kLights[i]), folder));
        ate[i] += figures[i].ate / seeds;
        std::printf("%-16s %-4llu %-9s %8.4f %12.1f %12.1f %9.1f%%\n", motion.name,
                    static_cast<unsigned long long>(motion.seed), kLights[i].name, figures[i].ate,
                    figures[i].tracks, figures[i].fewest, 100 * figures[i].bad);
        std::fflush(stdout);
      }
      good = good && figures[1].tracks > figures[2].tracks;
    }
    std::printf("%-16s ATE %.2f times that of constant light, mean of %d\n", motion.name, ate[1] / ate[0],
                seeds);
    std::fflush(stdout);
    good = good && ate[1] <= kMostAte * ate[0];
  }
  return good ? 0 : 1;
}
