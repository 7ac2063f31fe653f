// Does health tell the truth? Simulated flights of which half are spoiled (faulty_flight.hpp), each with two
// cameras and with one:
//   health_statistics [--flights N] [--cameras 1|2] [--images FOLDER] [--frames FILE]
// Without images: feature tracks, N flights without a fault (300 unless told) and as many with one. With
// images: 24 flights rendered into FOLDER, or found there, each with every fault of calibration, stamps and
// noise figures, without a fault with its own IMU and with one like that of the log imu_broad; and 4 with
// blurred images. FILE: CSV, a line a frame. Printed: seconds "good" with a velocity error above 1 m/s or,
// with one camera, a scale error above 20 %; how soon and for what share healthy flights are "good". Same
// seeds, same figures. Exit code 1 when a figure misses.

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "tests/odometry/faulty_flight.hpp"
#include "tests/odometry/health_verdict.hpp"
#include "tests/odometry/odometry_run.hpp"
#include "tests/odometry/rendered_flight.hpp"
#include "tests/support/parallel.hpp"

using namespace swiftlet;
using test::FaultyFlight;
using test::GivenFlight;
using test::HealthVerdict;
using test::RenderedFlight;
using test::RigFault;
using test::RunFrame;

namespace {

SimulationSettings flightSettings(int index, double duration) {
  constexpr std::array kRigs{RigKind::kEuroc, RigKind::kForward, RigKind::kWide, RigKind::kFisheye};
  constexpr std::array kWorlds{WorldKind::kRoom, WorldKind::kHall, WorldKind::kCluttered};
  SimulationSettings settings = test::roomFlight(duration, 500 + static_cast<std::uint64_t>(index));
  settings.rig = kRigs[static_cast<std::size_t>(index) % kRigs.size()];
  settings.world.kind = kWorlds[static_cast<std::size_t>(index / 4) % kWorlds.size()];
  settings.flight.aggressiveness = 0.5 + 0.5 * (index % 3);
  settings.flight.speed = 0.7 + 0.4 * (index % 5);
  settings.tracks.max_range = 25;
  settings.tracks.outlier_share = 0.02 * (index % 2);
  if (index % 4 == 3) settings.flight.rest_at_start = 3;
  return settings;
}

std::vector<RunFrame> fly(const FaultyFlight& flight, bool mono) {
  OdometrySettings settings;
  settings.use_stereo = !mono;
  Odometry odometry(flight.given.rig, flight.given.noise, settings);
  auto output = std::make_unique<OdometryOutput>();
  std::vector<RunFrame> frames;
  std::size_t next = 0;
  for (std::size_t k = 0; k < flight.frames.size(); ++k) {
    while (next < flight.given.samples.size() && flight.given.samples[next].stamp <= flight.frames[k].stamp) {
      static_cast<void>(odometry.addImu(flight.given.samples[next++]));
    }
    static_cast<void>(odometry.smooth(flight.frames[k], Effort{}, *output));
    RunFrame frame;
    frame.index = k;
    frame.seconds = flight.flight.seconds(k) - flight.flight.seconds(0);
    frame.truth = flight.flight.truth(k);
    test::take(*output, frame);
    frames.push_back(frame);
  }
  return frames;
}

struct Campaign {
  int flights = 300;
  int cameras = 0;  ///< 1 or 2 alone; 0: both
  std::string images;
  std::FILE* csv = nullptr;
  std::mutex mutex;
  std::vector<HealthVerdict> verdicts;

  void add(int run, const std::vector<RunFrame>& frames, double rest, RigFault fault, bool mono) {
    if (csv != nullptr) test::writeFrames(csv, run, frames, fault, mono);
    const HealthVerdict verdict = test::judgeHealth(frames, rest, fault, mono);
    const std::lock_guard lock(mutex);
    verdicts.push_back(verdict);
  }
};

// A flight without a fault and one with; every kind of fault in turn.
void flyTracks(Campaign& campaign, int run) {
  constexpr double kDuration = 20;  // s
  const int index = run / 2;
  const int kinds = static_cast<int>(test::kRigFaultNames.size()) - 1;
  const RigFault fault = run % 2 == 0 ? RigFault::kNone : static_cast<RigFault>(1 + index / 2 % kinds);
  const bool mono = index % 2 == 1;
  if (campaign.cameras == (mono ? 2 : 1)) return;
  SimulationSettings settings = flightSettings(index / 2, kDuration);
  settings.mono = mono;
  const FaultyFlight flight(settings, fault, static_cast<std::uint64_t>(run));
  campaign.add(run, fly(flight, mono), settings.flight.rest_at_start, fault, mono);
}

constexpr int kRenderedFlights = 24;
constexpr int kBlurredFlights = 4;
constexpr int kRunsPerFlight = 32;  // numbers set aside

void flyImages(Campaign& campaign, int index) {
  constexpr double kDuration = 15;         // s
  constexpr double kBlurExposure = 0.040;  // s
  constexpr std::array kFaults{RigFault::kFocal,  RigFault::kTurned, RigFault::kExchanged, RigFault::kLate,
                               RigFault::kJitter, RigFault::kLoud,   RigFault::kQuiet};
  const bool blurred = index >= kRenderedFlights;
  SimulationSettings settings = flightSettings(index, kDuration);
  settings.depth_every = 0;
  settings.threads = 1;
  settings.low_light = !blurred && index % 6 == 5;
  if (blurred) settings.render.exposure = kBlurExposure;
  const RenderedFlight flight(settings, campaign.images + "/health_" + std::to_string(index));
  int run = index * kRunsPerFlight;
  const auto add = [&](const GivenFlight& given, RigFault fault) {
    for (const bool mono : {false, true}) {
      if (campaign.cameras == (mono ? 2 : 1)) continue;
      OdometrySettings odometry;
      odometry.use_stereo = !mono;
      campaign.add(run++, flight.fly(given, odometry), settings.flight.rest_at_start, fault, mono);
    }
  };
  if (blurred) {
    add(flight.given(), RigFault::kBlur);
    return;
  }
  add(flight.given(), RigFault::kNone);
  add(flight.givenWithImu(test::broadImu(), settings.seed), RigFault::kNone);
  for (const RigFault fault : kFaults) {
    GivenFlight given = flight.given();
    test::spoil(fault, settings.seed, given);
    add(given, fault);
  }
}

}  // namespace

int main(int argc, char** argv) {
  Campaign campaign;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--flights") == 0) campaign.flights = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--cameras") == 0) campaign.cameras = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--images") == 0) campaign.images = argv[i + 1];
    if (std::strcmp(argv[i], "--frames") == 0) campaign.csv = std::fopen(argv[i + 1], "w");
  }
  if (campaign.csv != nullptr) test::writeFramesHeader(campaign.csv);
  if (campaign.images.empty()) {
    test::forEach(2 * campaign.flights, [&](int run) { flyTracks(campaign, run); });
  } else {
    test::forEach(kRenderedFlights + kBlurredFlights, [&](int index) { flyImages(campaign, index); });
  }
  if (campaign.csv != nullptr) std::fclose(campaign.csv);
  return test::printHealth(campaign.verdicts) ? 0 : 1;
}
